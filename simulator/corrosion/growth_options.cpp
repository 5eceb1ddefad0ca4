#include "simulator/corrosion/growth_options.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace scatter::corrosion {
namespace {

Status within(const char* parameter, double value, double lowest, double highest, const char* unit = "") {
  // Written so that it is true for a NaN.
  if (!(value >= lowest && value <= highest)) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{}: is {}{}", parameter, value, unit),
                fmt::format("give {} to {}{}", lowest, highest, unit));
  }
  return {};
}

template <typename Enum>
Status known(const char* parameter, Enum value, Enum last, const char* names) {
  if (value > last) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: {} is none of them", parameter, static_cast<unsigned>(value)),
                fmt::format("give one of: {}", names));
  }
  return {};
}

/// The first error, if any.
Status first_of(std::initializer_list<Status> statuses) {
  for (const Status& status : statuses) {
    if (!status) {
      return status;
    }
  }
  return {};
}

Status check_event_options(const EventOptions& events) {
  return within("events.bite", events.bite, 1e-5, 1);
}

Status check_front_options(const FrontOptions& front) {
  return first_of({within("front.depth_per_spread", front.depth_per_spread, 0, 1000, " mm/mm"),
                   within("front.skin_um", front.skin_um, 0, 1e6, " um"),
                   within("front.front_sigma", front.front_sigma, 0, 3),
                   within("front.front_length_mm", front.front_length_mm, 1e-3, 1e5, " mm"),
                   within("front.pit_sigma", front.pit_sigma, 0, 3),
                   within("front.front_roughness", front.front_roughness, 0.05, 4),
                   within("front.pit_length_mm", front.pit_length_mm, 1e-3, 1e5, " mm"),
                   within("front.pit_roughness", front.pit_roughness, 0.05, 4),
                   within("front.finest_mm", front.finest_mm, 1e-3, 1e5, " mm")});
}

}  // namespace

double metal_g_per_m2(const GrowthOptions& options) noexcept {
  return options.thickness_mm * 1000 * kSteelGramsPerSquareMetrePerUm;
}

double attainable_loss_g_per_m2(const GrowthOptions& options, double years) noexcept {
  return std::min(mass_loss_g_per_m2(options.corrosivity, options.law, years),
                  metal_g_per_m2(options) * (1 - options.reserve));
}

std::vector<float> susceptibility_of(const GrowthOptions& options, std::span<const std::uint8_t> opening) {
  std::vector<float> result = on_grid(options.surface, options.side);
  const auto least = static_cast<float>(options.least_susceptibility);
  for (float& value : result) {
    value = std::max(1 - value, least);
  }
  if (options.exposure.values.size() > 1 || options.exposure.values[0] != 1) {
    const std::vector<float> exposure = on_grid(options.exposure, options.side);
    for (std::size_t i = 0; i < result.size(); ++i) {
      result[i] *= exposure[i];
    }
  }
  for (std::size_t i = 0; i < opening.size(); ++i) {
    result[i] = opening[i] != 0 ? 0 : result[i];
  }
  return result;
}

double late_points_of(const GrowthOptions& options) noexcept {
  return options.late_points.value_or(static_cast<double>(options.starting_points));
}

Status settle(GrowthOptions& options, std::vector<std::string>& notes) {
  constexpr float kLargest = 1e6F;
  const Status numbers = first_of({known("mode", options.mode, Mode::kPhysical, "thesis, physical"),
                                   known("corrosivity", options.corrosivity, Corrosivity::kVeryHigh,
                                         "very low, low, medium, high, very high"),
                                   known("law", options.law, Law::kIso9224, "thesis, iso9224"),
                                   known("border", options.border, Border::kClamped, "toroidal, clamped"),
                                   within("side", static_cast<double>(options.side), 8, 16384, " cells"),
                                   within("extent_mm", options.extent_mm, 0.1, 10000, " mm"),
                                   within("thickness_mm", options.thickness_mm, 0.001, 1000, " mm"),
                                   within("least_susceptibility", options.least_susceptibility, 0, 1),
                                   within("late_points", late_points_of(options), 0, 1e5, " per 1000 g/m^2"),
                                   within("reserve", options.reserve, 0, 1),
                                   check_event_options(options.events), check_front_options(options.front)});
  if (!numbers) {
    return numbers;
  }
  const Status maps =
      first_of({check(options.surface, "surface", 0, 1), check(options.material, "material", 0, 1),
                check(options.exposure, "exposure", 0, kLargest), check(options.opening, "opening", 0, 1)});
  if (!maps) {
    return maps;
  }
  if (options.starting_points < 1 || options.starting_points > options.side * options.side) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("starting_points: {} on a grid of {} x {} cells", options.starting_points,
                            options.side, options.side),
                fmt::format("give 1 to {}", options.side * options.side));
  }
  if (!std::isfinite(options.age_years)) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("age: is {} years", options.age_years),
                fmt::format("give 0 to {} years", kLongestAgeYears));
  }
  const double age = std::clamp(options.age_years, 0.0, kLongestAgeYears);
  if (age != options.age_years) {
    notes.push_back(fmt::format("age {} is taken as {} years", options.age_years, age));
    options.age_years = age;
  }
  return {};
}

}  // namespace scatter::corrosion
