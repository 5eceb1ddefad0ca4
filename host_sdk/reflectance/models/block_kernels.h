// The formulas of formulas/ for a whole GeometryBlock, by the vector instructions of the processor at
// hand. Each equals its scalar form to about 1e-13 relative; values below 1e-300 may be 0. Without exp
// and log (GGX, Oren-Nayar, the Fresnel terms) the bits are the same on every processor.
#pragma once

#include "host_sdk/reflectance/models/formulas/ward.h"
#include "host_sdk/reflectance/models/geometry_block.h"

namespace scatter::reflectance::kernels {

/// Fills everything from i and o_x, o_y, o_z.
void complete(GeometryBlock& block) noexcept;

/// Roughness of the facets, and that with which they mask each other (the same but for Disney's).
struct GgxAlphas {
  double x = 0;
  double y = 0;
  double masking_x = 0;
  double masking_y = 0;
};

/// formulas::ggx_lobe(alpha_x, alpha_y, g), and formulas::disney_specular_lobe.
void ggx_lobe(const GgxAlphas& alphas, const GeometryBlock& block, BlockArray& out) noexcept;

/// formulas::disney_clearcoat_lobe.
void disney_clearcoat_lobe(double gloss, const GeometryBlock& block, BlockArray& out) noexcept;

/// formulas::disney_diffuse, blended with disney_subsurface.
void disney_base(double roughness, double subsurface, const GeometryBlock& block, BlockArray& out) noexcept;

/// formulas::beckmann_distribution, for the lobes that go on from it.
void beckmann_distribution(double alpha, const GeometryBlock& block, BlockArray& out) noexcept;

/// formulas::cook_torrance_lobe.
void cook_torrance_lobe(double m, const GeometryBlock& block, BlockArray& out) noexcept;

/// formulas::ward_lobe(kind, alpha_x, alpha_y, g).
void ward_lobe(formulas::WardKind kind, double alpha_x, double alpha_y, const GeometryBlock& block,
               BlockArray& out) noexcept;

/// formulas::mirror_power.
void mirror_power(double n, const GeometryBlock& block, BlockArray& out) noexcept;

/// formulas::oren_nayar.
void oren_nayar(double sigma, const GeometryBlock& block, BlockArray& out) noexcept;

/// formulas::schlick_fresnel, dielectric_fresnel and conductor_fresnel of cos_d.
void schlick_fresnel(double f0, const GeometryBlock& block, BlockArray& out) noexcept;
void dielectric_fresnel(double eta, const GeometryBlock& block, BlockArray& out) noexcept;
void conductor_fresnel(double n, double k, const GeometryBlock& block, BlockArray& out) noexcept;

/// sum += factor * a, and sum += factor * a * b.
void add(double factor, const BlockArray& a, BlockArray& sum) noexcept;
void add_product(double factor, const BlockArray& a, const BlockArray& b, BlockArray& sum) noexcept;

}  // namespace scatter::reflectance::kernels
