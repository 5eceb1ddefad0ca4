// How fast copper turns to tarnish and patina in an atmosphere.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/patina/material.h"

namespace scatter::corrosion {

/// Numbers are part of written files.
enum class Atmosphere : std::uint8_t { kMarine = 0, kUrban = 1, kRural = 2 };

inline constexpr std::array<Atmosphere, 3> kAtmospheres{Atmosphere::kMarine, Atmosphere::kUrban,
                                                        Atmosphere::kRural};

/// "marine", "urban", "rural".
[[nodiscard]] std::string_view name(Atmosphere atmosphere) noexcept;
/// Errors: kInvalidArgument lists the names.
[[nodiscard]] Result<Atmosphere> atmosphere_named(std::string_view name);

inline constexpr double kOldestPatinaYears = 100;

/// An atmosphere's numbers.
///
/// Source    first_year_um: estimates inside ISO 9223:2012's ranges for copper (C2 0.1..0.6, C3 0.6..1.3,
///           C4 1.3..2.8 um in the first year): rural in C2, marine in C3, urban (a town that burns coal) in
///           C4. exponent: ISO 9224:2012, copper, class B1; straight on after 20 years, as that standard has
///           it. runoff: urban 1.35 and rural 0.8 g/m^2 a year are the middles of what Odnevall Wallinder and
///           Leygraf 2001 measured ("Seasonal variations in corrosion rate and runoff rate of copper roofs",
///           Corrosion Science 43, 2379: 1.1..1.7 and 0.6..1.0, independent of time); marine is said to be
///           lower than urban (Odnevall Wallinder et al. 2014), 1.0 is an estimate. cuprite_um is an estimate
///           from sections of old roofs, whose cuprite is a few um thick under any amount of green.
struct AtmosphereData {
  double first_year_um;       ///< Copper lost in the first year.
  double exponent;            ///< Loss grows as years^exponent up to 20 years.
  double runoff_um_per_year;  ///< Copper that rain takes away from a horizontal surface.
  double cuprite_um;          ///< Thickness that the cuprite tends to.
  PatinaMaterial patina;      ///< What forms on the cuprite.
};

[[nodiscard]] const AtmosphereData& data_of(Atmosphere atmosphere) noexcept;

/// Copper lost [um of metal] by a horizontal, open, wet surface after `years` (>= 0).
[[nodiscard]] double copper_loss_um(Atmosphere atmosphere, double years) noexcept;

/// Layers on copper, in um.
struct Layers {
  double tarnish_um = 0;
  double patina_um = 0;
};

/// Where the metal goes: cuprite first, then, beyond what rain has carried off, patina.
///
/// Quantity  cuprite = loss / (1 + (loss / c_s)^4)^(1/4) of the lost copper, c_s what the full film holds:
/// all of it
///           at first, c_s at last. Patina is what is left after that and the rain. Both by their volume per
///           copper.
/// Range     loss_um, rain_um >= 0 [um of copper].
/// Source    our own balance of the copper (docs/patina.md); a model, not a fit.
struct LossBalance {
  float full_film_um;  ///< Copper in the full film of cuprite.
  float tarnish_volume;
  float patina_volume;

  [[nodiscard]] float film_copper_um(float loss_um) const noexcept {
    const float fullness = loss_um / full_film_um;
    const float squared = fullness * fullness;
    return loss_um / std::sqrt(std::sqrt(1 + squared * squared));
  }
  [[nodiscard]] float tarnish_um(float loss_um) const noexcept {
    return film_copper_um(loss_um) * tarnish_volume;
  }
  [[nodiscard]] float patina_um(float loss_um, float rain_um) const noexcept {
    return std::max(0.0F, loss_um - film_copper_um(loss_um) - rain_um) * patina_volume;
  }
};

[[nodiscard]] LossBalance balance_of(Atmosphere atmosphere) noexcept;

}  // namespace scatter::corrosion
