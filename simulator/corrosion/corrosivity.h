// How much metal an atmosphere takes in a time.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::corrosion {

/// Class of an atmosphere, C1 to C5 of ISO 9223.
enum class Corrosivity : std::uint8_t { kVeryLow, kLow, kMedium, kHigh, kVeryHigh };

inline constexpr std::array<Corrosivity, 5> kCorrosivities{Corrosivity::kVeryLow, Corrosivity::kLow,
                                                           Corrosivity::kMedium, Corrosivity::kHigh,
                                                           Corrosivity::kVeryHigh};

/// Loss of metal over time.
enum class Law : std::uint8_t {
  /// w = k t^n with the thesis's k and n for each class (its table 2).
  kThesis,
  /// ISO 9224:2012 for carbon steel, class B1, at the class's upper limit in the first year:
  /// r t^0.523 to 20 years, then straight on with the slope reached.
  kIso9224,
};

inline constexpr double kLongestAgeYears = 100;
/// Mass of steel that 1 um of depth takes off 1 m^2 [g/m^2]: 7.8 g/cm^3, as the thesis has it.
inline constexpr double kSteelGramsPerSquareMetrePerUm = 7.8;

/// "very low", "low", "medium", "high", "very high".
[[nodiscard]] std::string_view name(Corrosivity corrosivity) noexcept;
/// "thesis", "iso9224".
[[nodiscard]] std::string_view name(Law law) noexcept;
/// By name; '_' or '-' may stand for the space, upper case for lower. Errors: kInvalidArgument lists the
/// names.
[[nodiscard]] Result<Corrosivity> corrosivity_named(std::string_view name);
[[nodiscard]] Result<Law> law_named(std::string_view name);

/// Mean loss of metal [g/m^2] after `years` (clamped to 0..100).
[[nodiscard]] double mass_loss_g_per_m2(Corrosivity corrosivity, Law law, double years) noexcept;
/// Age at which the mean loss is reached [years]; kLongestAgeYears when it takes longer than that.
[[nodiscard]] double age_of_loss_years(Corrosivity corrosivity, Law law, double loss_g_per_m2) noexcept;

}  // namespace scatter::corrosion
