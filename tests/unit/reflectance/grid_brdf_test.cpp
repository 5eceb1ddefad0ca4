#include "host_sdk/reflectance/grid_brdf.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

using namespace scatter::reflectance;

namespace {

using Function = std::function<double(double theta_i, double theta_o, double phi_o)>;

GridPart part_of(const GridBrdf::Content& content, double theta_i_deg, double phi_i_deg,
                 const Function& value) {
  GridPart part;
  part.theta_i = radians(theta_i_deg);
  part.phi_i = radians(phi_i_deg);
  const std::size_t nodes = content.theta_count * content.phi_count;
  part.origin.assign(nodes, Origin::kMeasured);
  for (std::size_t c = 0; c < content.channels; ++c) {
    auto& plane = part.f_per_sr.emplace_back(nodes);
    for (std::size_t n = 0; n < nodes; ++n) {
      const double theta_o = static_cast<double>(n / content.phi_count) * content.theta_step;
      const double phi_o = static_cast<double>(n % content.phi_count) * content.phi_step;
      plane[n] = static_cast<float>(value(part.theta_i, theta_o, phi_o) * (1.0 + static_cast<double>(c)));
    }
  }
  return part;
}

GridBrdf grid_of(std::initializer_list<double> theta_i_deg, const Function& value,
                 ScatterType type = ScatterType::kBrdf) {
  GridBrdf::Content content;
  content.type = type;
  content.channels = 1;
  for (const double theta : theta_i_deg) {
    content.parts.push_back(part_of(content, theta, 0, value));
  }
  return GridBrdf::make(std::move(content)).value();
}

double smooth(double theta_i, double theta_o, double phi_o) {
  return 0.2 + 0.1 * theta_i + std::sin(theta_o) * (0.1 * std::cos(phi_o) + 0.05 * std::sin(2 * phi_o));
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

}  // namespace

TEST_CASE("Solid angles of a grid to the horizon add up to the hemisphere") {
  GridBrdf::Content content;
  content.channels = 1;
  content.theta_count = 91;
  content.parts.push_back(part_of(content, 0, 0, smooth));
  const GridBrdf grid = GridBrdf::make(std::move(content)).value();
  double total = 0;
  double projected = 0;
  for (std::size_t n = 0; n < 91 * 360; ++n) {
    total += grid.solid_angle_sr(n);
    projected += grid.solid_angle_sr(n) * grid.omega_o(n).z;
  }
  REQUIRE(total == Approx(2 * kPi).epsilon(1e-12));
  // Midpoint rule with cells of 1 deg: relative error about step^2 / 24.
  REQUIRE(projected == Approx(kPi).epsilon(2e-4));
}

TEST_CASE("A node's direction gives the node's value and origin") {
  GridBrdf grid = grid_of({0, 20, 40, 60}, smooth);
  for (std::size_t p = 0; p < 4; ++p) {
    for (std::size_t n = 360; n < 76 * 360; n += 7) {
      const Value v = at(grid, grid.omega_i(p), grid.omega_o(n));
      REQUIRE(v.origin == Origin::kMeasured);
      REQUIRE(v.f == static_cast<double>(grid.content().parts[p].f_per_sr[0][n]));
    }
  }
}

TEST_CASE("Between nodes the value is bilinear across the seam at 360 deg") {
  const GridBrdf grid = grid_of({20}, smooth);
  const double phi = radians(359.5);
  const double theta = radians(30.25);
  const auto node = [&](double t, double p) { return smooth(radians(20), radians(t), radians(p)); };
  const double expected =
      0.5 * (0.75 * node(30, 359) + 0.25 * node(31, 359)) + 0.5 * (0.75 * node(30, 0) + 0.25 * node(31, 0));
  const Value v = at(grid, from_spherical(radians(20), 0), from_spherical(theta, phi));
  REQUIRE(v.origin == Origin::kMeasured);
  REQUIRE(v.f == Approx(expected).epsilon(1e-6));
}

TEST_CASE("At the pole every azimuth gives the same value") {
  const GridBrdf grid = grid_of({20}, smooth);
  const double pole = at(grid, grid.omega_i(0), {0, 0, 1}).f;
  REQUIRE(pole == Approx(smooth(radians(20), 0, 0)).epsilon(1e-6));
  for (double phi = 0; phi < 6.2; phi += 0.31) {
    REQUIRE(at(grid, grid.omega_i(0), from_spherical(1e-9, phi)).f == pole);
  }
}

TEST_CASE("An isotropic sample is turned until the light's azimuth fits") {
  const GridBrdf grid = grid_of({20, 40}, smooth);
  for (const double turn : {0.3, 2.0, 5.9}) {
    for (const double theta_i : {20.0, 33.0}) {
      const Value straight = at(grid, from_spherical(radians(theta_i), 0), from_spherical(0.4, 1.1));
      const Value turned = at(grid, from_spherical(radians(theta_i), turn), from_spherical(0.4, 1.1 + turn));
      REQUIRE(turned.f == Approx(straight.f).epsilon(1e-12));
      REQUIRE(turned.origin == straight.origin);
    }
  }
}

TEST_CASE("Between incidences a lobe moves with the mirror direction") {
  // A lobe that depends only on the angle to the mirror direction is what this rule keeps.
  for (const ScatterType type : {ScatterType::kBrdf, ScatterType::kBtdf}) {
    const Function lobe = [](double theta_i, double theta_o, double phi_o) {
      const Direction mirror = from_spherical(theta_i, kPi);
      const double a = angle_between(mirror, from_spherical(theta_o, phi_o));
      return 1.0 + std::exp(-a * a / 0.05);
    };
    const GridBrdf grid = grid_of({20, 40}, lobe, type);
    const double theta_i = radians(30);
    for (const double theta_o : {20.0, 30.0, 35.0}) {
      Direction o = from_spherical(radians(theta_o), radians(175));
      if (type == ScatterType::kBtdf) {
        o.z = -o.z;
      }
      const Value v = at(grid, from_spherical(theta_i, 0), o);
      REQUIRE(v.origin == Origin::kInterpolated);
      // Bilinear sag of the lobe within a 1 deg cell: step^2/8 * second derivative (2/0.05) = 1.5e-3.
      REQUIRE(v.f == Approx(lobe(theta_i, radians(theta_o), radians(175))).margin(2e-3));
    }
  }
}

TEST_CASE("Outside the incidences or beyond the last row a value is extrapolated") {
  const GridBrdf grid = grid_of({20, 40}, smooth);
  const Direction o = from_spherical(radians(30), 1);
  REQUIRE(at(grid, from_spherical(radians(50), 0), o).origin == Origin::kExtrapolated);
  REQUIRE(at(grid, from_spherical(radians(10), 0), o).origin == Origin::kExtrapolated);
  const Value beyond = at(grid, from_spherical(radians(20), 0), from_spherical(radians(85), radians(40)));
  REQUIRE(beyond.origin == Origin::kExtrapolated);
  REQUIRE(beyond.f == Approx(smooth(radians(20), radians(75), radians(40))).epsilon(1e-6));
}

TEST_CASE("An invalid node spoils exactly the cells that touch it") {
  GridBrdf::Content content;
  content.channels = 1;
  content.parts.push_back(part_of(content, 20, 0, smooth));
  const std::size_t hole = 30 * 360 + 100;
  content.parts[0].origin[hole] = Origin::kInvalid;
  content.parts[0].f_per_sr[0][hole] = NAN;
  const GridBrdf grid = GridBrdf::make(std::move(content)).value();
  const Direction i = grid.omega_i(0);
  const auto near = [&](double theta, double phi) {
    return at(grid, i, from_spherical(radians(theta), radians(phi)));
  };
  for (const double d_theta : {-0.9, 0.0, 0.9}) {
    for (const double d_phi : {-0.9, 0.0, 0.9}) {
      const Value v = near(30 + d_theta, 100 + d_phi);
      REQUIRE(v.origin == Origin::kInvalid);
      REQUIRE(v.f == 0);
    }
  }
  REQUIRE(near(31, 100).origin == Origin::kMeasured);
  REQUIRE(near(29, 99.5).origin == Origin::kMeasured);
  REQUIRE(near(31.5, 100).origin == Origin::kMeasured);
}

TEST_CASE("Two sample rotations answer by azimuth, and only between rotations that are close") {
  GridBrdf::Content content;
  content.channels = 1;
  content.parts.push_back(part_of(content, 20, 0, [](double, double, double) { return 1.0; }));
  content.parts.push_back(part_of(content, 20, 90, [](double, double, double) { return 3.0; }));
  content.parts[1].rotation_rad = radians(90);
  const GridBrdf grid = GridBrdf::make(std::move(content)).value();
  const Direction o = from_spherical(0.3, 0);
  const auto from = [&](double phi_deg) {
    return at(grid, from_spherical(radians(20), radians(phi_deg)), o);
  };
  REQUIRE(from(0).f == 1.0);
  REQUIRE(from(0).origin == Origin::kMeasured);
  REQUIRE(from(90).f == 3.0);
  REQUIRE(from(30).f == Approx(1 + 2.0 / 3));
  REQUIRE(from(30).origin == Origin::kInterpolated);
  REQUIRE(from(120).f == 3.0);
  REQUIRE(from(120).origin == Origin::kExtrapolated);
  REQUIRE(from(350).f == 1.0);
  REQUIRE(from(350).origin == Origin::kExtrapolated);
}

TEST_CASE("Uncertainties are interpolated with the values and absent when a part has none") {
  GridBrdf::Content content;
  content.channels = 1;
  content.parts.push_back(part_of(content, 20, 0, smooth));
  content.parts[0].random_per_sr.assign(1, std::vector<float>(76 * 360, 0.25F));
  content.parts[0].systematic_per_sr.assign(1, std::vector<float>(76 * 360, 0.5F));
  double random = 0;
  double systematic = 0;
  const Direction o = from_spherical(0.333, 0.777);
  const GridBrdf with = GridBrdf::make(content).value();
  REQUIRE(with.uncertainty(with.omega_i(0), o, std::span(&random, 1), std::span(&systematic, 1)));
  REQUIRE(random == Approx(0.25));
  REQUIRE(systematic == Approx(0.5));
  content.parts[0].systematic_per_sr.clear();
  const GridBrdf without = GridBrdf::make(content).value();
  REQUIRE_FALSE(without.uncertainty(without.omega_i(0), o, std::span(&random, 1), std::span(&systematic, 1)));
}

TEST_CASE("A grid of wrong shape is refused with what was expected") {
  GridBrdf::Content good;
  good.channels = 1;
  good.parts.push_back(part_of(good, 20, 0, smooth));
  const auto refused = [&](const std::function<void(GridBrdf::Content&)>& spoil, const char* says) {
    GridBrdf::Content content = good;
    spoil(content);
    const auto grid = GridBrdf::make(std::move(content));
    REQUIRE_FALSE(grid.has_value());
    CAPTURE(grid.error().what);
    REQUIRE(grid.error().what.find(says) != std::string::npos);
  };
  REQUIRE(GridBrdf::make(good).has_value());
  refused([](auto& c) { c.parts.clear(); }, "0 parts");
  refused([](auto& c) { c.parts[0].f_per_sr[0].pop_back(); }, "27359 nodes, expected 27360");
  refused([](auto& c) { c.parts[0].origin.pop_back(); }, "expected 76 x 360 = 27360");
  refused([](auto& c) { c.parts[0].f_per_sr.clear(); }, "0 channels, expected 1");
  refused([](auto& c) { c.parts[0].f_per_sr[0][5] = NAN; }, "node 5 is nan");
  refused([](auto& c) { c.parts[0].pixels.assign(3, 1.0F); }, "3 pixel counts");
  refused([](auto& c) { c.parts[0].theta_i = radians(90); }, "theta_i 90");
  refused([](auto& c) { c.theta_step = radians(2); }, "expected at most 90");
  refused([](auto& c) { c.phi_step = radians(2); }, "expected 360");
  refused([](auto& c) { c.wavelengths_nm = {1, 2}; }, "2 wavelengths for 1 channels");
  refused([](auto& c) { c.parts[0].random_per_sr.assign(1, std::vector<float>(27360, -1.0F)); }, ">= 0");
}
