#include "host_sdk/reflectance/specular_grid_brdf.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

using namespace scatter::reflectance;

namespace {

SpecularGridBrdf::Content axes(bool plane_symmetric) {
  SpecularGridBrdf::Content content;
  content.plane_symmetric = plane_symmetric;
  content.rotation = {0};
  content.theta_i = {radians(20), radians(40)};
  for (int k = 0; k <= (plane_symmetric ? 18 : 35); ++k) {
    content.azimuth.push_back(radians(10.0 * k));
  }
  for (int k = 0; k <= 8; ++k) {
    content.radial.push_back(radians(10.0 * k));
  }
  return content;
}

SpecularGridBrdf fill(SpecularGridBrdf::Content content,
                      const std::function<double(double a, double psi, double rho)>& f) {
  auto& plane = content.f_per_sr.emplace_back();
  for (const double q : content.rotation) {
    for (const double a : content.theta_i) {
      for (const double psi : content.azimuth) {
        for (const double rho : content.radial) {
          plane.push_back(static_cast<float>(f(a, psi, rho) + q));
        }
      }
    }
  }
  return SpecularGridBrdf::make(std::move(content)).value();
}

struct Value {
  double f = -1;
  Origin origin = Origin::kInvalid;
};

Value at(const Brdf& brdf, const Direction& i, const Direction& o) {
  Value v;
  v.origin = brdf.eval(i, o, std::span(&v.f, 1));
  return v;
}

/// Direction of (rho, psi) for light at (a, phi_i), by the formulas of formats.md 1.
Direction outgoing(double a, double phi_i, double psi, double rho) {
  const double x = std::sin(rho) * std::cos(psi);
  const double y = std::sin(rho) * std::sin(psi);
  const double z = std::cos(rho);
  const Direction local{x * std::cos(a) - z * std::sin(a), y, x * std::sin(a) + z * std::cos(a)};
  return {local.x * std::cos(phi_i) - local.y * std::sin(phi_i),
          local.x * std::sin(phi_i) + local.y * std::cos(phi_i), local.z};
}

double linear(double a, double psi, double rho) {
  return 1 + a + 0.1 * psi + 0.3 * rho;
}

}  // namespace

TEST_CASE("Radial 0 is the mirror direction and azimuth 0 points towards the normal") {
  // PROVES: formats.md 1, geometry.
  const auto grid =
      fill(axes(false), [](double, double psi, double rho) { return rho * (2 + std::cos(psi)); });
  const double a = radians(40);
  const Direction i = from_spherical(a, 1.0);
  REQUIRE(at(grid, i, mirrored(i)).f == Approx(0).margin(1e-7));
  // 30 deg towards the normal from a mirror direction at 40 deg: 10 deg from the normal.
  REQUIRE(at(grid, i, from_spherical(radians(10), 1.0 + kPi)).f == Approx(3 * radians(30)).epsilon(1e-6));
  // Away from the normal.
  REQUIRE(at(grid, i, from_spherical(radians(60), 1.0 + kPi)).f == Approx(1 * radians(20)).epsilon(1e-6));
}

TEST_CASE("A specular grid is bilinear at its incidences, for any azimuth of the light") {
  const auto grid = fill(axes(true), linear);
  for (const double phi_i : {0.0, 1.0, 4.0}) {
    for (const double psi : {0.1, 1.2345, 3.0}) {
      for (const double rho : {0.05, 0.4, 0.777}) {
        const double a = radians(20);
        const Value v = at(grid, from_spherical(a, phi_i), outgoing(a, phi_i, psi, rho));
        REQUIRE(v.f == Approx(linear(a, psi, rho)).epsilon(1e-6));
        REQUIRE(v.origin == Origin::kMeasured);
        // The mirrored half.
        REQUIRE(at(grid, from_spherical(a, phi_i), outgoing(a, phi_i, -psi, rho)).f ==
                Approx(v.f).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("Between incidences the same offset from the mirror direction is interpolated") {
  const auto grid = fill(axes(true), linear);
  const double a = radians(25);
  const Value v = at(grid, from_spherical(a, 0), outgoing(a, 0, 2, 0.3));
  REQUIRE(v.f == Approx(linear(a, 2, 0.3)).epsilon(1e-6));
  REQUIRE(v.origin == Origin::kInterpolated);
}

TEST_CASE("Azimuths wrap from the last to the first") {
  const auto grid = fill(axes(false), [](double, double psi, double) { return std::cos(psi); });
  const double a = radians(20);
  const Value v = at(grid, from_spherical(a, 0), outgoing(a, 0, radians(355), 0.3));
  REQUIRE(v.f == Approx((std::cos(radians(350)) + 1) / 2).epsilon(1e-6));
  REQUIRE(v.origin == Origin::kMeasured);
}

TEST_CASE("A specular grid tells what it did not measure") {
  const auto grid = fill(axes(true), linear);
  const auto origin = [&](double a_deg, double psi_deg, double rho_deg) {
    const double a = radians(a_deg);
    return at(grid, from_spherical(a, 0), outgoing(a, 0, radians(psi_deg), radians(rho_deg))).origin;
  };
  REQUIRE(origin(20, 90, 30) == Origin::kMeasured);
  REQUIRE(origin(10, 90, 30) == Origin::kExtrapolated);
  REQUIRE(origin(50, 90, 30) == Origin::kExtrapolated);
  REQUIRE(origin(20, 0, 85) == Origin::kExtrapolated);  // beyond the last radial
  // Mirror direction at 40 deg: 49 deg further is above the horizon, the node at 60 deg is not.
  REQUIRE(origin(40, 180, 49) == Origin::kMeasured);
  REQUIRE(origin(40, 175, 49.9) == Origin::kMeasured);
  REQUIRE(origin(20, 180, 65) == Origin::kMeasured);
  REQUIRE(origin(20, 180, 69.9) == Origin::kMeasured);
  REQUIRE(origin(40, 180, 51) == Origin::kInvalid);
  const Value below = at(grid, from_spherical(0.3, 0), {0, 0, -1});
  REQUIRE(below.origin == Origin::kInvalid);
  REQUIRE(below.f == 0);
}

TEST_CASE("A cell that reaches below the horizon gives extrapolated values") {
  SpecularGridBrdf::Content content = axes(true);
  content.theta_i = {radians(45)};
  const auto grid = fill(content, linear);
  const double a = radians(45);
  REQUIRE(at(grid, from_spherical(a, 0), outgoing(a, 0, kPi, radians(39))).origin == Origin::kMeasured);
  REQUIRE(at(grid, from_spherical(a, 0), outgoing(a, 0, kPi, radians(44))).origin == Origin::kExtrapolated);
}

TEST_CASE("Transmission grids are centred on the straight direction") {
  SpecularGridBrdf::Content content = axes(false);
  content.type = ScatterType::kBtdf;
  const auto grid = fill(content, [](double, double, double rho) { return 1 - rho; });
  const Direction i = from_spherical(radians(40), 0.5);
  const Direction straight{-i.x, -i.y, -i.z};
  REQUIRE(at(grid, i, straight).f == Approx(1).epsilon(1e-6));
  REQUIRE(at(grid, i, mirrored(i)).origin == Origin::kInvalid);
}

TEST_CASE("Rotations are interpolated when at most 90 deg apart") {
  SpecularGridBrdf::Content content = axes(true);
  content.rotation = {0, kPi / 2};
  const auto grid = fill(content, [](double, double, double) { return 1; });
  const Direction o{0, 0, 1};
  const auto from = [&](double phi_deg) {
    return at(grid, from_spherical(radians(20), radians(phi_deg)), o);
  };
  REQUIRE(from(0).f == Approx(1));
  REQUIRE(from(30).f == Approx(1 + kPi / 6).epsilon(1e-6));
  REQUIRE(from(30).origin == Origin::kInterpolated);
  REQUIRE(from(180).origin == Origin::kExtrapolated);
  REQUIRE(from(181).f == Approx(1 + kPi / 2).epsilon(1e-6));
}

TEST_CASE("The integral of a constant is its closed form") {
  // Over the cap of radius 80 deg about a mirror direction at 0: pi sin^2 80.
  SpecularGridBrdf::Content content = axes(true);
  content.theta_i = {0};
  const auto grid = fill(content, [](double, double, double) { return 0.25; });
  const double s = std::sin(radians(80));
  // Midpoint steps of 1 deg: 2e-4.
  REQUIRE(grid.integral(0, 0, 0) == Approx(0.25 * kPi * s * s).epsilon(2e-4));
  REQUIRE(grid.integral(0, 0, 0, true) == Approx(0.25 * kPi).epsilon(2e-4));
  REQUIRE(grid.integral(0, 0, 0, false, false) ==
          Approx(0.25 * 2 * kPi * (1 - std::cos(radians(80)))).epsilon(2e-4));
  SpecularGridBrdf::Content tilted = axes(false);
  tilted.theta_i = {radians(40)};
  const auto whole = fill(tilted, [](double, double, double) { return 0.25; });
  REQUIRE(whole.integral(0, 0, 0, true) == Approx(0.25 * kPi).epsilon(1e-3));
}

TEST_CASE("A specular grid of wrong shape is refused") {
  const auto refused = [](const std::function<void(SpecularGridBrdf::Content&)>& spoil, const char* says) {
    SpecularGridBrdf::Content content = fill(axes(true), linear).content();
    spoil(content);
    const auto grid = SpecularGridBrdf::make(std::move(content));
    REQUIRE_FALSE(grid.has_value());
    CAPTURE(grid.error().what);
    REQUIRE(grid.error().what.find(says) != std::string::npos);
  };
  refused([](auto& c) { c.radial.clear(); }, "no scatter radial");
  refused([](auto& c) { c.azimuth.back() = radians(190); }, "expected 0..180");
  refused([](auto& c) { c.theta_i = {radians(40), radians(20)}; }, "ascending");
  refused([](auto& c) { c.theta_i = {radians(20), radians(90)}; },
          "angle of incidence 2 of 2 is 90 deg, expected 0..89.9999");
  refused([](auto& c) { c.f_per_sr[0].pop_back(); }, "expected 342");
  refused([](auto& c) { c.f_per_sr[0][3] = INFINITY; }, "finite");
  refused([](auto& c) { c.f_per_sr.clear(); }, "no channel");
  refused([](auto& c) { c.stated_total = {{0.1}}; }, "expected 2 per channel");
}
