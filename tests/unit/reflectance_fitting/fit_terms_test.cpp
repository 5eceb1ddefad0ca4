#include "host_sdk/reflectance/fitting/fit_terms.h"

#include <catch2/catch.hpp>
#include <vector>

namespace scatter::reflectance {

TEST_CASE("Derivatives of the terms are those of difference quotients", "[fit_terms]") {
  std::vector<formulas::Geometry> geometries;
  for (const double theta_i : {0.0, 0.4, 1.1}) {
    for (const double theta_o : {0.02, 0.5, 1.2}) {
      for (const double phi : {0.1, 1.9, 3.1}) {
        geometries.push_back(
            formulas::make_geometry(from_spherical(theta_i, 0), from_spherical(theta_o, phi)));
      }
    }
  }
  for (const char* text :
       {"oren-nayar", "ggx", "beckmann", "cook-torrance", "ward", "lafortune", "ggx2", "ward2",
        "oren-nayar+ggx+ward", "oren-nayar+cook-torrance+beckmann", "disney", "gltf", "metallic-roughness"}) {
    const FitFamily family = fit_family(text).value();
    const auto parameters = shape_parameters(family);
    const std::size_t stride = 1 + coefficients(family).size();
    const std::size_t columns = 1 + parameters.size();
    std::vector<double> shape;
    for (const auto& parameter : parameters) {
      shape.push_back(parameter.logarithmic
                          ? std::sqrt(parameter.scan[2] * parameter.scan[3])
                          : 0.4 * parameter.upper + 0.1 * static_cast<double>(shape.size()) / 6);
    }
    std::vector<double> all(geometries.size() * stride * columns);
    evaluate_terms_with_derivatives(family, shape, geometries, all);
    std::vector<double> plain(geometries.size() * stride);
    evaluate_terms(family, shape, geometries, plain);
    for (std::size_t k = 0; k < plain.size(); ++k) {
      REQUIRE(all[k * columns] == Approx(plain[k]).epsilon(1e-12).margin(1e-300));
    }
    for (std::size_t p = 0; p < parameters.size(); ++p) {
      const double step = 1e-5 * shape[p];
      std::vector<double> high(plain.size());
      std::vector<double> low(plain.size());
      std::vector<double> moved = shape;
      moved[p] = shape[p] + step;
      evaluate_terms(family, moved, geometries, high);
      moved[p] = shape[p] - step;
      evaluate_terms(family, moved, geometries, low);
      for (std::size_t k = 0; k < plain.size(); ++k) {
        CAPTURE(text, parameters[p].name, k);
        const double quotient = (high[k] - low[k]) / (2 * step);
        // Central differences: error of second order in the step, and rounding of 1e-16 / 1e-5.
        REQUIRE(all[k * columns + 1 + p] ==
                Approx(quotient).epsilon(1e-6).margin(1e-8 * (1 + std::abs(plain[k] / shape[p]))));
      }
    }
  }
}

}  // namespace scatter::reflectance
