// Share of light that a smooth interface reflects, unpolarised.
#pragma once

#include <cmath>

namespace scatter::reflectance::formulas {

/// (1 - cos)^5, the weight of Schlick's white at grazing incidence.
[[nodiscard]] inline double schlick_weight(double cos_d) noexcept {
  const double m = cos_d < 1 ? 1 - cos_d : 0;
  const double m2 = m * m;
  return m2 * m2 * m;
}

/// f0 + (1 - f0)(1 - cos_d)^5 [1].
/// Range   f0 0..1: reflectance at normal incidence.
/// Source  Schlick 1994, eq. 15.
template <typename T>
[[nodiscard]] T schlick_fresnel(const T& f0, double cos_d) {
  return f0 + (1.0 - f0) * schlick_weight(cos_d);
}

/// Exact reflectance of a dielectric [1]; 1 under total internal reflection.
/// Range   eta = n behind / n before the interface, > 0; cos_d 0..1 on the side of the light.
/// Source  Fresnel; the form of Walter 2007, eq. 22, is the same for eta > 1.
template <typename T>
[[nodiscard]] T dielectric_fresnel(const T& eta, double cos_d) {
  using std::sqrt;
  const T g2 = eta * eta - (1.0 - cos_d * cos_d);
  if (!(g2 > 0.0)) {
    return T(1.0);
  }
  const T g = sqrt(g2);
  const T eta2 = eta * eta;
  const T s = (cos_d - g) / (cos_d + g);
  const T p = (eta2 * cos_d - g) / (eta2 * cos_d + g);
  return (s * s + p * p) * 0.5;
}

/// Exact reflectance of a conductor seen from a dielectric of index 1 [1].
/// Range   complex index n + ik with n, k >= 0, not n = k = 0; cos_d 0..1. k = 0 gives the dielectric.
/// Source  Born and Wolf, Principles of Optics, 14.4 (there n(1 + i kappa)).
template <typename T>
[[nodiscard]] T conductor_fresnel(const T& n, const T& k, double cos_d) {
  using std::sqrt;
  const double c2 = cos_d * cos_d;
  const double s2 = 1.0 - c2;
  // (a + ib)^2 = (n + ik)^2 - sin^2: the normal component of the refracted wave vector.
  const T real = n * n - k * k - s2;
  const T imaginary = 2.0 * n * k;
  const T modulus = sqrt(real * real + imaginary * imaginary);
  T a2 = (modulus + real) * 0.5;
  if (!(a2 > 0.0)) {
    a2 = T(0.0);
  }
  // Jets have no derivative of sqrt at 0; there a contributes nothing.
  const T a = a2 > 0.0 ? T(sqrt(a2)) : T(0.0);
  const T s = (modulus + c2 - 2.0 * cos_d * a) / (modulus + c2 + 2.0 * cos_d * a);
  if (!(cos_d > 0)) {
    return T(1.0);
  }
  const double st2 = s2 * s2 / c2;
  const double cross = 2.0 * s2 / cos_d;
  const T p = s * (modulus + st2 - cross * a) / (modulus + st2 + cross * a);
  return (s + p) * 0.5;
}

}  // namespace scatter::reflectance::formulas
