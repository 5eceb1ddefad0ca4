// The error of interpolating between incidences, as published for libbsdf's four ways.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "host_sdk/reflectance/estimators/incidence_interpolator.h"
#include "host_sdk/reflectance/models/ggx.h"

using namespace scatter::reflectance;

namespace {

struct Figures {
  double mean = 0;
  double p99 = 0;
  double peak_ratio = 0;
};

/// Over a 1 deg grid about the normal to theta_o = 75, weighted by solid angle.
Figures figures_of(const Brdf& estimate, const Brdf& truth, double theta_i) {
  const Direction omega_i = from_spherical(theta_i, 0);
  std::vector<Direction> nodes;
  std::vector<double> weight;
  for (int row = 0; row <= 75; ++row) {
    for (int column = 0; column < 360; ++column) {
      nodes.push_back(from_spherical(radians(row), radians(column)));
      weight.push_back(row == 0 ? (1 - std::cos(radians(0.5))) / (2 * std::sin(radians(0.5)))
                                : std::sin(radians(row)));
    }
  }
  std::vector<double> estimated(nodes.size() * 3);
  std::vector<double> true_value(nodes.size() * 3);
  std::vector<Origin> origin(nodes.size());
  estimate.eval_batch(omega_i, nodes, estimated, origin);
  truth.eval_batch(omega_i, nodes, true_value, {});
  std::vector<std::pair<double, double>> relative;
  Figures error;
  double total = 0;
  // The place of the true peak is taken to be the mirror direction.
  const auto peak = static_cast<std::size_t>(std::lround(degrees(theta_i)) * 360 + 180);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const double e = std::abs(estimated[3 * k] / true_value[3 * k] - 1);
    relative.emplace_back(e, weight[k]);
    error.mean += e * weight[k];
    total += weight[k];
  }
  error.mean /= total;
  error.peak_ratio = estimated[3 * peak] / true_value[3 * peak];
  std::ranges::sort(relative);
  double reached = 0;
  for (const auto& [e, w] : relative) {
    reached += w;
    if (reached >= 0.99 * total) {
      error.p99 = e;
      break;
    }
  }
  return error;
}

struct Row {
  double alpha = 0;
  double theta_i_deg = 0;
  std::array<Figures, 4> expected;
};

const std::array<Row, 9> kTable{{
    {0.1, 10, {{{.0333, .51, 0.44}, {.0023, .022, 1.03}, {.0077, .085, 1.00}, {.0040, .038, 1.03}}}},
    {0.1, 30, {{{.0356, .58, 0.42}, {.0060, .079, 1.06}, {.0177, .179, 0.99}, {.0078, .120, 1.06}}}},
    {0.1, 50, {{{.0429, .94, 0.41}, {.0272, .73, 1.54}, {.0230, .445, 1.22}, {.0294, .92, 1.54}}}},
    {0.3, 10, {{{.0088, .039, .96}, {.0049, .026, 1.01}, {.0102, .110, 1.00}, {.0046, .017, 1.01}}}},
    {0.3, 30, {{{.0097, .088, .95}, {.0108, .147, 1.03}, {.0229, .233, .95}, {.0081, .097, 1.03}}}},
    {0.3, 50, {{{.0097, .207, .98}, {.0329, .617, 1.31}, {.0290, .453, 1.24}, {.0251, .444, 1.31}}}},
    {0.6, 10, {{{.0014, .006, 1.00}, {.0033, .017, 1.00}, {.0085, .097, 1.00}, {.0019, .007, 1.00}}}},
    {0.6, 30, {{{.0019, .020, 1.00}, {.0069, .074, 1.01}, {.0174, .150, .99}, {.0038, .033, 1.01}}}},
    {0.6, 50, {{{.0046, .066, 1.02}, {.0200, .281, 1.10}, {.0199, .217, 1.08}, {.0134, .161, 1.10}}}},
}};

std::shared_ptr<const Ggx> truth_of(const Row& row) {
  return std::make_shared<const Ggx>(Ggx::Parameters{uniform(row.alpha), uniform(0.04), uniform(0.2)});
}

Extent measured_incidences() {
  return {.theta_i = {0, radians(20), radians(40), radians(60)}, .azimuth = 0, .theta_o_to = kPi / 2};
}

}  // namespace

// PROVES: reflectance.md 6, the table measured with libbsdf's interpolators. Which directions were looked
// at is not stated there: moving our nodes by half a step moves a mean by 2 %, a 99th percentile by 6 %
// (lobes of alpha = 0.1 are a few nodes wide) and a peak by 0.03.
TEST_CASE("The four simple ways make the errors that were published for them") {
  const std::array<IncidenceMode, 4> modes{IncidenceMode::kPlain, IncidenceMode::kSpecular,
                                           IncidenceMode::kSpecularSplineZero, IncidenceMode::kDistorted};
  for (const Row& row : kTable) {
    const auto truth = truth_of(row);
    for (std::size_t m = 0; m < modes.size(); ++m) {
      CAPTURE(row.alpha, row.theta_i_deg, std::string(name(modes[m])));
      const auto link = IncidenceInterpolator::make(truth, modes[m], measured_incidences()).value();
      const Figures found = figures_of(*link, *truth, radians(row.theta_i_deg));
      const Figures& e = row.expected[m];
      // The spline of libbsdf also runs across the nodes of its grid, next to the zeros below the horizon.
      const double looseness = m == 2 ? 0.065 : 0.025;
      CHECK(found.mean == Approx(e.mean).epsilon(looseness).margin(0.00005));
      CHECK(found.p99 == Approx(e.p99).epsilon(0.06).margin(0.0005));
      CHECK(found.peak_ratio == Approx(e.peak_ratio).margin(0.012));
    }
  }
}

TEST_CASE("A spline that knows no value below the horizon errs less than one that takes 0 there") {
  for (const Row& row : kTable) {
    const auto truth = truth_of(row);
    const auto link =
        IncidenceInterpolator::make(truth, IncidenceMode::kSpecularSpline, measured_incidences()).value();
    CAPTURE(row.alpha, row.theta_i_deg);
    CHECK(figures_of(*link, *truth, radians(row.theta_i_deg)).mean < row.expected[2].mean);
  }
}
