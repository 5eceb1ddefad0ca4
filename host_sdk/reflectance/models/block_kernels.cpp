#include "host_sdk/reflectance/models/block_kernels.h"

#include <cmath>
#include <cstddef>

#include "host_sdk/reflectance/models/formulas/disney.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"

// Two x86 targets that differ from their neighbours in nothing that is used here.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "host_sdk/reflectance/models/block_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace scatter::reflectance::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Doubles = hn::ScalableTag<double>;
using Lanes = hn::Vec<Doubles>;

HWY_INLINE Lanes splat(double value) {
  return hn::Set(Doubles{}, value);
}
HWY_INLINE Lanes lanes(const BlockArray& from, std::size_t k) {
  return hn::Load(Doubles{}, from.data() + k);
}
HWY_INLINE void keep(Lanes value, BlockArray& to, std::size_t k) {
  hn::Store(value, Doubles{}, to.data() + k);
}
HWY_INLINE Lanes square(Lanes x) {
  return hn::Mul(x, x);
}
/// a b + c, rounded twice: fused where the processor can, results would differ between processors,
/// and the simulator promises the same frames on all of them.
HWY_INLINE Lanes multiply_add(Lanes a, Lanes b, Lanes c) {
  return hn::Add(hn::Mul(a, b), c);
}
HWY_INLINE Lanes multiply_subtract(Lanes a, Lanes b, Lanes c) {
  return hn::Sub(hn::Mul(a, b), c);
}

void complete(GeometryBlock& block) {
  const Lanes i_x = splat(block.i.x);
  const Lanes i_y = splat(block.i.y);
  const Lanes i_z = splat(block.i.z);
  const Lanes one = splat(1);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes o_x = lanes(block.o_x, k);
    const Lanes o_y = lanes(block.o_y, k);
    const Lanes o_z = lanes(block.o_z, k);
    const Lanes x = hn::Add(i_x, o_x);
    const Lanes y = hn::Add(i_y, o_y);
    const Lanes z = hn::Add(i_z, o_z);
    const Lanes scale = hn::Div(one, hn::Sqrt(multiply_add(x, x, multiply_add(y, y, square(z)))));
    const Lanes h_x = hn::Mul(x, scale);
    const Lanes h_y = hn::Mul(y, scale);
    const Lanes h_z = hn::Mul(z, scale);
    const Lanes tangent = multiply_add(i_x, o_x, hn::Mul(i_y, o_y));
    keep(h_x, block.h_x, k);
    keep(h_y, block.h_y, k);
    keep(h_z, block.h_z, k);
    keep(hn::Min(one, multiply_add(i_x, h_x, multiply_add(i_y, h_y, hn::Mul(i_z, h_z)))), block.cos_d, k);
    keep(tangent, block.tangent_dot, k);
    keep(multiply_subtract(i_z, o_z, tangent), block.cos_mirror, k);
  }
}

/// cos + sqrt(cos^2 + (alpha_x w_x)^2 + (alpha_y w_y)^2): 2 over masking / cos.
HWY_INLINE Lanes masking_sum(double alpha_x, double alpha_y, const GeometryBlock& block, std::size_t k) {
  const Lanes z = lanes(block.o_z, k);
  const Lanes x = hn::Mul(splat(alpha_x), lanes(block.o_x, k));
  const Lanes y = hn::Mul(splat(alpha_y), lanes(block.o_y, k));
  return hn::Add(z, hn::Sqrt(multiply_add(z, z, multiply_add(x, x, square(y)))));
}
double masking_sum(double alpha_x, double alpha_y, const Direction& w) {
  const double x = alpha_x * w.x;
  const double y = alpha_y * w.y;
  return w.z + std::sqrt(w.z * w.z + x * x + y * y);
}

void ggx_lobe(const GgxAlphas& a, const GeometryBlock& block, BlockArray& out) {
  // D masking_i masking_o / 4 is one constant over (slopes)^2 and the sum of o.
  const Lanes constant = splat(1 / (kPi * a.x * a.y * masking_sum(a.masking_x, a.masking_y, block.i)));
  const Lanes inverse_x = splat(1 / a.x);
  const Lanes inverse_y = splat(1 / a.y);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes x = hn::Mul(lanes(block.h_x, k), inverse_x);
    const Lanes y = hn::Mul(lanes(block.h_y, k), inverse_y);
    const Lanes d = multiply_add(x, x, multiply_add(y, y, square(lanes(block.h_z, k))));
    const Lanes sum = masking_sum(a.masking_x, a.masking_y, block, k);
    keep(hn::Div(constant, hn::Mul(square(d), sum)), out, k);
  }
}

/// (1 - cos)^5.
HWY_INLINE Lanes schlick_weight(Lanes cosine) {
  const Lanes m = hn::Sub(splat(1), cosine);
  return hn::Mul(square(square(m)), m);
}

void disney_clearcoat_lobe(double gloss, const GeometryBlock& block, BlockArray& out) {
  const double alpha = formulas::disney_clearcoat_alpha(gloss);
  const double a2 = alpha * alpha;
  // 1/4 for the change from h to omega_o, 1/4 for the strength, twice 2 for the maskings.
  const Lanes constant = splat((1 - a2) / (-kPi * std::log(a2)) * 0.25 / masking_sum(0.25, 0.25, block.i));
  const Lanes alpha2 = splat(a2);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes h_x = lanes(block.h_x, k);
    const Lanes h_y = lanes(block.h_y, k);
    const Lanes d = multiply_add(alpha2, square(lanes(block.h_z, k)), multiply_add(h_x, h_x, square(h_y)));
    const Lanes fresnel = multiply_add(splat(0.96), schlick_weight(lanes(block.cos_d, k)), splat(0.04));
    keep(hn::Div(hn::Mul(constant, fresnel), hn::Mul(d, masking_sum(0.25, 0.25, block, k))), out, k);
  }
}

void disney_base(double roughness, double subsurface, const GeometryBlock& block, BlockArray& out) {
  const Lanes one = splat(1);
  const Lanes weight_i = splat(formulas::schlick_weight(block.i.z));
  const Lanes i_z = splat(block.i.z);
  const Lanes half = splat(0.5);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes o_z = lanes(block.o_z, k);
    const Lanes weight_o = schlick_weight(o_z);
    const Lanes grazing = hn::Mul(splat(roughness), square(lanes(block.cos_d, k)));
    const Lanes rise = hn::Sub(hn::Add(grazing, grazing), half);
    const Lanes diffuse = hn::Mul(multiply_add(rise, weight_i, one), multiply_add(rise, weight_o, one));
    const Lanes fall = hn::Sub(grazing, one);
    const Lanes under = hn::Mul(multiply_add(fall, weight_i, one), multiply_add(fall, weight_o, one));
    const Lanes flat = hn::Sub(hn::Div(one, hn::Add(i_z, o_z)), half);
    const Lanes below = hn::Mul(splat(1.25), multiply_add(under, flat, half));
    keep(multiply_add(splat(subsurface), hn::Sub(below, diffuse), diffuse), out, k);
  }
}

HWY_INLINE Lanes tan2_h(const GeometryBlock& block, std::size_t k) {
  const Lanes sin2 = multiply_add(lanes(block.h_x, k), lanes(block.h_x, k), square(lanes(block.h_y, k)));
  return hn::Div(sin2, square(lanes(block.h_z, k)));
}

HWY_INLINE Lanes beckmann(Lanes minus_inverse_a2, Lanes factor, const GeometryBlock& block, std::size_t k) {
  const Lanes cos4 = square(square(lanes(block.h_z, k)));
  return hn::Div(hn::Mul(factor, hn::Exp(Doubles{}, hn::Mul(tan2_h(block, k), minus_inverse_a2))), cos4);
}

void beckmann_distribution(double alpha, const GeometryBlock& block, BlockArray& out) {
  const Lanes minus_inverse_a2 = splat(-1 / (alpha * alpha));
  const Lanes factor = splat(1 / (kPi * alpha * alpha));
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    keep(beckmann(minus_inverse_a2, factor, block, k), out, k);
  }
}

void cook_torrance_lobe(double m, const GeometryBlock& block, BlockArray& out) {
  const Lanes minus_inverse_m2 = splat(-1 / (m * m));
  const Lanes factor = splat(1 / (kPi * m * m));
  const Lanes i_z = splat(block.i.z);
  const Lanes two = splat(2);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes o_z = lanes(block.o_z, k);
    const Lanes s = hn::Div(hn::Mul(two, lanes(block.h_z, k)), lanes(block.cos_d, k));
    const Lanes groove = hn::Min(splat(1), hn::Mul(s, hn::Min(i_z, o_z)));
    keep(hn::Div(hn::Mul(beckmann(minus_inverse_m2, factor, block, k), groove), hn::Mul(i_z, o_z)), out, k);
  }
}

void ward_lobe(formulas::WardKind kind, double alpha_x, double alpha_y, const GeometryBlock& block,
               BlockArray& out) {
  const Lanes factor = splat(1 / (4 * kPi * alpha_x * alpha_y));
  const Lanes inverse_x = splat(1 / alpha_x);
  const Lanes inverse_y = splat(1 / alpha_y);
  const Lanes i_z = splat(block.i.z);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes h_z = lanes(block.h_z, k);
    const Lanes inverse_z = hn::Div(splat(1), h_z);
    const Lanes x = hn::Mul(hn::Mul(lanes(block.h_x, k), inverse_z), inverse_x);
    const Lanes y = hn::Mul(hn::Mul(lanes(block.h_y, k), inverse_z), inverse_y);
    Lanes divisor = hn::Mul(i_z, lanes(block.o_z, k));
    if (kind == formulas::WardKind::kWard) {
      divisor = hn::Sqrt(divisor);
    } else if (kind == formulas::WardKind::kBounded) {
      divisor = square(hn::Mul(lanes(block.cos_d, k), square(h_z)));
    }
    const Lanes exponential = hn::Exp(Doubles{}, hn::Neg(multiply_add(x, x, square(y))));
    keep(hn::Div(hn::Mul(factor, exponential), divisor), out, k);
  }
}

void mirror_power(double n, const GeometryBlock& block, BlockArray& out) {
  const Lanes exponent = splat(n);
  const Lanes tiny = splat(1e-300);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes cos_mirror = lanes(block.cos_mirror, k);
    // The logarithm must not see 0 or less; those lanes are cleared.
    const Lanes power = hn::Exp(Doubles{}, hn::Mul(exponent, hn::Log(Doubles{}, hn::Max(cos_mirror, tiny))));
    keep(hn::IfThenElseZero(hn::Gt(cos_mirror, hn::Zero(Doubles{})), power), out, k);
  }
}

void oren_nayar(double sigma, const GeometryBlock& block, BlockArray& out) {
  const double s2 = sigma * sigma;
  const Lanes a = splat((1 - 0.5 * s2 / (s2 + 0.33)) / kPi);
  const Lanes b = splat(0.45 * s2 / (s2 + 0.09) / kPi);
  const Lanes i_z = splat(block.i.z);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes towards = hn::Max(lanes(block.tangent_dot, k), hn::Zero(Doubles{}));
    keep(multiply_add(b, hn::Div(towards, hn::Max(i_z, lanes(block.o_z, k))), a), out, k);
  }
}

void schlick_fresnel(double f0, const GeometryBlock& block, BlockArray& out) {
  const Lanes low = splat(f0);
  const Lanes rise = splat(1 - f0);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    keep(multiply_add(rise, schlick_weight(lanes(block.cos_d, k)), low), out, k);
  }
}

void dielectric_fresnel(double eta, const GeometryBlock& block, BlockArray& out) {
  const Lanes eta2 = splat(eta * eta);
  const Lanes one = splat(1);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes c = lanes(block.cos_d, k);
    const Lanes g2 = hn::Sub(eta2, hn::Sub(one, square(c)));
    const Lanes g = hn::Sqrt(hn::Max(g2, hn::Zero(Doubles{})));
    const Lanes s = hn::Div(hn::Sub(c, g), hn::Add(c, g));
    const Lanes p = hn::Div(multiply_subtract(eta2, c, g), multiply_add(eta2, c, g));
    const Lanes mean = hn::Mul(splat(0.5), multiply_add(s, s, square(p)));
    keep(hn::IfThenElse(hn::Gt(g2, hn::Zero(Doubles{})), mean, one), out, k);
  }
}

void conductor_fresnel(double n, double k_index, const GeometryBlock& block, BlockArray& out) {
  const Lanes zero = hn::Zero(Doubles{});
  const Lanes one = splat(1);
  const Lanes imaginary2 = splat(4 * n * n * k_index * k_index);
  const Lanes difference = splat(n * n - k_index * k_index);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    const Lanes c = lanes(block.cos_d, k);
    const Lanes c2 = square(c);
    const Lanes s2 = hn::Sub(one, c2);
    const Lanes real = hn::Sub(difference, s2);
    const Lanes modulus = hn::Sqrt(multiply_add(real, real, imaginary2));
    const Lanes a = hn::Sqrt(hn::Max(zero, hn::Mul(splat(0.5), hn::Add(modulus, real))));
    const Lanes along = hn::Mul(hn::Add(c, c), a);
    const Lanes both = hn::Add(modulus, c2);
    const Lanes s = hn::Div(hn::Sub(both, along), hn::Add(both, along));
    const Lanes tangent = hn::Div(s2, c);
    const Lanes cross = hn::Mul(hn::Add(tangent, tangent), a);
    const Lanes outer = multiply_add(tangent, tangent, modulus);
    const Lanes p = hn::Mul(s, hn::Div(hn::Sub(outer, cross), hn::Add(outer, cross)));
    keep(hn::IfThenElse(hn::Gt(c, zero), hn::Mul(splat(0.5), hn::Add(s, p)), one), out, k);
  }
}

void add(double factor, const BlockArray& a, BlockArray& sum) {
  const Lanes by = splat(factor);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    keep(multiply_add(by, lanes(a, k), lanes(sum, k)), sum, k);
  }
}

void add_product(double factor, const BlockArray& a, const BlockArray& b, BlockArray& sum) {
  const Lanes by = splat(factor);
  for (std::size_t k = 0; k < kBlockSize; k += hn::Lanes(Doubles{})) {
    keep(multiply_add(hn::Mul(by, lanes(a, k)), lanes(b, k), lanes(sum, k)), sum, k);
  }
}

}  // namespace scatter::reflectance::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scatter::reflectance::kernels {

HWY_EXPORT(complete);
HWY_EXPORT(ggx_lobe);
HWY_EXPORT(disney_clearcoat_lobe);
HWY_EXPORT(disney_base);
HWY_EXPORT(beckmann_distribution);
HWY_EXPORT(cook_torrance_lobe);
HWY_EXPORT(ward_lobe);
HWY_EXPORT(mirror_power);
HWY_EXPORT(oren_nayar);
HWY_EXPORT(schlick_fresnel);
HWY_EXPORT(dielectric_fresnel);
HWY_EXPORT(conductor_fresnel);
HWY_EXPORT(add);
HWY_EXPORT(add_product);

void complete(GeometryBlock& block) noexcept {
  HWY_DYNAMIC_DISPATCH(complete)(block);
}
void ggx_lobe(const GgxAlphas& alphas, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(ggx_lobe)(alphas, block, out);
}
void disney_clearcoat_lobe(double gloss, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(disney_clearcoat_lobe)(gloss, block, out);
}
void disney_base(double roughness, double subsurface, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(disney_base)(roughness, subsurface, block, out);
}
void beckmann_distribution(double alpha, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(beckmann_distribution)(alpha, block, out);
}
void cook_torrance_lobe(double m, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(cook_torrance_lobe)(m, block, out);
}
void ward_lobe(formulas::WardKind kind, double alpha_x, double alpha_y, const GeometryBlock& block,
               BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(ward_lobe)(kind, alpha_x, alpha_y, block, out);
}
void mirror_power(double n, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(mirror_power)(n, block, out);
}
void oren_nayar(double sigma, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(oren_nayar)(sigma, block, out);
}
void schlick_fresnel(double f0, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(schlick_fresnel)(f0, block, out);
}
void dielectric_fresnel(double eta, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(dielectric_fresnel)(eta, block, out);
}
void conductor_fresnel(double n, double k, const GeometryBlock& block, BlockArray& out) noexcept {
  HWY_DYNAMIC_DISPATCH(conductor_fresnel)(n, k, block, out);
}
void add(double factor, const BlockArray& a, BlockArray& sum) noexcept {
  HWY_DYNAMIC_DISPATCH(add)(factor, a, sum);
}
void add_product(double factor, const BlockArray& a, const BlockArray& b, BlockArray& sum) noexcept {
  HWY_DYNAMIC_DISPATCH(add_product)(factor, a, b, sum);
}

}  // namespace scatter::reflectance::kernels
#endif
