#include "host_sdk/reflectance/fitting/fit_terms.h"

#include <ceres/jet.h>

#include <algorithm>
#include <array>
#include <type_traits>

#include "host_sdk/reflectance/models/formulas/cook_torrance.h"
#include "host_sdk/reflectance/models/formulas/disney.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/formulas/lafortune.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"
#include "host_sdk/reflectance/models/formulas/oren_nayar.h"
#include "host_sdk/reflectance/models/formulas/ward.h"

namespace scatter::reflectance {
namespace {

using formulas::Geometry;

bool has_fresnel(FitLobe lobe) {
  return lobe == FitLobe::kGgx || lobe == FitLobe::kBeckmann || lobe == FitLobe::kCookTorrance;
}

/// Whether the lobe's strength is free; one lobe of facets reflects all light at grazing incidence.
bool has_weight(const FitFamily& family, FitLobe lobe) {
  return has_fresnel(lobe) && (family.lobes.size() > 1 || lobe == FitLobe::kCookTorrance);
}

std::string numbered(const char* name, std::size_t lobe, std::size_t lobes) {
  return lobes > 1 ? name + std::to_string(lobe + 1) : name;
}

/// Value and derivative by the shape parameter, or the value alone (T double).
template <typename T>
T lobe_value(FitLobe lobe, const T& shape, const Geometry& g) {
  switch (lobe) {
    case FitLobe::kGgx:
      return formulas::ggx_lobe(shape, g);
    case FitLobe::kBeckmann:
      return formulas::beckmann_lobe(shape, g);
    case FitLobe::kCookTorrance:
      return formulas::cook_torrance_lobe(shape, g);
    case FitLobe::kWard:
      return formulas::ward_lobe(formulas::WardKind::kWard, shape, g);
    case FitLobe::kLafortune:
      break;
  }
  return formulas::lafortune_phong_lobe(shape, g);
}

/// Where a family's parameters and results lie, and how results are stored.
struct Layout {
  std::size_t shapes = 0;   ///< Number of shape parameters.
  std::size_t stride = 0;   ///< 1 + number of terms.
  std::size_t columns = 1;  ///< 1, or 1 + shapes with derivatives.

  [[nodiscard]] double* at(std::span<double> out, std::size_t k, std::size_t term) const {
    return out.data() + (k * stride + term) * columns;
  }
};

void store(double* at, double value) {
  *at = value;
}
template <int kShapes>
void store(double* at, const ceres::Jet<double, kShapes>& value) {
  at[0] = value.a;
  for (int p = 0; p < kShapes; ++p) {
    at[1 + p] = value.v[p];
  }
}

/// Shape parameter p as a number, or as a Jet that varies with it.
template <typename T>
T variable(std::span<const double> shape, std::size_t p) {
  if constexpr (std::is_same_v<T, double>) {
    return shape[p];
  } else {
    return T(shape[p], static_cast<int>(p));
  }
}

/// The Disney model with f0 = (1 - metallic) 0.08 specular + metallic colour, linear in the colour.
/// T is double or a Jet over (roughness, metallic, specular).
template <typename T>
void disney_terms(const std::array<T, 3>& shape, std::span<const Geometry> geometries, const Layout& layout,
                  std::span<double> out) {
  const auto& [roughness, metallic, specular] = shape;
  for (std::size_t k = 0; k < geometries.size(); ++k) {
    const Geometry& g = geometries[k];
    const double s = formulas::schlick_weight(g.cos_d);
    const T lobe = formulas::disney_specular_lobe(roughness, T(0.0), g);
    const T diffuse = formulas::disney_diffuse(roughness, g) * (1.0 / kPi);
    const T dielectric = (1.0 - metallic) * specular * 0.08;
    store(layout.at(out, k, 0), T(lobe * (dielectric * (1.0 - s) + s)));
    store(layout.at(out, k, 1), T((1.0 - metallic) * diffuse + metallic * lobe * (1.0 - s)));
  }
}

/// glTF: mix(dielectric, metal, metallic), the dielectric being mix(c / pi, lobe, F) with F from f0 to
/// `specular` at grazing angles, the metal the lobe with Schlick's F from c. Linear in the colour c.
/// T is double or a Jet over (roughness, metallic, f0, specular); without the last, specular is 1.
/// Source  glTF 2.0 specification, B.2 and B.3; KHR_materials_specular, KHR_materials_ior.
template <typename T, std::size_t kShapes>
void gltf_terms(const std::array<T, kShapes>& shape, std::span<const Geometry> geometries,
                const Layout& layout, std::span<double> out) {
  const T& metallic = shape[1];
  const T& f0 = shape[2];
  const T specular = kShapes == 4 ? shape[kShapes - 1] : T(1.0);
  const T alpha = shape[0] * shape[0];
  for (std::size_t k = 0; k < geometries.size(); ++k) {
    const Geometry& g = geometries[k];
    const double s = formulas::schlick_weight(g.cos_d);
    const T lobe = formulas::ggx_lobe(alpha, g);
    const T fresnel = specular * (f0 * (1.0 - s) + s);
    store(layout.at(out, k, 0), T(lobe * ((1.0 - metallic) * fresnel + metallic * s)));
    store(layout.at(out, k, 1),
          T((1.0 - metallic) * (1.0 - fresnel) * (1.0 / kPi) + metallic * lobe * (1.0 - s)));
  }
}

template <bool kDerivatives>
void base_terms(const FitFamily& family, std::span<const double> shape, std::span<const Geometry> geometries,
                const Layout& layout, std::span<double> out) {
  std::ranges::fill(out.first(geometries.size() * layout.stride * layout.columns), 0.0);
  if (family.base == FitBase::kLambert) {
    for (std::size_t k = 0; k < geometries.size(); ++k) {
      *layout.at(out, k, 1) = 1.0 / kPi;
    }
    return;
  }
  for (std::size_t k = 0; k < geometries.size(); ++k) {
    double* at = layout.at(out, k, 1);
    if constexpr (kDerivatives) {
      const auto value = formulas::oren_nayar(ceres::Jet<double, 1>(shape[0], 0), geometries[k]);
      at[0] = value.a;
      at[1] = value.v[0];
    } else {
      *at = formulas::oren_nayar(shape[0], geometries[k]);
    }
  }
}

/// Adds lobe number `index`; its shape is parameter p, its weight (if it has one) parameter p + 1.
template <FitLobe kLobe, bool kDerivatives>
void lobe_terms(std::size_t index, bool weighted, std::size_t p, std::span<const double> shape,
                std::span<const Geometry> geometries, const Layout& layout, std::span<double> out) {
  const double weight = weighted ? shape[p + 1] : 1.0;
  constexpr bool kFresnel =
      kLobe == FitLobe::kGgx || kLobe == FitLobe::kBeckmann || kLobe == FitLobe::kCookTorrance;
  for (std::size_t k = 0; k < geometries.size(); ++k) {
    const Geometry& g = geometries[k];
    double value = 0;
    double slope = 0;
    if constexpr (kDerivatives) {
      const auto jet = lobe_value(kLobe, ceres::Jet<double, 1>(shape[p], 0), g);
      value = jet.a;
      slope = jet.v[0];
    } else {
      value = lobe_value(kLobe, shape[p], g);
    }
    // Schlick: f0 + (1 - f0) s = f0 (1 - s) + s.
    const double s = kFresnel ? formulas::schlick_weight(g.cos_d) : 0.0;
    double* rest = layout.at(out, k, 0);
    double* term = layout.at(out, k, 2 + index);
    rest[0] += weight * s * value;
    term[0] = weight * (1 - s) * value;
    if constexpr (kDerivatives) {
      rest[1 + p] += weight * s * slope;
      term[1 + p] = weight * (1 - s) * slope;
      if (weighted) {
        rest[2 + p] += s * value;
        term[2 + p] = (1 - s) * value;
      }
    }
  }
}

template <bool kDerivatives>
void all_terms(const FitFamily& family, std::span<const double> shape, std::span<const Geometry> geometries,
               std::span<double> out) {
  const bool whole = family.whole != FitWhole::kNone;
  const Layout layout{.shapes = shape.size(),
                      .stride = whole ? 2 : 2 + family.lobes.size(),
                      .columns = kDerivatives ? 1 + shape.size() : 1};
  if (family.whole == FitWhole::kDisney) {
    using T = std::conditional_t<kDerivatives, ceres::Jet<double, 3>, double>;
    disney_terms<T>({variable<T>(shape, 0), variable<T>(shape, 1), variable<T>(shape, 2)}, geometries, layout,
                    out);
    return;
  }
  if (family.whole == FitWhole::kGltf) {
    using T = std::conditional_t<kDerivatives, ceres::Jet<double, 4>, double>;
    gltf_terms<T, 4>(
        {variable<T>(shape, 0), variable<T>(shape, 1), variable<T>(shape, 2), variable<T>(shape, 3)},
        geometries, layout, out);
    return;
  }
  if (family.whole == FitWhole::kMetallicRoughness) {
    using T = std::conditional_t<kDerivatives, ceres::Jet<double, 3>, double>;
    gltf_terms<T, 3>({variable<T>(shape, 0), variable<T>(shape, 1), variable<T>(shape, 2)}, geometries,
                     layout, out);
    return;
  }
  base_terms<kDerivatives>(family, shape, geometries, layout, out);
  std::size_t p = family.base == FitBase::kOrenNayar ? 1 : 0;
  for (std::size_t index = 0; index < family.lobes.size(); ++index) {
    const FitLobe lobe = family.lobes[index];
    const bool weighted = has_weight(family, lobe);
    // One loop per kind of lobe, so that nothing is decided inside it.
    switch (lobe) {
      case FitLobe::kGgx:
        lobe_terms<FitLobe::kGgx, kDerivatives>(index, weighted, p, shape, geometries, layout, out);
        break;
      case FitLobe::kBeckmann:
        lobe_terms<FitLobe::kBeckmann, kDerivatives>(index, weighted, p, shape, geometries, layout, out);
        break;
      case FitLobe::kCookTorrance:
        lobe_terms<FitLobe::kCookTorrance, kDerivatives>(index, weighted, p, shape, geometries, layout, out);
        break;
      case FitLobe::kWard:
        lobe_terms<FitLobe::kWard, kDerivatives>(index, weighted, p, shape, geometries, layout, out);
        break;
      case FitLobe::kLafortune:
        lobe_terms<FitLobe::kLafortune, kDerivatives>(index, weighted, p, shape, geometries, layout, out);
        break;
    }
    p += weighted ? 2 : 1;
  }
}

}  // namespace

std::vector<ShapeParameter> shape_parameters(const FitFamily& family) {
  if (family.whole == FitWhole::kGltf || family.whole == FitWhole::kMetallicRoughness) {
    // f0 0.25 is an index of 3, the most that KHR_materials_ior's users mean.
    std::vector<ShapeParameter> all{{"roughness", 0.04, 1, false, {0.15, 0.3, 0.5, 0.8}},
                                    {"metallic", 0, 1, false, {0.05, 0.5, 0.95}},
                                    {"f0", 0, 0.25, false, {0.05}}};
    if (family.whole == FitWhole::kGltf) {
      all.push_back({"specular", 0, 1, false, {0.8}});
    }
    return all;
  }
  if (family.whole == FitWhole::kDisney) {
    return {{"roughness", 0.04, 1, false, {0.15, 0.3, 0.5, 0.8}},
            {"metallic", 0, 1, false, {0.05, 0.5, 0.95}},
            {"specular", 0, 1, false, {0.5}}};
  }
  std::vector<ShapeParameter> all;
  if (family.base == FitBase::kOrenNayar) {
    all.push_back({"sigma", 0, kPi / 2, false, {0.35}});
  }
  const std::size_t lobes = family.lobes.size();
  for (std::size_t k = 0; k < lobes; ++k) {
    const FitLobe lobe = family.lobes[k];
    if (lobe == FitLobe::kLafortune) {
      all.push_back({numbered("n", k, lobes), 0.5, 1e5, true, {3, 12, 50, 200, 1000, 10000}});
    } else {
      const char* name = lobe == FitLobe::kCookTorrance ? "m" : "alpha";
      all.push_back({numbered(name, k, lobes), 0.001, 1, true, {0.01, 0.03, 0.08, 0.2, 0.4, 0.75}});
    }
    if (has_weight(family, lobe)) {
      // Above 1/4 one lobe of Cook and Torrance reflects more than it receives.
      const bool cook_torrance = lobe == FitLobe::kCookTorrance;
      all.push_back({numbered(cook_torrance ? "ks" : "weight", k, lobes),
                     0,
                     cook_torrance ? 0.25 : 1,
                     false,
                     {cook_torrance ? 0.15 : 0.5}});
    }
  }
  return all;
}

std::vector<Coefficient> coefficients(const FitFamily& family) {
  if (family.whole != FitWhole::kNone) {
    return {{"base"}};
  }
  std::vector<Coefficient> all{{"albedo"}};
  for (std::size_t k = 0; k < family.lobes.size(); ++k) {
    all.push_back({numbered(has_fresnel(family.lobes[k]) ? "f0" : "ks", k, family.lobes.size())});
  }
  return all;
}

void evaluate_terms(const FitFamily& family, std::span<const double> shape,
                    std::span<const Geometry> geometries, std::span<double> out) noexcept {
  all_terms<false>(family, shape, geometries, out);
}

void evaluate_terms_with_derivatives(const FitFamily& family, std::span<const double> shape,
                                     std::span<const Geometry> geometries, std::span<double> out) noexcept {
  all_terms<true>(family, shape, geometries, out);
}

}  // namespace scatter::reflectance
