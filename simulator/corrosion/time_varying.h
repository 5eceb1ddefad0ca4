// What a corroded sheet looks like at every age, as a product of space and time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/growth.h"
#include "simulator/corrosion/map.h"

namespace scatter::corrosion {

/// A quantity that changes as metal corrodes; units and ranges are those of Appearance.
enum class LookParameter : std::uint8_t {
  kRed = 0,
  kGreen = 1,
  kBlue = 2,
  kRoughness = 3,
  kPorosity = 4,
  kMetalness = 5,
  kOpacity = 6,
  kHeight = 7,  ///< Share of the thickness left, as in Sheet.
};
inline constexpr std::size_t kLookParameters = 8;

/// "red", "green", "blue", "roughness", "porosity", "metalness", "opacity", "height".
[[nodiscard]] std::string_view name(LookParameter parameter) noexcept;

/// A quantity over local time: straight between knots, constant beyond the first and the last. Where two
/// knots share a time the curve steps there, and the later one holds at that time.
struct TemporalCurve {
  struct Knot {
    double time = 0;
    float value = 0;
  };
  std::vector<Knot> knots;  ///< At least one, times rising.

  [[nodiscard]] float at(double time) const noexcept;
};

/// p(x, y, t) = A(x, y) phi(t') + D(x, y), t' = R(x, y) t - O(x, y), for each parameter of the appearance.
///
/// R and O belong to the place and are the same for all parameters. t is the growth's own clock [mm], which
/// `clock` relates to age; t' is the depth [um] lost besides the skin, negative before rust comes, so phi is
/// colour (and so on) as a function of depth. Error     where the front has gone further than the skin's
/// width (0.1 mm) since it arrived: nothing but rounding
///           (1e-3 um of depth) and the straight lines between knots of roughness and porosity (1e-3). In the
///           rim before that the skin is taken as complete: depth is too large by up to
///           GrowthOptions::front.skin_um. Colours of layers that are not the same everywhere:
///           `albedo_error`, since one curve cannot follow several.
/// Threads   const functions may be called from any number of threads.
/// Source    Gu, Tu, Ramamoorthi, Belhumeur, Matusik, Nayar 2006, "Time-varying surface appearance:
/// acquisition,
///           modeling and rendering", eq. 5 (space-time appearance factorization).
struct TimeVarying {
  struct Factor {
    TemporalCurve phi;
    Map amplitude{1, 1, {1.0F}};  ///< A: one value, or one per cell.
    Map constant{1, 1, {0.0F}};   ///< D: the same.
  };
  /// Clock at an age, straight between.
  struct Tick {
    double age_years = 0;
    double clock_mm = 0;
  };

  std::size_t side = 0;
  double extent_mm = 0;
  std::vector<float> rate{};  ///< R [um / mm], above 0, per cell, row major.
  std::vector<float>
      offset{};  ///< O [um]; infinite where rust never comes, minus infinity where it always was.
  std::array<Factor, kLookParameters> factors{};
  std::vector<Tick> clock{};  ///< Rising in age; the clock never falls. -1 at age 0: before everything.
  float albedo_error = 0;  ///< Root mean square over cells, colours and layers of what A phi + D leaves out.

  /// Errors  kInvalidArgument: the growth is not of Mode::kPhysical; options are refused.
  /// Cost    two passes over the cells.
  [[nodiscard]] static Result<TimeVarying> make(const Growth& growth, const AppearanceOptions& options = {});

  /// The clock at an age, clamped to the history's.
  /// Error   1e-3 of the way that the clock goes in a year, from 1 % of the oldest age on.
  [[nodiscard]] double clock_mm(double age_years) const noexcept;
  /// t' of a cell when the clock stands at `clock_mm`.
  [[nodiscard]] double local_time(std::size_t cell, double clock_mm) const noexcept {
    return static_cast<double>(rate[cell]) * clock_mm - static_cast<double>(offset[cell]);
  }
  [[nodiscard]] float value(LookParameter parameter, std::size_t cell, double clock_mm) const noexcept;
  /// All cells. Shape     side x side.
  [[nodiscard]] std::vector<float> map(LookParameter parameter, double clock_mm) const;
};

}  // namespace scatter::corrosion
