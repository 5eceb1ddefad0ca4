// What patina is made of, and what it does to light.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/appearance.h"

namespace scatter::corrosion {

/// Numbers are part of written files.
enum class PatinaMaterial : std::uint8_t {
  kTarnish = 0,   ///< Cuprite, Cu2O: brown, nearly black where thick.
  kSulphate = 1,  ///< Brochantite, Cu4SO4(OH)6: green, in towns.
  kChloride = 2,  ///< Atacamite, Cu2Cl(OH)3: green, near the sea.
};

inline constexpr std::array<PatinaMaterial, 3> kPatinaMaterials{
    PatinaMaterial::kTarnish, PatinaMaterial::kSulphate, PatinaMaterial::kChloride};

/// Properties of a material at 630, 525 and 465 nm.
///
/// Source    absorption and scattering are ESTIMATES: no measured coefficients could be had. They are chosen
/// so
///           that (1) the layer's own colour (K/S) is `thick_colour`, picked from published descriptions and
///           photographs of brown and green copper roofs, and (2) the layer hides what is below at the
///           thickness that Leygraf, Chang, Herting, Odnevall Wallinder 2019 measured ("The origin and
///           evolution of copper patina colour", Corrosion Science 157, 337): cuprite's brown is complete at
///           0.8 um (+- 0.2), the green covers it at 12 um (+- 2). Interference colours of films thinner than
///           about 0.2 um are left out. Volumes follow from molar masses and densities of the minerals
///           (cuprite 6.0, brochantite 3.97, atacamite 3.76, copper 8.96 g/cm^3).
struct PatinaMaterialData {
  std::string_view name;
  std::string_view mineral;
  std::array<double, 3> absorption_per_um;
  std::array<double, 3> scattering_per_um;
  double hiding_um;          ///< Thickness at which it hides what lies below.
  double volume_per_copper;  ///< um of layer made from 1 um of copper, without pores.
  double roughness;          ///< GGX alpha of its surface: an estimate.
  double porosity;           ///< Share of pores: an estimate.
};

[[nodiscard]] const PatinaMaterialData& data_of(PatinaMaterial material) noexcept;

/// "tarnish", "sulphate" ("sulfate"), "chloride". Errors: kInvalidArgument lists the names.
[[nodiscard]] Result<PatinaMaterial> patina_material_named(std::string_view name);

/// Reflectance of polished copper at normal incidence: n, k of Johnson and Christy 1972 (the table in
/// host_sdk/reflectance/models/data/copper.inc), interpolated in wavelength.
inline constexpr Rgb kCopperReflectance{0.915F, 0.595F, 0.550F};

}  // namespace scatter::corrosion
