#include "simulator/corrosion/growth.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <new>
#include <optional>
#include <utility>

#include "simulator/corrosion/event_growth.h"
#include "simulator/corrosion/front_growth.h"

namespace scatter::corrosion {
namespace {

Result<std::shared_ptr<const Growth>> grow(GrowthOptions options, std::vector<std::string> notes,
                                           const Growth::Progress& progress, const std::stop_token& stop) {
  return options.mode == Mode::kPhysical ? grow_front(std::move(options), std::move(notes), progress, stop)
                                         : grow_events(std::move(options), std::move(notes), progress, stop);
}

}  // namespace

Result<std::shared_ptr<const Growth>> Growth::run(GrowthOptions options, const Progress& progress,
                                                  const std::stop_token& stop) {
  const std::size_t side = options.side;
  try {
    std::vector<std::string> notes;
    if (const Status settled = settle(options, notes); !settled) {
      return std::unexpected(settled.error());
    }
    return grow(std::move(options), std::move(notes), progress, stop);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("side: memory does not suffice for {} x {} cells", side, side),
                "give a smaller side");
  }
}

std::vector<Result<std::shared_ptr<const Growth>>> Growth::run_all(std::span<const GrowthOptions> options,
                                                                   const Progress& progress,
                                                                   const std::stop_token& stop) {
  std::vector<std::optional<Result<std::shared_ptr<const Growth>>>> slots(options.size());
  std::mutex mutex;
  std::size_t finished = 0;
  tbb::parallel_for(std::size_t{0}, options.size(), [&](std::size_t i) {
    slots[i] = run(options[i], {}, stop);
    const std::scoped_lock lock(mutex);
    ++finished;
    if (progress) {
      progress(static_cast<double>(finished) / static_cast<double>(options.size()));
    }
  });
  std::vector<Result<std::shared_ptr<const Growth>>> results;
  results.reserve(slots.size());
  for (auto& slot : slots) {
    results.push_back(std::move(*slot));
  }
  return results;
}

Result<Sheet> Growth::at(double age_years) const {
  if (!std::isfinite(age_years)) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("age: is {} years", age_years),
                fmt::format("give 0 to {} years", options_.age_years));
  }
  const double age = std::clamp(age_years, 0.0, options_.age_years);
  try {
    Sheet result;
    replay({&age, 1}, [&result](const Sheet& sheet) { result = sheet; });
    return result;
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("side: memory does not suffice for {} x {} cells", options_.side, options_.side),
                "give a smaller side");
  }
}

Status Growth::each(std::span<const double> ages_years,
                    const std::function<void(const Sheet&)>& visit) const {
  std::vector<double> ages(ages_years.begin(), ages_years.end());
  for (std::size_t i = 0; i < ages.size(); ++i) {
    if (!std::isfinite(ages[i]) || (i > 0 && ages_years[i] < ages_years[i - 1])) {
      return fail(
          ErrorCode::kInvalidArgument,
          fmt::format("ages: entry {} is {} years after {}", i, ages[i], i > 0 ? ages_years[i - 1] : 0.0),
          "give finite ages that do not fall");
    }
    ages[i] = std::clamp(ages[i], 0.0, options_.age_years);
  }
  try {
    replay(ages, visit);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("side: memory does not suffice for {} x {} cells", options_.side, options_.side),
                "give a smaller side");
  }
  return {};
}

}  // namespace scatter::corrosion
