#include "tools/scatter/corroded_batch.h"

#include <fmt/format.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>

#include "simulator/corrosion/growth.h"
#include "tools/scatter/files.h"
#include "tools/scatter/machine_memory.h"
#include "tools/scatter/sheet_picture.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;
using corrosion::Growth;
using corrosion::Sheet;

/// While one sheet is grown or written, the most of both: 125 measured in the hungrier mode, and room to
/// spare.
constexpr std::uint64_t kBytesPerCell = 200;
/// Mode::kThesis keeps every hit.
constexpr double kBytesPerHit = 4;
constexpr std::uint64_t kBytesBeside = 100'000'000;
constexpr std::size_t kTileSide = 220;
/// Share of the time that growing takes, for the bar.
constexpr double kGrowing = 0.6;

plot::StripTile tile_of(const images::Image& preview, std::string caption) {
  const images::Image small = scaled_down(preview, kTileSide);
  plot::StripTile tile{
      .width = small.width, .height = small.height, .rgb = {}, .caption = std::move(caption)};
  tile.rgb.reserve(small.values.size());
  for (const float value : small.values) {
    tile.rgb.push_back(
        static_cast<std::uint8_t>(std::lround(255 * std::clamp(images::linear_to_srgb(value), 0.0F, 1.0F))));
  }
  return tile;
}

SheetFigures figures_of(const Sheet& sheet, std::uint64_t seed) {
  return {.seed = seed,
          .age_years = sheet.age_years,
          .target_g_per_m2 = sheet.target_g_per_m2,
          .mass_loss_g_per_m2 = sheet.mass_loss_g_per_m2,
          .corroded_fraction = sheet.corroded_fraction,
          .state3_fraction = sheet.state3_fraction,
          .hole_fraction = sheet.hole_fraction,
          .events = sheet.events,
          .exhausted = sheet.exhausted,
          .hash = corrosion::hash(sheet),
          .tile = {}};
}

/// All ages of one seed.
class OneRun {
 public:
  OneRun(const CorrodePlan& plan, std::uint64_t seed, fs::path folder, const std::stop_token& stop)
      : plan_(plan), seed_(seed), folder_(std::move(folder)), stop_(stop) {}

  /// `progress` may be empty.
  Result<GrownSheets> run(const std::function<void(double)>& progress) {
    const auto start = std::chrono::steady_clock::now();
    corrosion::GrowthOptions options = plan_.growth;
    options.seed = seed_;
    const auto growth = Growth::run(options, [&](double share) { tell(progress, kGrowing * share); }, stop_);
    if (!growth) {
      return std::unexpected(stop_.stop_requested() ? stopped().error() : growth.error());
    }
    grown_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    grown_.used = (*growth)->options();
    grown_.notes.assign((*growth)->notes().begin(), (*growth)->notes().end());
    // Written as they pass by, for only one sheet is there at a time.
    auto last = std::chrono::steady_clock::now();
    const Status shown = (*growth)->each(plan_.ages, [&](const Sheet& sheet) {
      grown_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - last).count();
      if (done_) {
        done_ = write(sheet);
      }
      tell(progress, kGrowing + (1 - kGrowing) * static_cast<double>(grown_.figures.size()) /
                                    static_cast<double>(plan_.ages.size()));
      last = std::chrono::steady_clock::now();
    });
    if (!shown || !done_) {
      return std::unexpected(shown ? done_.error() : shown.error());
    }
    return std::move(grown_);
  }

 private:
  static void tell(const std::function<void(double)>& progress, double share) {
    if (progress) {
      progress(share);
    }
  }

  Status write(const Sheet& sheet) {
    const fs::path folder = plan_.series ? folder_ / age_folder(sheet.age_years) : folder_;
    if (const Status ready = prepare_folder(folder); !ready) {
      return ready;
    }
    // Or a thread that waits for rows of a picture might begin another sheet, beyond what memory allows.
    const auto preview = tbb::this_task_arena::isolate(
        [&] { return write_sheet(sheet, plan_.appearance, plan_.set, folder, stop_); });
    if (!preview) {
      return std::unexpected(preview.error());
    }
    SheetFigures figures = figures_of(sheet, seed_);
    if (plan_.series || plan_.batch) {
      const char* const unit = sheet.age_years == 1 ? "year" : "years";
      figures.tile = tile_of(*preview, plan_.series ? fmt::format("{:g} {}", sheet.age_years, unit)
                                                    : fmt::format("seed {}", seed_));
    }
    grown_.figures.push_back(std::move(figures));
    return {};
  }

  const CorrodePlan& plan_;
  std::uint64_t seed_;
  fs::path folder_;
  const std::stop_token& stop_;
  GrownSheets grown_;
  Status done_;
};

std::uint64_t bytes_per_cell(const corrosion::GrowthOptions& growth) {
  if (growth.mode != corrosion::Mode::kThesis || !(growth.events.bite > 0)) {
    return kBytesPerCell;
  }
  const double share_lost =
      corrosion::attainable_loss_g_per_m2(growth, growth.age_years) / corrosion::metal_g_per_m2(growth);
  return kBytesPerCell +
         static_cast<std::uint64_t>(std::min(1e9, kBytesPerHit * share_lost / growth.events.bite));
}

/// How many sheets fit at a time; at least one.
Result<std::size_t> sheets_at_a_time(const CorrodePlan& plan) {
  const std::uint64_t each = bytes_per_cell(plan.growth);
  const std::uint64_t one = each * plan.growth.side * plan.growth.side + kBytesBeside;
  const std::uint64_t there = available_memory();
  if (there != 0 && one > there) {
    return fail(
        ErrorCode::kResourceExhausted,
        fmt::format("size: {} x {} cells need about {:.1f} GB of memory, {:.1f} GB are free",
                    plan.growth.side, plan.growth.side, static_cast<double>(one) * 1e-9,
                    static_cast<double>(there) * 1e-9),
        fmt::format("give --size {} or less", static_cast<std::size_t>(std::sqrt(
                                                  static_cast<double>(there - std::min(there, kBytesBeside)) /
                                                  static_cast<double>(each)))));
  }
  const auto cores = static_cast<std::uint64_t>(tbb::info::default_concurrency());
  const std::uint64_t fit = there == 0 ? 1 : there / one;
  return static_cast<std::size_t>(std::clamp<std::uint64_t>(std::min(cores, fit), 1, plan.seeds.size()));
}

}  // namespace

std::string age_folder(double age_years) {
  return fmt::format("age-{:g}", age_years);
}

Result<GrownSheets> grow_and_write(const CorrodePlan& plan, const fs::path& folder,
                                   const std::function<void(double)>& progress, const std::stop_token& stop) {
  const auto at_a_time = sheets_at_a_time(plan);
  if (!at_a_time) {
    return std::unexpected(at_a_time.error());
  }
  if (!plan.batch) {
    return OneRun(plan, plan.seeds.front(), folder, stop).run(progress);
  }
  std::vector<std::optional<Result<GrownSheets>>> runs(plan.seeds.size());
  std::mutex mutex;
  std::size_t finished = 0;
  bool failed = false;
  tbb::task_arena arena(static_cast<int>(*at_a_time));
  arena.execute([&] {
    const auto one = [&](std::size_t k) {
      {
        const std::scoped_lock lock(mutex);
        if (failed) {
          return;
        }
      }
      runs[k] = OneRun(plan, plan.seeds[k], folder / fmt::format("seed-{}", plan.seeds[k]), stop).run({});
      const std::scoped_lock lock(mutex);
      failed = failed || !*runs[k];
      ++finished;
      progress(static_cast<double>(finished) / static_cast<double>(runs.size()));
    };
    tbb::parallel_for(std::size_t{0}, runs.size(), one, tbb::simple_partitioner());
  });
  GrownSheets all;
  for (auto& run : runs) {
    if (run && !*run) {
      return std::unexpected(run->error());
    }
  }
  all.used = (*runs.front())->used;
  all.notes = (*runs.front())->notes;
  for (auto& run : runs) {
    all.seconds += (*run)->seconds;
    std::ranges::move((*run)->figures, std::back_inserter(all.figures));
  }
  return all;
}

}  // namespace scatter::cli
