// A family's model as a sum that is linear in all but a few parameters.
//
// f_c = rest(shape) + sum over terms j of coefficient_cj * term_j(shape), for every channel c. The terms
// do not know channels, so their cost is paid once for all of them.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/reflectance/fitting/fit_family.h"
#include "host_sdk/reflectance/models/formulas/geometry.h"

namespace scatter::reflectance {

/// A parameter that all channels share and that the model is not linear in.
struct ShapeParameter {
  std::string name = {};  ///< Key of the model spec, with 1 or 2 appended when there are two lobes.
  double lower = 0;
  double upper = 1;
  bool logarithmic = false;       ///< Is searched, and has a symmetric interval, in its logarithm.
  std::vector<double> scan = {};  ///< Values to start from.
};

/// A parameter of one channel, 0..1, that the model is linear in.
struct Coefficient {
  std::string name = {};
};

/// In the order of FittedBrdf::Parameters::shape.
[[nodiscard]] std::vector<ShapeParameter> shape_parameters(const FitFamily& family);
/// One per term: the base's albedo first (Disney: the base colour), then one per lobe.
[[nodiscard]] std::vector<Coefficient> coefficients(const FitFamily& family);

/// rest and terms of many geometries.
/// Shape     shape as shape_parameters; out[k * stride + 0] = rest, + 1 + j = term j, with
///           stride = 1 + coefficients(family).size().
/// Cost      50 to 150 ns per lobe and geometry.
void evaluate_terms(const FitFamily& family, std::span<const double> shape,
                    std::span<const formulas::Geometry> geometries, std::span<double> out) noexcept;

/// The same with derivatives: out[(k * stride + t) * (1 + shape.size()) + 0] is the value and + 1 + p its
/// derivative by shape parameter p (not by its logarithm).
void evaluate_terms_with_derivatives(const FitFamily& family, std::span<const double> shape,
                                     std::span<const formulas::Geometry> geometries,
                                     std::span<double> out) noexcept;

}  // namespace scatter::reflectance
