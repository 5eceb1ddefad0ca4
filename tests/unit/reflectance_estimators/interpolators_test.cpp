#include <algorithm>
#include <catch2/catch.hpp>

#include "host_sdk/reflectance/estimators/grid_interpolator.h"
#include "host_sdk/reflectance/estimators/linear_axis_interpolator.h"
#include "host_sdk/reflectance/estimators/neighbors_interpolator.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tests/unit/reflectance_estimators/made_data.h"

using namespace scatter::reflectance;
using namespace scatter::reflectance::made;

namespace {

std::vector<double> steps(double from, double to, double step) {
  std::vector<double> out;
  for (double x = from; x <= to + 1e-9; x += step) {
    out.push_back(x);
  }
  return out;
}

double smooth(double theta_i, double theta_o, double phi) {
  return 1 + theta_i + std::sin(theta_o) * (0.5 + 0.2 * std::cos(phi));
}

std::shared_ptr<ScatteredBrdf> random_samples(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  ScatteredSamples samples;
  samples.channels = 1;
  for (std::size_t s = 0; s < count; ++s) {
    samples.omega_i.push_back(random_direction(random));
    samples.omega_o.push_back(random_direction(random));
    samples.f_per_sr.push_back(static_cast<float>(
        smooth(theta_of(samples.omega_i[s]), theta_of(samples.omega_o[s]), phi_of(samples.omega_o[s]))));
  }
  return ScatteredBrdf::make(samples).value();
}

/// Equation 38, straight from the page: sort all samples by distance, take k, weigh.
double shepard(const ScatteredSamples& samples, const Direction& i, const Direction& o, std::size_t k,
               double epsilon) {
  std::vector<std::pair<double, double>> all;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const double dx = samples.omega_i[s].x - i.x;
    const double dy = samples.omega_i[s].y - i.y;
    const double ex = samples.omega_o[s].x - o.x;
    const double ey = samples.omega_o[s].y - o.y;
    all.emplace_back(std::sqrt(dx * dx + dy * dy + ex * ex + ey * ey),
                     static_cast<double>(samples.f_per_sr[s]));
  }
  std::ranges::sort(all);
  double sum = 0;
  double total = 0;
  for (std::size_t n = 0; n < std::min(k, all.size()); ++n) {
    const double w = std::pow(all[n].first + epsilon, -2);
    sum += w * all[n].second;
    total += w;
  }
  return sum / total;
}

}  // namespace

TEST_CASE("Neighbours are weighed as Shepard's formula says") {
  const auto samples = random_samples(500, 3);
  const auto link =
      NeighborsInterpolator::make(samples, {.k = 7, .d_max = 3, .k_min = 1, .epsilon = 0.01, .region = {}})
          .value();
  const ScatteredSamples list = samples->samples();
  std::mt19937 random(5);
  for (int k = 0; k < 200; ++k) {
    const Direction i = random_direction(random);
    const Direction o = random_direction(random);
    const Value v = at(*link, i, o);
    REQUIRE(v.origin == Origin::kInterpolated);
    REQUIRE(v.f == Approx(shepard(list, i, o, 7, 0.01)).epsilon(1e-4));
  }
}

TEST_CASE("At a sample its own value comes back, whatever lies around it") {
  const auto samples = random_samples(300, 4);
  const auto link = NeighborsInterpolator::make(samples, {}).value();
  const ScatteredSamples list = samples->samples();
  for (std::size_t s = 0; s < list.size(); ++s) {
    const Value v = at(*link, list.omega_i[s], list.omega_o[s]);
    REQUIRE(v.origin == Origin::kMeasured);
    REQUIRE(v.f == static_cast<double>(list.f_per_sr[s]));
  }
}

TEST_CASE("Fewer neighbours than k_min within d_max means no value") {
  const auto samples = ScatteredBrdf::make(rings({20}, {0, 10}, 360, smooth)).value();
  const auto with = [&](std::size_t k, std::size_t k_min, double d_max) {
    return NeighborsInterpolator::make(
               samples, {.k = k, .d_max = d_max, .k_min = k_min, .epsilon = 1e-6, .region = {}})
        .value();
  };
  // Two samples in all: k above their number is fine, k_min above it is never reached.
  REQUIRE(at(*with(50, 2, 1), deg(20, 0), deg(4, 0)).origin == Origin::kInterpolated);
  REQUIRE(at(*with(50, 3, 1), deg(20, 0), deg(4, 0)).origin == Origin::kInvalid);
  REQUIRE(at(*with(50, 3, 1), deg(20, 0), deg(4, 0)).f == 0);
  // sin 10 deg = 0.1736 apart; from 4 deg the farther one is 0.104 away.
  REQUIRE(at(*with(2, 2, 0.10), deg(20, 0), deg(4, 0)).origin == Origin::kInvalid);
  REQUIRE(at(*with(2, 2, 0.11), deg(20, 0), deg(4, 0)).origin == Origin::kInterpolated);
  REQUIRE(at(*with(2, 1, 0.08), deg(20, 0), deg(4, 0)).f == Approx(smooth(radians(20), 0, 0)));
  const auto none = ScatteredBrdf::make(rings({}, {}, 360, smooth)).value();
  REQUIRE(at(*NeighborsInterpolator::make(none, {}).value(), deg(20, 0), deg(4, 0)).origin ==
          Origin::kInvalid);
}

TEST_CASE("The many samples of a pole do not crowd out its neighbours") {
  const auto samples =
      ScatteredBrdf::make(rings({20}, steps(0, 10, 1), 1, [](double, double theta_o, double) {
        return theta_o < 1e-9 ? 5.0 : 1.0;
      })).value();
  const auto link = NeighborsInterpolator::make(samples, {}).value();
  // Half-way to the first ring the pole is one neighbour of ten, next to two that are as near.
  const double f = at(*link, deg(20, 0), deg(0.5, 0.5)).f;
  REQUIRE(f > 1.2);
  REQUIRE(f < 3.0);
}

TEST_CASE("Options of neighbours out of range are refused") {
  const auto samples = random_samples(10, 1);
  using Options = NeighborsInterpolator::Options;
  for (const Options& bad :
       {Options{.k = 0}, Options{.k = 2000}, Options{.d_max = 0}, Options{.k_min = 0},
        Options{.k = 2, .k_min = 3}, Options{.epsilon = 0}, Options{.d_max = std::nan("")}}) {
    REQUIRE_FALSE(NeighborsInterpolator::make(samples, bad).has_value());
  }
}

TEST_CASE("A function linear in the angles comes back exactly along the axes") {
  const Function linear = [](double theta_i, double theta_o, double phi) {
    // Linear in phi too, away from the seam.
    return 2 + 3 * theta_i + 5 * theta_o + (phi < 0 ? phi + 2 * kPi : phi);
  };
  const auto samples = ScatteredBrdf::make(rings({10, 20, 50}, {10, 17, 30, 45}, 10, linear)).value();
  const auto link = LinearAxisInterpolator::make(samples, {}).value();
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int k = 0; k < 300; ++k) {
    const double theta_i = 10 + 40 * unit(random);
    const double theta_o = 10 + 35 * unit(random);
    const double phi = 350 * unit(random);
    const double turn = 360 * unit(random);
    const Value v = at(*link, deg(theta_i, turn), deg(theta_o, phi + turn));
    REQUIRE(v.origin == Origin::kInterpolated);
    REQUIRE(v.f == Approx(linear(radians(theta_i), radians(theta_o), radians(phi))).epsilon(1e-6));
  }
  REQUIRE(at(*link, deg(20, 0), deg(17, 40)).origin == Origin::kMeasured);
}

TEST_CASE("Axes end where the samples end, and at gaps") {
  ScatteredSamples list = rings({20, 40}, {10, 20}, 10, smooth);
  const auto link = LinearAxisInterpolator::make(ScatteredBrdf::make(list).value(), {}).value();
  REQUIRE(at(*link, deg(30, 0), deg(15, 5)).origin == Origin::kInterpolated);
  REQUIRE(at(*link, deg(19, 0), deg(15, 5)).origin == Origin::kInvalid);
  REQUIRE(at(*link, deg(41, 0), deg(15, 5)).origin == Origin::kInvalid);
  REQUIRE(at(*link, deg(30, 0), deg(9, 5)).origin == Origin::kInvalid);
  REQUIRE(at(*link, deg(30, 0), deg(21, 5)).origin == Origin::kInvalid);
  // Without 10 and 20 deg of azimuth the neighbours are 30 deg apart, without 30 deg too they are 40.
  const auto without = [&](double widest_phi) {
    ScatteredSamples kept = list;
    kept.omega_i.clear();
    kept.omega_o.clear();
    kept.f_per_sr.clear();
    for (std::size_t s = 0; s < list.size(); ++s) {
      const double phi = degrees(phi_of(list.omega_o[s]));
      if (phi < 5 || phi > widest_phi) {
        kept.omega_i.push_back(list.omega_i[s]);
        kept.omega_o.push_back(list.omega_o[s]);
        kept.f_per_sr.push_back(list.f_per_sr[s]);
      }
    }
    return LinearAxisInterpolator::make(ScatteredBrdf::make(kept).value(), {}).value();
  };
  REQUIRE(at(*without(25), deg(30, 0), deg(15, 12)).origin == Origin::kInterpolated);
  REQUIRE(at(*without(35), deg(30, 0), deg(15, 12)).origin == Origin::kInvalid);
}

TEST_CASE("A ring at the pole is one value for all azimuths") {
  const auto samples = ScatteredBrdf::make(rings({20}, {0, 10}, 60, smooth)).value();
  const auto link = LinearAxisInterpolator::make(samples, {.widest_gap = radians(60)}).value();
  for (const double phi : {0.0, 60.0, 300.0}) {
    const double expected =
        0.5 * smooth(radians(20), 0, 0) + 0.5 * smooth(radians(20), radians(10), radians(phi));
    REQUIRE(at(*link, deg(20, 0), deg(5, phi)).f == Approx(expected).epsilon(1e-6));
  }
}

TEST_CASE("Several azimuths of the light are one more axis") {
  ScatteredSamples list = rings({0, 40}, {20}, 10, [](double, double, double) { return 1.0; }, 0);
  const ScatteredSamples turned = rings({40}, {20}, 10, [](double, double, double) { return 3.0; }, 60);
  list.omega_i.insert(list.omega_i.end(), turned.omega_i.begin(), turned.omega_i.end());
  list.omega_o.insert(list.omega_o.end(), turned.omega_o.begin(), turned.omega_o.end());
  list.f_per_sr.insert(list.f_per_sr.end(), turned.f_per_sr.begin(), turned.f_per_sr.end());
  const auto link = LinearAxisInterpolator::make(ScatteredBrdf::make(list).value(), {}).value();
  REQUIRE(at(*link, deg(40, 15), deg(20, 77)).f == Approx(1.5));
  REQUIRE(at(*link, deg(20, 15), deg(20, 77)).f == Approx(1.25));
  REQUIRE(at(*link, deg(40, 200), deg(20, 77)).origin == Origin::kInvalid);
}

TEST_CASE("A grid filled from another link gives its values at the nodes, about either direction") {
  const auto samples = ScatteredBrdf::make(rings({0, 20, 40}, steps(0, 75, 5), 5, smooth)).value();
  const auto axis = LinearAxisInterpolator::make(samples, {}).value();
  const auto up = GridInterpolator::make(axis, {.axis = GridAxis::kUp, .step = radians(5)}).value();
  const auto specular =
      GridInterpolator::make(axis, {.axis = GridAxis::kSpecular, .step = radians(5)}).value();
  REQUIRE(dynamic_cast<const GridBrdf*>(&up->grid()) != nullptr);
  REQUIRE(dynamic_cast<const SpecularGridBrdf*>(&specular->grid()) != nullptr);
  const Value node = at(*up, deg(20, 0), deg(30, 105));
  REQUIRE(node.origin == Origin::kMeasured);
  REQUIRE(node.f == Approx(smooth(radians(20), radians(30), radians(105))).epsilon(1e-6));
  // In the plane of incidence the radial steps of 5 deg from 20 deg fall on the rings.
  const Value radial = at(*specular, deg(20, 0), deg(35, 180));
  REQUIRE(radial.f == Approx(smooth(radians(20), radians(35), kPi)).epsilon(1e-6));
  // Off the nodes: bilinear over 5 deg cells, error about (5 deg)^2 / 8 * 0.7.
  REQUIRE(at(*specular, deg(20, 0), deg(33, 141)).f ==
          Approx(smooth(radians(20), radians(33), radians(141))).margin(2e-3));
  // Outside it the inner link answers, which has nothing there.
  REQUIRE(at(*up, deg(20, 0), deg(80, 0)).origin == Origin::kInvalid);
  REQUIRE(at(*up, deg(50, 0), deg(30, 0)).origin == Origin::kInvalid);
}

TEST_CASE("A grid needs a step that divides the circle, and incidences") {
  const auto samples = ScatteredBrdf::make(rings({0, 20}, {0, 10, 20}, 10, smooth)).value();
  for (const double step : {0.0, 0.01, 7.0, 60.0, -1.0}) {
    REQUIRE_FALSE(
        GridInterpolator::make(samples, {.axis = GridAxis::kUp, .step = radians(step)}).has_value());
  }
  REQUIRE_FALSE(GridInterpolator::make(random_samples(50, 1), {}).has_value());
}

TEST_CASE("Uncertainties of samples are weighted with the values") {
  ScatteredSamples list = rings({20}, {10, 20}, 10, smooth);
  list.random_per_sr.assign(list.size(), 0.25F);
  list.systematic_per_sr.assign(list.size(), 0.5F);
  const auto samples = ScatteredBrdf::make(list).value();
  double random = 0;
  double systematic = 0;
  const auto near = NeighborsInterpolator::make(samples, {}).value();
  const auto axis = LinearAxisInterpolator::make(samples, {}).value();
  for (const std::shared_ptr<const Brdf>& link :
       {std::shared_ptr<const Brdf>(near), std::shared_ptr<const Brdf>(axis)}) {
    REQUIRE(link->uncertainty(deg(20, 0), deg(14, 33), std::span(&random, 1), std::span(&systematic, 1)));
    REQUIRE(random == Approx(0.25));
    REQUIRE(systematic == Approx(0.5));
    REQUIRE_FALSE(
        link->uncertainty(deg(60, 0), deg(14, 33), std::span(&random, 1), std::span(&systematic, 1)));
  }
}
