// Angles of vectors, many at once. Included once per SIMD target, inside foreach_target.
#if defined(SCATTER_REFLECTANCE_ANGLE_SIMD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SCATTER_REFLECTANCE_ANGLE_SIMD_INL_H_
#undef SCATTER_REFLECTANCE_ANGLE_SIMD_INL_H_
#else
#define SCATTER_REFLECTANCE_ANGLE_SIMD_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scatter::reflectance::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE hn::Vec<D> set_to(D d, double value) {
  return hn::Set(d, static_cast<hn::TFromD<D>>(value));
}

/// atan(t) / t for s = t^2 of at most tan^2(pi/8), interpolated at the Chebyshev nodes. The error of
/// t P(s) is 2.8e-13 in double (degree 7) and 6.8e-9 in float (degree 4, below the rounding).
template <class D, class V = hn::Vec<D>>
HWY_INLINE V atan_over_argument(D d, V s) {
  const auto c = [d](double value) HWY_ATTR { return set_to(d, value); };
  const V s2 = hn::Mul(s, s);
  if constexpr (sizeof(hn::TFromD<D>) == sizeof(float)) {
    const V p01 = hn::MulAdd(c(-0.33332785771924844376), s, c(0.99999998126461109305));
    const V p23 = hn::MulAdd(c(-0.13848490212269207178), s, c(0.19974082415507665722));
    return hn::MulAdd(hn::MulAdd(c(0.079762918067945581813), s2, p23), s2, p01);
  } else {
    const V p01 = hn::MulAdd(c(-0.3333333327692249437), s, c(0.99999999999924471528));
    const V p23 = hn::MulAdd(c(-0.14285386553752138505), s, c(0.19999993053555814582));
    const V p45 = hn::MulAdd(c(-0.089925529061509121287), s, c(0.11103456908947463566));
    const V p67 = hn::MulAdd(c(-0.037655106012914017766), s, c(0.069741976865952653997));
    return hn::MulAdd(hn::MulAdd(p67, s2, p45), hn::Mul(s2, s2), hn::MulAdd(p23, s2, p01));
  }
}

/// Angle of the point (x, y) with y >= 0 from the x axis [rad], 0..pi; 0 for (0, 0).
/// Error    below 1e-12 rad in double, 5e-7 rad in float.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V upper_angle(D d, V y, V x) {
  constexpr double kTiny = sizeof(hn::TFromD<D>) == sizeof(float) ? 1e-30 : 1e-200;
  const V ax = hn::Abs(x);
  const V small = hn::Min(ax, y);
  const V large = hn::Max(ax, y);
  // atan(s/l) = pi/4 + atan((s - l)/(s + l)) keeps the argument within +-tan(pi/8).
  const auto steep = hn::Gt(small, hn::Mul(large, set_to(d, 0.41421356237309503)));
  const V numerator = hn::IfThenElse(steep, hn::Sub(small, large), small);
  const V denominator = hn::Max(hn::IfThenElse(steep, hn::Add(small, large), large), set_to(d, kTiny));
  const V t = hn::Div(numerator, denominator);
  const V offset = hn::IfThenElseZero(steep, set_to(d, 0.78539816339744831));
  V angle = hn::MulAdd(t, atan_over_argument(d, hn::Mul(t, t)), offset);
  angle = hn::IfThenElse(hn::Gt(y, ax), hn::Sub(set_to(d, 1.5707963267948966), angle), angle);
  return hn::IfThenElse(hn::Lt(x, hn::Zero(d)), hn::Sub(set_to(d, 3.1415926535897932), angle), angle);
}

/// Angle of the point (x, y) counter-clockwise from the x axis [rad], 0..2 pi; error as above.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V full_angle(D d, V y, V x) {
  const V angle = upper_angle(d, hn::Abs(y), x);
  return hn::IfThenElse(hn::Lt(y, hn::Zero(d)), hn::Sub(set_to(d, 6.2831853071795865), angle), angle);
}

}  // namespace scatter::reflectance::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
