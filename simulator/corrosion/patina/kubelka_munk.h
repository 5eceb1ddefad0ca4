// Diffuse light in stacked layers: what comes back and what goes through.
#pragma once

namespace scatter::corrosion {

/// What a layer does to diffuse light that falls on it.
/// Quantity  shares of the flux [1]; the same from both sides, since layers are homogeneous.
struct LayerOptics {
  double reflectance = 0;
  double transmittance = 1;
};

/// Optics of a homogeneous layer without surfaces of its own.
///
/// Range     scattering, absorption >= 0 [1/um]; thickness >= 0 [um], infinity allowed where one of the two
/// is
///           above 0. reflectance + transmittance <= 1, equal to 1 where nothing is absorbed.
/// Cost      one square root, two exponentials; any thread.
/// Source    Kubelka 1948, "New contributions to the optics of intensely light-scattering materials I", the
///           solution in hyperbolic functions, here in exp(-b S d), which does not overflow and needs no
///           special case for S = 0.
[[nodiscard]] LayerOptics layer_optics(double absorption_per_um, double scattering_per_um,
                                       double thickness_um) noexcept;

/// Two layers as one, seen from above.
///
/// Quantity  R = R1 + T1^2 R2 / (1 - R1 R2), T = T1 T2 / (1 - R1 R2).
/// Range     R1 R2 = 1 (two perfect mirrors) gives the mirror.
/// Source    Kubelka 1954, part II.
[[nodiscard]] LayerOptics over(const LayerOptics& upper, const LayerOptics& lower) noexcept;

/// Reflectance of a layer too thick to be seen through: 1 + K/S - sqrt((K/S)^2 + 2 K/S).
/// Range     0 where nothing scatters.
[[nodiscard]] double infinite_reflectance(double absorption_per_um, double scattering_per_um) noexcept;

}  // namespace scatter::corrosion
