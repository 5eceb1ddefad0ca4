#include "simulator/corrosion/front_growth.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <queue>
#include <utility>

#include "simulator/corrosion/cells.h"
#include "simulator/corrosion/front_march.h"
#include "simulator/corrosion/front_replay.h"
#include "simulator/corrosion/mass_clock.h"
#include "simulator/corrosion/random_field.h"
#include "simulator/corrosion/starting_points.h"

namespace scatter::corrosion {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();
/// How far the front goes while the skin forms behind it [mm]: the width of a patch's shaded rim.
constexpr double kSkinWidthMm = 0.1;

/// What a run leaves.
struct History {
  DepthLaw law;
  std::vector<float> births;  ///< Tau [mm] at which the front arrives; infinite where it does not.
  std::vector<float> rates;   ///< Shares of the thickness per mm of tau.
  std::vector<WaitingSeed> late;
  MassClock clock;
  double final_loss = 0;  ///< Share of the metal that is gone at the last age.
  bool exhausted = false;
};

class FrontGrowth final : public Growth {
 public:
  FrontGrowth(GrowthOptions options, std::vector<std::string> notes, History history)
      : Growth(std::move(options), std::move(notes)),
        opening_(openings_of(this->options())),
        history_(std::move(history)),
        birth_years_(find_birth_years()) {}

  [[nodiscard]] FrontView view() const noexcept {
    return {.skin = history_.law.skin,
            .skin_width_mm = history_.law.width,
            .births_mm = history_.births,
            .rates = history_.rates,
            .opening = opening_};
  }
  /// Tau at which each age's attainable loss is reached; `losses` receives those losses, as shares of the
  /// metal.
  [[nodiscard]] std::vector<double> taus(std::span<const double> ages_years,
                                         std::vector<double>& losses) const;

 protected:
  void replay(std::span<const double> ages_years,
              const std::function<void(const Sheet&)>& visit) const override;

 private:
  [[nodiscard]] std::shared_ptr<const std::vector<float>> find_birth_years() const;

  std::vector<std::uint8_t> opening_;
  History history_;
  std::shared_ptr<const std::vector<float>> birth_years_;
};

/// Ages are linear in tau between the edges of bins, which are 0.1 % of tau wide.
std::shared_ptr<const std::vector<float>> FrontGrowth::find_birth_years() const {
  const auto points = history_.clock.edges();
  const double metal = metal_g_per_m2(options());
  std::vector<double> ages{0};
  ages.reserve(points.size() + 1);
  for (const auto& point : points) {
    ages.push_back(std::min(age_of_loss_years(options().corrosivity, options().law, point.loss * metal),
                            options().age_years));
  }
  auto years = std::make_shared<std::vector<float>>(history_.births.size(), kNever);
  for (std::size_t cell = 0; cell < years->size(); ++cell) {
    if (const double birth = history_.births[cell]; birth < static_cast<double>(kNever)) {
      const std::size_t bin = std::min(MassClock::bin_of(birth), points.size() - 1);
      const double lower = bin == 0 ? 0 : points[bin - 1].tau;
      const double share = std::min((birth - lower) / (points[bin].tau - lower), 1.0);
      (*years)[cell] = static_cast<float>(ages[bin] + share * (ages[bin + 1] - ages[bin]));
    }
  }
  return years;
}

std::vector<double> FrontGrowth::taus(std::span<const double> ages_years, std::vector<double>& losses) const {
  const double metal = metal_g_per_m2(options());
  losses.clear();
  for (const double age : ages_years) {
    losses.push_back(attainable_loss_g_per_m2(options(), age) / metal);
  }
  std::vector<double> found = history_.clock.solve(losses, history_.births, history_.rates);
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!(losses[i] > 0)) {
      // Before the first age nothing is corroded, not even the starting points.
      found[i] = -1;
    }
  }
  return found;
}

void FrontGrowth::replay(std::span<const double> ages_years,
                         const std::function<void(const Sheet&)>& visit) const {
  const double metal = metal_g_per_m2(options());
  std::vector<double> losses;
  const std::vector<double> reached = taus(ages_years, losses);

  FrontReplay show({.law = history_.law,
                    .births = history_.births,
                    .rates = history_.rates,
                    .opening = opening_,
                    .late = history_.late},
                   options(), birth_years_);
  for (std::size_t i = 0; i < ages_years.size(); ++i) {
    Sheet& sheet = show.show(reached[i]);
    sheet.age_years = ages_years[i];
    sheet.target_g_per_m2 = mass_loss_g_per_m2(options().corrosivity, options().law, ages_years[i]);
    sheet.exhausted = losses[i] * metal < sheet.target_g_per_m2 * (1 - 1e-12) ||
                      (history_.exhausted && losses[i] > history_.final_loss);
    visit(sheet);
  }
}

/// exp(sigma g - sigma^2 variance / 2): 1 on average.
class LogNormal {
 public:
  LogNormal(double sigma, double variance)
      : sigma_(static_cast<float>(sigma)), shift_(static_cast<float>(sigma * sigma * variance / 2)) {}
  [[nodiscard]] float operator()(float normal) const { return std::exp(sigma_ * normal - shift_); }

 private:
  float sigma_;
  float shift_;
};

/// How long the front takes per mm, and how fast each cell deepens behind it.
struct Speeds {
  std::vector<float> slowness;
  std::vector<float> rates;
};

Speeds speeds_of(const GrowthOptions& options, std::span<const float> susceptibility) {
  const FrontOptions& front = options.front;
  // A scale that is longer than what it belongs to would leave nothing.
  const auto spectrum = [&](double length_mm, double roughness) {
    return FieldSpectrum{
        .length_mm = length_mm,
        .roughness = roughness,
        .finest_mm = std::min({front.finest_mm, front.front_length_mm, front.pit_length_mm})};
  };
  FieldPair fields = random_fields(options.seed, options.side, options.extent_mm,
                                   {spectrum(front.front_length_mm, front.front_roughness),
                                    spectrum(front.pit_length_mm, front.pit_roughness)});
  const LogNormal speed(front.front_sigma, fields.variance[0]);
  const LogNormal depth(front.pit_sigma, fields.variance[1]);
  Speeds speeds{.slowness = std::move(fields.values[0]), .rates = std::move(fields.values[1])};
  const std::vector<float> material = on_grid(options.material, options.side);
  const std::vector<float> exposure = on_grid(options.exposure, options.side);
  const auto neutral = static_cast<float>(2 * front.depth_per_spread / options.thickness_mm);
  for (std::size_t cell = 0; cell < susceptibility.size(); ++cell) {
    const float way = 2 * susceptibility[cell] * speed(speeds.slowness[cell]);
    speeds.slowness[cell] = way > 0 ? 1 / way : kNever;
    speeds.rates[cell] = neutral * (1 - material[cell]) * exposure[cell] * depth(speeds.rates[cell]);
  }
  return speeds;
}

/// Late seeds that have appeared but not broken out, soonest first.
struct Outbreak {
  double mass_g_per_m2 = 0;
  std::uint32_t cell = 0;
  [[nodiscard]] bool operator>(const Outbreak& other) const {
    return std::pair(mass_g_per_m2, cell) > std::pair(other.mass_g_per_m2, other.cell);
  }
};
using Outbreaks = std::priority_queue<Outbreak, std::vector<Outbreak>, std::greater<>>;

}  // namespace

Result<std::shared_ptr<const Growth>> grow_front(GrowthOptions options, std::vector<std::string> notes,
                                                 const Growth::Progress& progress,
                                                 const std::stop_token& stop) {
  const std::vector<std::uint8_t> opening = openings_of(options);
  const std::vector<float> susceptibility = susceptibility_of(options, opening);
  const auto starts =
      draw_starting_points(susceptibility, options.side, options.seed, options.starting_points);
  if (!starts) {
    return std::unexpected(starts.error());
  }
  const auto open = static_cast<std::size_t>(std::count(opening.begin(), opening.end(), std::uint8_t{1}));
  const DepthLaw law{.skin = options.front.skin_um / 1000 / options.thickness_mm, .width = kSkinWidthMm};
  Speeds speeds = speeds_of(options, susceptibility);
  FrontMarch march(std::move(speeds.slowness), options.side,
                   options.extent_mm / static_cast<double>(options.side), options.border);
  for (const std::uint32_t cell : *starts) {
    march.start(cell, 0);
  }

  History history{.law = law,
                  .births = {},
                  .rates = std::move(speeds.rates),
                  .late = {},
                  .clock = MassClock(law, susceptibility.size() - open)};
  const double metal = metal_g_per_m2(options);
  const double goal = attainable_loss_g_per_m2(options, options.age_years) / metal;
  const double gap = 1000 / late_points_of(options);
  const Places places(susceptibility, options.side);
  LateSeeds late(places, options.seed, late_points_of(options));
  Outbreaks outbreaks;
  double shown = 0;
  while (history.clock.loss() < goal && !(march.done() && history.clock.idle())) {
    const auto edge = static_cast<float>(history.clock.edge());
    for (const std::uint32_t cell : march.advance(edge)) {
      history.clock.add(march.times()[cell], history.rates[cell]);
    }
    const double loss_g_per_m2 = history.clock.close_bin() * metal;
    for (; late.next().mass_g_per_m2 <= loss_g_per_m2; late.advance()) {
      const LateSeed& seed = late.next();
      if (!(march.times()[seed.cell] < edge)) {  // else it fell on rust
        history.late.push_back({.cell = seed.cell, .since = edge});
        outbreaks.push({.mass_g_per_m2 = seed.mass_g_per_m2 + seed.wait * gap, .cell = seed.cell});
      }
    }
    for (; !outbreaks.empty() && outbreaks.top().mass_g_per_m2 <= loss_g_per_m2; outbreaks.pop()) {
      march.start(outbreaks.top().cell, edge);
    }
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "corrosion: stopped before the sheet was as old as asked for",
                  "run it again");
    }
    const double share = goal > 0 ? std::min(history.clock.loss() / goal, 1.0) : 1;
    if (progress && share >= shown + 0.01) {
      progress(share);
      shown = share;
    }
  }
  history.exhausted = history.clock.loss() < goal;
  history.final_loss = std::min(history.clock.loss(), goal);
  history.births = std::move(march).take_times();
  // The march went on to the end of a bin, and came near cells that it did not reach.
  const double end =
      goal > 0 ? history.clock.solve({&history.final_loss, 1}, history.births, history.rates)[0] : -1;
  for (float& birth : history.births) {
    birth = static_cast<double>(birth) <= end ? birth : kNever;
  }
  if (progress) {
    progress(1);
  }
  return std::make_shared<FrontGrowth>(std::move(options), std::move(notes), std::move(history));
}

std::optional<FrontView> front_of(const Growth& growth) noexcept {
  const auto* front = dynamic_cast<const FrontGrowth*>(&growth);
  return front == nullptr ? std::nullopt : std::optional(front->view());
}

std::vector<double> front_clock_mm(const Growth& growth, std::span<const double> ages_years) {
  const auto* front = dynamic_cast<const FrontGrowth*>(&growth);
  std::vector<double> losses;
  return front == nullptr ? std::vector<double>{} : front->taus(ages_years, losses);
}

}  // namespace scatter::corrosion
