#include "simulator/corrosion/event_growth.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <type_traits>
#include <utility>

#include "simulator/corrosion/cells.h"
#include "simulator/corrosion/draws.h"
#include "simulator/corrosion/event_cells.h"
#include "simulator/corrosion/event_log.h"
#include "simulator/corrosion/event_metal.h"
#include "simulator/corrosion/event_picker.h"
#include "simulator/corrosion/event_replay.h"
#include "simulator/corrosion/event_setup.h"
#include "simulator/corrosion/starting_points.h"

namespace scatter::corrosion {
namespace {

/// 8 GiB of log.
constexpr std::size_t kMostEvents = std::size_t{1} << 31U;
/// Between two looks at whether to stop.
constexpr std::size_t kEventsBetweenReports = std::size_t{1} << 16U;

class EventGrowth final : public Growth {
 public:
  EventGrowth(GrowthOptions options, std::vector<std::string> notes, EventSetup setup, EventLog log)
      : Growth(std::move(options), std::move(notes)), setup_(std::move(setup)), log_(std::move(log)) {}

 protected:
  void replay(std::span<const double> ages_years,
              const std::function<void(const Sheet&)>& visit) const override {
    EventReplay replay(options(), setup_, log_, birth_years());
    for (const double age : ages_years) {
      replay.show(age, visit);
    }
  }

 private:
  /// Made when the first sheet is asked for.
  [[nodiscard]] std::shared_ptr<const std::vector<float>> birth_years() const {
    std::call_once(birth_made_, [this] {
      auto years = std::make_shared<std::vector<float>>(options().side * options().side,
                                                        std::numeric_limits<float>::infinity());
      auto lost = log_.lost_before_width.begin();
      for (const std::uint32_t event : log_.events) {
        if ((event & EventLog::kDepth) == 0) {
          (*years)[event] = static_cast<float>(
              age_of_loss_years(options().corrosivity, options().law,
                                loss_of_units(options(), setup_, static_cast<double>(*lost++))));
        }
      }
      birth_years_ = std::move(years);
    });
    return birth_years_;
  }

  EventSetup setup_;
  EventLog log_;
  mutable std::once_flag birth_made_;
  mutable std::shared_ptr<const std::vector<float>> birth_years_;
};

/// One run. Width and Depth are the ways to pick (event_picker.h), Metal the way to keep what is left
/// (event_metal.h).
template <typename Width, typename Depth, typename Metal>
class EventRun {
 public:
  EventRun(const GrowthOptions& options, const EventSetup& setup, Width width, Depth depth)
      : setup_(&setup),
        cells_(setup),
        metal_(setup),
        width_(std::move(width)),
        depth_(std::move(depth)),
        target_(target_units(options, setup, options.age_years)),
        simple_(setup.deepens && !setup.conversion_removes && setup.largest_bite < 1),
        may_perforate_(setup.conversion_removes || setup.largest_bite >= 1) {
    const double events =
        static_cast<double>(target_) / kUnitsPerThickness / static_cast<double>(setup.largest_bite);
    if (events >= 0 && events < 1e8) {  // Not when the bite is nothing.
      log_.events.reserve(static_cast<std::size_t>(events) + 1024);
      log_.lost_before_width.reserve(static_cast<std::size_t>(events / 2) + 1024);
    }
  }

  Status run(const std::vector<std::uint32_t>& points, LateSeeds& late, double units_per_g_per_m2,
             const Growth::Progress& progress, const std::stop_token& stop) {
    start(points);
    double late_at = late.next().mass_g_per_m2 * units_per_g_per_m2;
    std::size_t report_at = 0;
    while (removed_ < target_ && !(width_.empty() && depth_.empty())) {
      pass();
      while (static_cast<double>(removed_) >= late_at && removed_ < target_) {
        const std::uint32_t cell = late.next().cell;
        if (!cells_.known(cell)) {
          cells_.threaten(cell);
          width_.add(cell);
          log_.late_seeds.push_back({log_.events.size(), cell});
        }
        late.advance();
        late_at = late.next().mass_g_per_m2 * units_per_g_per_m2;
      }
      if (log_.events.size() >= report_at) {
        report_at += kEventsBetweenReports;
        if (stop.stop_requested()) {
          return fail(ErrorCode::kAborted, "corrosion: stopped", "start it again");
        }
        if (progress) {
          progress(static_cast<double>(removed_) / static_cast<double>(target_));
        }
        if (log_.events.size() > kMostEvents) {
          return fail(ErrorCode::kResourceExhausted,
                      fmt::format("events.bite: the age takes more than {} hits", kMostEvents),
                      "give a larger bite, a darker material, a smaller side or a lower age");
        }
      }
    }
    return {};
  }

  EventLog take_log() { return std::move(log_); }

 private:
  static constexpr bool kAllAlike = std::is_same_v<Width, EvenPicker> && std::is_same_v<Depth, EvenPicker>;

  /// Points of which one touches another are threatened already, and lists only let go of what was picked: so
  /// the lists are filled when all points have corroded.
  void start(const std::vector<std::uint32_t>& points) {
    std::vector<std::uint32_t> threatened;
    std::vector<std::uint32_t> enclosed;
    for (const std::uint32_t point : points) {
      if (removed_ >= target_) {
        break;
      }
      corrode(
          point, [&](std::uint32_t cell) { threatened.push_back(cell); },
          [&](std::uint32_t cell) { enclosed.push_back(cell); });
    }
    for (const std::uint32_t cell : threatened) {
      if (!cells_.corroded(cell)) {
        width_.add(cell);
      }
    }
    for (const std::uint32_t cell : enclosed) {
      deepen_from_now(cell);
    }
  }

  /// One event of each kind, both picked before either happens.
  void pass() {
    const bool widens = !width_.empty();
    const bool deepens = !depth_.empty();
    Pick reached{};
    Pick deepened{};
    if (widens) {
      reached = width_.pick([this](std::uint32_t cell) {
        cells_.fetch(cell);
        metal_.fetch(cell);
      });
    }
    if (deepens) {
      deepened = depth_.pick([this](std::uint32_t cell) { metal_.fetch(cell); });
    }
    if (widens) {
      width_.remove(reached);
      widen(reached.cell);
    }
    if (deepens && removed_ < target_) {
      log_.events.push_back(deepened.cell | EventLog::kDepth);
      removed_ += metal_.hit(deepened.cell);
      if (metal_.gone(deepened.cell)) {
        depth_.remove(deepened);
      }
    }
  }

  void widen(std::uint32_t cell) {
    if constexpr (kAllAlike) {
      if (simple_ && !cells_.at_border(cell)) {
        bite_for_width(cell);
        const Around around = cells_.corrode_inside(cell);
        width_.add_around(cell, setup_->side, around.threatened);
        depth_.add_around(cell, setup_->side, around.enclosed);
        return;
      }
    }
    corrode(
        cell, [this](std::uint32_t other) { width_.add(other); },
        [this](std::uint32_t other) { deepen_from_now(other); });
  }

  void bite_for_width(std::uint32_t cell) {
    log_.events.push_back(cell);
    log_.lost_before_width.push_back(static_cast<float>(removed_));
    removed_ += metal_.hit(cell);
  }

  template <typename Threatened, typename Enclosed>
  void corrode(std::uint32_t cell, Threatened&& threatened, Enclosed&& enclosed) {
    bite_for_width(cell);
    cells_.corrode(cell, threatened, [&](std::uint32_t other) {
      if (setup_->conversion_removes) {
        removed_ += metal_.hit(other);
      }
      enclosed(other);
    });
  }

  void deepen_from_now(std::uint32_t cell) {
    if (setup_->deepens && (!may_perforate_ || !metal_.gone(cell))) {
      depth_.add(cell);
    }
  }

  const EventSetup* setup_;
  EventCells cells_;
  Metal metal_;
  Width width_;
  Depth depth_;
  EventLog log_;
  std::int64_t removed_ = 0;  ///< Units.
  std::int64_t target_;
  bool simple_;         ///< Enclosed cells deepen, whichever they are.
  bool may_perforate_;  ///< By the first bite, or by the one that its conversion takes.
};

template <typename Metal, typename Width, typename Depth>
Result<EventLog> run_events(const GrowthOptions& options, const EventSetup& setup,
                            const std::vector<std::uint32_t>& points, LateSeeds& late, Width width,
                            Depth depth, const Growth::Progress& progress, const std::stop_token& stop) {
  EventRun<Width, Depth, Metal> run(options, setup, std::move(width), std::move(depth));
  const Status status = run.run(points, late, units_of_loss(options, setup, 1), progress, stop);
  if (!status) {
    return std::unexpected(status.error());
  }
  return run.take_log();
}

}  // namespace

Result<std::shared_ptr<const Growth>> grow_events(GrowthOptions options, std::vector<std::string> notes,
                                                  const Growth::Progress& progress,
                                                  const std::stop_token& stop) {
  std::vector<std::uint8_t> opening = openings_of(options);
  // One value instead of a map where it is the same everywhere: nothing to fill, sum and compare.
  const bool even =
      opening.empty() && options.surface.values.size() == 1 && options.exposure.values.size() == 1;
  GrowthOptions one_cell = options;
  one_cell.side = 1;
  const std::vector<float> susceptibility = susceptibility_of(even ? one_cell : options, opening);
  auto points = draw_starting_points(susceptibility, options.side, options.seed, options.starting_points);
  if (!points) {
    return std::unexpected(points.error());
  }
  EventSetup setup = event_setup(options, std::move(opening), susceptibility);
  const Places places(susceptibility, options.side);
  LateSeeds late(places, options.seed, late_points_of(options));

  const simulator::RandomKey width_key = key_of(options.seed, Draw::kEvents, 0);
  const simulator::RandomKey depth_key = key_of(options.seed, Draw::kEvents, 1);
  const auto run = [&]<typename Metal>(auto width, auto depth) {
    return run_events<Metal>(options, setup, *points, late, std::move(width), std::move(depth), progress,
                             stop);
  };
  const bool all_alike = setup.width_weight.empty() && setup.depth_weight.empty();
  auto log = all_alike && MetalHits::suits(setup)
                 ? run.operator()<MetalHits>(EvenPicker(width_key, setup.metal_cells),
                                             EvenPicker(depth_key, setup.metal_cells))
             : all_alike ? run.operator()<MetalHeights>(EvenPicker(width_key, setup.metal_cells),
                                                        EvenPicker(depth_key, setup.metal_cells))
             : setup.width_weight.empty()
                 ? run.operator()<MetalHeights>(EvenPicker(width_key, setup.metal_cells),
                                                WeightedPicker(depth_key, setup.depth_weight))
             : setup.depth_weight.empty()
                 ? run.operator()<MetalHeights>(WeightedPicker(width_key, setup.width_weight),
                                                EvenPicker(depth_key, setup.metal_cells))
                 : run.operator()<MetalHeights>(WeightedPicker(width_key, setup.width_weight),
                                                WeightedPicker(depth_key, setup.depth_weight));
  if (!log) {
    return std::unexpected(log.error());
  }
  return std::make_shared<const EventGrowth>(std::move(options), std::move(notes), std::move(setup),
                                             std::move(*log));
}

}  // namespace scatter::corrosion
