#include <algorithm>
#include <catch2/catch.hpp>

#include "host_sdk/reflectance/estimators/edge_extrapolator.h"
#include "host_sdk/reflectance/estimators/horizon_extrapolator.h"
#include "host_sdk/reflectance/estimators/incidence_interpolator.h"
#include "tests/unit/reflectance_estimators/made_data.h"

using namespace scatter::reflectance;
using namespace scatter::reflectance::made;

namespace {

std::shared_ptr<const Brdf> function(Function f, double random = 0, double systematic = 0) {
  return std::make_shared<const FunctionBrdf>(std::move(f), random, systematic);
}
double per_deg(double slope_per_deg) {
  return degrees(slope_per_deg);
}

struct Sigma {
  bool known = false;
  double random = -1;
  double systematic = -1;
};
Sigma sigma_at(const Brdf& brdf, const Direction& i, const Direction& o) {
  Sigma s;
  s.known = brdf.uncertainty(i, o, std::span(&s.random, 1), std::span(&s.systematic, 1));
  return s;
}

}  // namespace

TEST_CASE("The four modes towards the horizon are what the instrument's software offers") {
  // 3 at 75 deg, falling by 0.1 per degree.
  const auto data =
      function([](double, double theta_o, double) { return 3 - per_deg(0.1) * (theta_o - radians(75)); });
  const auto with = [&](HorizonMode mode) {
    return HorizonExtrapolator::make(data, mode, radians(75)).value();
  };
  const Direction i = deg(20, 0);

  const Value none = at(*with(HorizonMode::kNone), i, deg(80, 10));
  REQUIRE(none.origin == Origin::kInvalid);
  REQUIRE(none.f == 0);

  const auto linear = with(HorizonMode::kLinear);
  REQUIRE(at(*linear, i, deg(80, 10)).f == Approx(3 * 10.0 / 15));
  REQUIRE(at(*linear, i, deg(90, 10)).f == Approx(0).margin(1e-12));
  REQUIRE(at(*linear, i, deg(80, 10)).origin == Origin::kExtrapolated);

  REQUIRE(at(*with(HorizonMode::kConstant), i, deg(89, 10)).f == Approx(3));

  // Middle point half-way on the tangent: 3 - 0.1 * 7.5 = 2.25; x is then linear in t, so that at 80 deg
  // t = 1/3 and f = (4 * 3 + 4 * 2.25 + 0) / 9.
  const auto bezier = with(HorizonMode::kBezier);
  REQUIRE(at(*bezier, i, deg(80, 10)).f == Approx((4 * 3 + 4 * 2.25) / 9));
  REQUIRE(at(*bezier, i, deg(90, 10)).f == Approx(0).margin(1e-12));
  const double before = at(*bezier, i, deg(74.99, 10)).f;
  const double edge = at(*bezier, i, deg(75, 10)).f;
  const double after = at(*bezier, i, deg(75.01, 10)).f;
  REQUIRE((edge - before) / 0.01 == Approx(-0.1).epsilon(1e-3));
  REQUIRE((after - edge) / 0.01 == Approx(-0.1).epsilon(1e-2));
}

TEST_CASE("A steep fall at the edge reaches 0 and never passes it") {
  // The tangent meets 0 two degrees beyond the edge.
  const auto data =
      function([](double, double theta_o, double) { return 3 - per_deg(1.5) * (theta_o - radians(75)); });
  const auto bezier = HorizonExtrapolator::make(data, HorizonMode::kBezier, radians(75)).value();
  double last = 3;
  for (double theta = 75; theta <= 90; theta += 0.125) {
    const double f = at(*bezier, deg(20, 0), deg(theta, 10)).f;
    REQUIRE(f >= 0);
    REQUIRE(f <= last + 1e-12);
    last = f;
  }
  REQUIRE((at(*bezier, deg(20, 0), deg(75.001, 10)).f - 3) / 0.001 == Approx(-1.5).epsilon(1e-2));
}

TEST_CASE("Inside its edge an extrapolator changes nothing") {
  const auto data = function(
      [](double theta_i, double theta_o, double phi) { return 1 + theta_i + theta_o * std::cos(phi); });
  const auto horizon = HorizonExtrapolator::make(data, HorizonMode::kLinear, radians(75)).value();
  const auto clamp = ClampExtrapolator::make(data, {.axis = Edge::Axis::kThetaI, .at = radians(60)}).value();
  for (const double theta : {0.0, 40.0, 75.0}) {
    REQUIRE(at(*horizon, deg(20, 0), deg(theta, 33)).origin == Origin::kMeasured);
    REQUIRE(at(*horizon, deg(20, 0), deg(theta, 33)).f == at(*data, deg(20, 0), deg(theta, 33)).f);
  }
  REQUIRE(at(*clamp, deg(60, 0), deg(89, 33)).origin == Origin::kMeasured);
  REQUIRE(at(*clamp, deg(60.01, 0), deg(70, 33)).origin == Origin::kExtrapolated);
}

TEST_CASE("The gradient runs from the edge's value to a share of it along the bent curve") {
  using G = GradientExtrapolator;
  // l = 0.5 is a straight line; the ends are fixed; l = 0: (x, y) = (t^2, 2t - t^2), so y = 2 sqrt(x) - x.
  for (double x = 0; x <= 1; x += 0.0625) {
    REQUIRE(G::bend(x, 0.5) == Approx(x).margin(1e-12));
    REQUIRE(G::bend(x, 0) == Approx(2 * std::sqrt(x) - x).margin(1e-12));
    // The curves of l and 1 - l mirror each other at the diagonal.
    REQUIRE(G::bend(G::bend(x, 0.3), 0.7) == Approx(x).margin(1e-12));
  }
  for (const double l : {0.0, 0.2, 0.9, 1.0}) {
    REQUIRE(G::bend(0, l) == Approx(0).margin(1e-12));
    REQUIRE(G::bend(1, l) == Approx(1));
  }
  // Definition: some t gives (x, y) = 2 (1 - t) t (l, 1 - l) + t^2 (1, 1).
  for (const double t : {0.1, 0.4, 0.8}) {
    const double l = 0.3;
    REQUIRE(G::bend(2 * (1 - t) * t * l + t * t, l) == Approx(2 * (1 - t) * t * (1 - l) + t * t));
  }

  const auto data = function([](double, double, double) { return 2.0; });
  const auto link =
      G::make(data, {.axis = Edge::Axis::kThetaO, .at = radians(70)}, {.p = 0.2, .m = radians(10), .l = 0.5})
          .value();
  REQUIRE(at(*link, deg(0, 0), deg(75, 0)).f == Approx(2 * (0.5 + 0.5 * 0.2)));
  REQUIRE(at(*link, deg(0, 0), deg(85, 0)).f == Approx(2 * 0.2));
  const auto over_i =
      G::make(data, {.axis = Edge::Axis::kThetaI, .at = radians(60)}, {.p = 0.2, .m = radians(10), .l = 0})
          .value();
  const double t = 2 * std::sqrt(0.25) - 0.25;
  REQUIRE(at(*over_i, deg(62.5, 0), deg(10, 0)).f == Approx(2 * ((1 - t) + t * 0.2)));
}

TEST_CASE("Beyond the last incidence a lobe stays about the mirror direction") {
  const auto data = function([](double theta_i, double theta_o, double phi) {
    const double a = angle_between(from_spherical(theta_i, kPi), from_spherical(theta_o, phi));
    return std::exp(-a * a / 0.05);
  });
  const auto link = ClampExtrapolator::make(data, {.axis = Edge::Axis::kThetaI, .at = radians(60)}).value();
  for (const double turn : {0.0, 77.0}) {
    const Value v = at(*link, deg(70, turn), deg(65, turn + 175));
    const double a = angle_between(deg(70, 180), deg(65, 175));
    REQUIRE(v.origin == Origin::kExtrapolated);
    REQUIRE(v.f == Approx(std::exp(-a * a / 0.05)).epsilon(1e-9));
  }
  // Straight back from 70 deg turns 10 deg below the horizon of 60 deg: asked on the horizon.
  const double horizon = angle_between(deg(60, 180), deg(90, 0));
  REQUIRE(at(*link, deg(70, 0), deg(89, 0)).f == Approx(std::exp(-horizon * horizon / 0.05)).epsilon(1e-6));
}

TEST_CASE("Below the first incidence the light keeps its azimuth, along the normal the data's") {
  const auto data = function([](double theta_i, double, double phi) { return theta_i + std::cos(phi); });
  const auto link =
      ClampExtrapolator::make(
          data, {.axis = Edge::Axis::kThetaI, .at = radians(15), .upper = false, .azimuth = radians(90)})
          .value();
  REQUIRE(at(*link, deg(16, 0), deg(40, 0)).origin == Origin::kMeasured);
  REQUIRE(at(*link, deg(10, 0), deg(45, 180)).origin == Origin::kExtrapolated);
  REQUIRE(at(*link, deg(10, 0), deg(45, 180)).f == Approx(radians(15) - 1));
  REQUIRE(at(*link, deg(0, 0), deg(45, 270)).f == Approx(radians(15) - 1));
}

TEST_CASE("Where the edge has no value there is none beyond it") {
  GridBrdf::Content content = grid_content({20}, [](double, double, double) { return 1.0; });
  for (std::size_t row : {15U, 14U}) {
    content.parts[0].origin[row * 72 + 10] = Origin::kInvalid;
  }
  const auto grid = std::make_shared<const GridBrdf>(GridBrdf::make(std::move(content)).value());
  for (const HorizonMode mode : {HorizonMode::kLinear, HorizonMode::kConstant, HorizonMode::kBezier}) {
    const auto link = HorizonExtrapolator::make(grid, mode, radians(75)).value();
    REQUIRE(at(*link, deg(20, 0), deg(80, 50)).origin == Origin::kInvalid);
    REQUIRE(at(*link, deg(20, 0), deg(80, 50)).f == 0);
    REQUIRE(at(*link, deg(20, 0), deg(80, 60)).origin == Origin::kExtrapolated);
  }
}

TEST_CASE("Uncertainties follow the value through every extrapolator") {
  const auto data = function([](double, double, double) { return 2.0; }, 0.1, 0.4);
  const Direction i = deg(20, 0);
  const auto linear = HorizonExtrapolator::make(data, HorizonMode::kLinear, radians(75)).value();
  REQUIRE(sigma_at(*linear, i, deg(80, 0)).random == Approx(0.1 * 2 / 3));
  REQUIRE(sigma_at(*linear, i, deg(80, 0)).systematic == Approx(0.4 * 2 / 3));
  REQUIRE(sigma_at(*linear, i, deg(70, 0)).random == Approx(0.1));
  // Flat at the edge: the middle point is as high, f = 2 ((1-t)^2 + 2t(1-t)) at t = 1/3.
  const auto bezier = HorizonExtrapolator::make(data, HorizonMode::kBezier, radians(75)).value();
  REQUIRE(sigma_at(*bezier, i, deg(80, 0)).random == Approx(0.1 * 8.0 / 9));
  const auto none = HorizonExtrapolator::make(data, HorizonMode::kNone, radians(75)).value();
  REQUIRE_FALSE(sigma_at(*none, i, deg(80, 0)).known);
  const auto gradient = GradientExtrapolator::make(data, {.axis = Edge::Axis::kThetaI, .at = radians(60)},
                                                   {.p = 0.5, .m = radians(10), .l = 0.5})
                            .value();
  REQUIRE(sigma_at(*gradient, deg(65, 0), deg(10, 0)).systematic == Approx(0.4 * 0.75));
  const auto silent = HorizonExtrapolator::make(function([](double, double, double) { return 2.0; }),
                                                HorizonMode::kLinear, radians(75))
                          .value();
  REQUIRE_FALSE(sigma_at(*silent, i, deg(80, 0)).known);
}

TEST_CASE("Between incidences random uncertainties add in quadrature, systematic ones linearly") {
  GridBrdf::Content content = grid_content({0, 20}, [](double, double, double) { return 1.0; });
  add_uncertainty(content, 0.3F, 0.5F);
  const auto grid = std::make_shared<const GridBrdf>(GridBrdf::make(std::move(content)).value());
  for (const IncidenceMode mode :
       {IncidenceMode::kPlain, IncidenceMode::kSpecular, IncidenceMode::kDistorted}) {
    const auto link = IncidenceInterpolator::make(grid, mode).value();
    const Sigma between = sigma_at(*link, deg(5, 0), deg(30, 40));
    REQUIRE(between.known);
    REQUIRE(between.random == Approx(0.3 * std::hypot(0.75, 0.25)));
    REQUIRE(between.systematic == Approx(0.5));
    REQUIRE(sigma_at(*link, deg(20, 0), deg(30, 40)).random == Approx(0.3));
  }
}

TEST_CASE("At a measured incidence every way between incidences gives the data itself") {
  const auto grid = std::make_shared<const GridBrdf>(
      GridBrdf::make(grid_content({0, 20, 40, 60}, [](double theta_i, double theta_o, double phi) {
        return 1 + theta_i + std::sin(theta_o) * std::cos(phi);
      })).value());
  for (const IncidenceMode mode :
       {IncidenceMode::kPlain, IncidenceMode::kSpecular, IncidenceMode::kSpecularSpline,
        IncidenceMode::kSpecularSplineZero, IncidenceMode::kDistorted}) {
    const auto link = IncidenceInterpolator::make(grid, mode).value();
    for (const double theta_i : {0.0, 20.0, 40.0, 60.0}) {
      for (const double turn : {0.0, 130.0}) {
        const Value v = at(*link, deg(theta_i, turn), deg(45, turn + 100));
        const Value own = at(*grid, deg(theta_i, turn), deg(45, turn + 100));
        REQUIRE(v.origin == Origin::kMeasured);
        REQUIRE(v.f == Approx(own.f).epsilon(1e-9));
      }
    }
    REQUIRE(at(*link, deg(30, 0), deg(45, 100)).origin == Origin::kInterpolated);
    REQUIRE(at(*link, deg(61, 0), deg(45, 100)).origin == Origin::kExtrapolated);
  }
}

TEST_CASE("What does not suit an incidence interpolator or an extrapolator is refused") {
  const auto data = function([](double, double, double) { return 1.0; });
  REQUIRE_FALSE(IncidenceInterpolator::make(data, IncidenceMode::kPlain).has_value());
  REQUIRE_FALSE(
      IncidenceInterpolator::make(data, IncidenceMode::kPlain, {.theta_i = {0.3, 0.1}, .azimuth = {}})
          .has_value());
  REQUIRE_FALSE(
      IncidenceInterpolator::make(data, IncidenceMode::kPlain, {.theta_i = {0.3, 1.6}, .azimuth = {}})
          .has_value());
  for (const double from : {0.5, 90.0, 120.0, -5.0, std::nan("")}) {
    REQUIRE_FALSE(HorizonExtrapolator::make(data, HorizonMode::kLinear, radians(from)).has_value());
  }
  REQUIRE_FALSE(ClampExtrapolator::make(data, {.axis = Edge::Axis::kThetaO, .at = 0}).has_value());
  const Edge edge{.axis = Edge::Axis::kThetaO, .at = 1};
  using Options = GradientExtrapolator::Options;
  for (const Options& bad :
       {Options{.p = -1}, Options{.m = 0}, Options{.l = 1.5}, Options{.l = std::nan("")}}) {
    REQUIRE_FALSE(GradientExtrapolator::make(data, edge, bad).has_value());
  }
}
