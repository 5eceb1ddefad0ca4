// The fast ways to a grid's values against the slow one. `uncertainty` interpolates tap by tap with libm,
// so a grid whose uncertainties are its values tells what evaluation should give.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "host_sdk/reflectance/angle_simd-inl.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

using namespace scatter::reflectance;

namespace {

constexpr double kExact = 1e-9;  ///< eval and eval_batch, relative to values of about 1.
/// eval_pairs: 1e-6 rad of direction on the slopes of `value`, which are below 10 per rad.
constexpr double kFloat = 1e-5;

double value(const Direction& i, const Direction& o, std::size_t channel) {
  const double a = angle_between(mirrored(i), {o.x, o.y, std::abs(o.z)});
  return 1 + static_cast<double>(channel) + 0.3 * o.x * o.y + 0.2 * i.x + std::exp(-a * a / 0.1);
}

enum class Origins : std::uint8_t { kMeasured, kMixed };

Origin random_origin(Origins origins, std::mt19937_64& random) {
  if (origins == Origins::kMeasured) {
    return Origin::kMeasured;
  }
  const auto draw = random() % 20;
  return draw < 2   ? Origin::kInvalid
         : draw < 4 ? Origin::kInterpolated
         : draw < 6 ? Origin::kExtrapolated
                    : Origin::kMeasured;
}

struct Layout {
  ScatterType type = ScatterType::kBrdf;
  std::size_t channels = 3;
  std::size_t rows = 76;
  std::vector<double> theta_i_deg{0, 20, 40, 60};
  std::vector<double> phi_i_deg{0};  ///< More than one: that many rotations.
  Origins origins = Origins::kMeasured;
};

GridBrdf grid_of(const Layout& layout) {
  std::mt19937_64 random(7);
  GridBrdf::Content content;
  content.type = layout.type;
  content.channels = layout.channels;
  content.theta_count = layout.rows;
  for (const double phi_i : layout.phi_i_deg) {
    for (const double theta_i : layout.theta_i_deg) {
      GridPart part;
      part.rotation_rad = radians(phi_i - layout.phi_i_deg.front());
      part.theta_i = radians(theta_i);
      part.phi_i = radians(phi_i);
      const Direction i = from_spherical(part.theta_i, part.phi_i);
      part.f_per_sr.resize(layout.channels);
      for (std::size_t n = 0; n < layout.rows * 360; ++n) {
        const Direction o =
            from_spherical(radians(static_cast<double>(n / 360)), radians(static_cast<double>(n % 360)));
        part.origin.push_back(random_origin(layout.origins, random));
        for (std::size_t c = 0; c < layout.channels; ++c) {
          part.f_per_sr[c].push_back(part.origin.back() == Origin::kInvalid
                                         ? std::numeric_limits<float>::quiet_NaN()
                                         : static_cast<float>(value(i, o, c)));
        }
      }
      part.random_per_sr = part.systematic_per_sr = part.f_per_sr;
      content.parts.push_back(std::move(part));
    }
  }
  return GridBrdf::make(std::move(content)).value();
}

struct Queries {
  std::vector<Direction> omega_i;
  std::vector<Direction> omega_o;
};

/// Random pairs, and those where something special happens: the pole, the seam, nodes, the horizon,
/// the wrong side, incidences of the grid, light from the normal.
Queries queries(std::size_t count, ScatterType type, const std::vector<double>& theta_i_deg) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  Queries out;
  const auto pick = [&] { return static_cast<int>(random() % 8); };
  for (std::size_t k = 0; k < count; ++k) {
    double theta_i = unit(random) * kPi / 2 * 0.999;
    double phi_i = 2 * kPi * unit(random);
    if (const int special = pick(); special < 2) {
      theta_i = radians(theta_i_deg[random() % theta_i_deg.size()]);
      phi_i = special == 0 ? 0 : phi_i;
    } else if (special == 2) {
      theta_i = 0;
    }
    double theta_o = std::acos(unit(random));
    double phi_o = 2 * kPi * unit(random);
    switch (pick()) {
      case 0:
        theta_o = radians(std::round(degrees(theta_o)));
        break;
      case 1:
        theta_o = radians(std::round(degrees(theta_o)));
        phi_o = radians(std::round(degrees(phi_o)));
        break;
      case 2:
        phi_o = unit(random) < 0.5 ? 0 : -1e-12;
        break;
      case 3:
        theta_o = unit(random) < 0.5 ? unit(random) * 0.03 : 0;
        break;
      case 4:
        theta_o = kPi / 2 + (unit(random) - 0.5) * 0.01;
        break;
      default:
        break;
    }
    Direction o = from_spherical(theta_o, phi_o);
    o.z = type == ScatterType::kBtdf ? -o.z : o.z;
    out.omega_i.push_back(from_spherical(theta_i, phi_i));
    out.omega_o.push_back(o);
  }
  return out;
}

/// Whether a direction at most 1e-6 rad from omega_o has this origin.
bool near(const Brdf& brdf, const Direction& omega_i, const Direction& omega_o, Origin wanted) {
  std::vector<double> f(brdf.channels());
  for (double turn = 0; turn < 2 * kPi; turn += kPi / 8) {
    const double x = 1e-6 * std::cos(turn);
    const double y = 1e-6 * std::sin(turn);
    const double theta = theta_of(omega_o) + x;
    const double phi = phi_of(omega_o) + y / std::max(std::hypot(omega_o.x, omega_o.y), 1e-6);
    if (brdf.eval(omega_i, from_spherical(theta, phi), f) == wanted) {
      return true;
    }
  }
  return false;
}

/// Every fast way gives the slow way's answer. `slow` returns false where there is no value.
void agree(const Brdf& brdf, const Queries& q,
           const std::function<bool(const Direction&, const Direction&, std::span<double>)>& slow) {
  const std::size_t n = brdf.channels();
  std::vector<double> pairs(q.omega_o.size() * n, -1);
  std::vector<Origin> pairs_origin(q.omega_o.size());
  brdf.eval_pairs(q.omega_i, q.omega_o, pairs, pairs_origin);
  std::vector<double> one(n);
  std::vector<double> expected(n);
  std::vector<double> batch(n);
  std::size_t wrong_origin = 0;
  std::size_t moved_origin = 0;
  double worst_one = 0;
  double worst_batch = 0;
  double worst_pairs = 0;
  for (std::size_t k = 0; k < q.omega_o.size(); ++k) {
    const Origin origin = brdf.eval(q.omega_i[k], q.omega_o[k], one);
    Origin batch_origin = Origin::kInvalid;
    brdf.eval_batch(q.omega_i[k], {&q.omega_o[k], 1}, batch, {&batch_origin, 1});
    const bool known = slow(q.omega_i[k], q.omega_o[k], expected);
    wrong_origin += known == (origin == Origin::kInvalid) || origin != batch_origin;
    if (origin != pairs_origin[k]) {
      // Right when it is the answer for a direction nearby; then the value is that one's too.
      const bool nearby = near(brdf, q.omega_i[k], q.omega_o[k], pairs_origin[k]);
      wrong_origin += nearby ? 0 : 1;
      moved_origin += nearby ? 1 : 0;
      continue;
    }
    for (std::size_t c = 0; c < n; ++c) {
      const double right = known ? expected[c] : 0;
      worst_one = std::max(worst_one, std::abs(one[c] - right));
      worst_batch = std::max(worst_batch, std::abs(batch[c] - right));
      worst_pairs = std::max(worst_pairs, std::abs(pairs[k * n + c] - right));
    }
  }
  CHECK(wrong_origin == 0);
  CHECK(moved_origin <= q.omega_o.size() / 1000);
  CHECK(worst_one < kExact * static_cast<double>(n));
  CHECK(worst_batch < kExact * static_cast<double>(n));
  CHECK(worst_pairs < kFloat);
}

void agree(const GridBrdf& grid, const Queries& q) {
  agree(grid, q, [&](const Direction& i, const Direction& o, std::span<double> out) {
    std::vector<double> systematic(out.size());
    return grid.uncertainty(i, o, out, systematic);
  });
}

}  // namespace

TEST_CASE("Every way to evaluate a grid gives the same value and origin") {
  const auto check = [](const Layout& layout, std::size_t count) {
    CAPTURE(layout.channels, layout.rows, layout.theta_i_deg.size());
    agree(grid_of(layout), queries(count, layout.type, layout.theta_i_deg));
  };
  SECTION("a million pairs on a measured grid") {
    check({}, 1'000'000);
  }
  SECTION("holes and origins of every kind") {
    check({.origins = Origins::kMixed}, 300'000);
  }
  SECTION("to the horizon") {
    check({.rows = 91, .origins = Origins::kMixed}, 200'000);
  }
  SECTION("transmission") {
    check({.type = ScatterType::kBtdf, .origins = Origins::kMixed}, 100'000);
  }
  SECTION("one incidence") {
    check({.theta_i_deg = {10}}, 100'000);
  }
  SECTION("more incidences than a register has lanes") {
    std::vector<double> many;
    for (int k = 0; k < 21; ++k) {
      many.push_back(4.0 * k);
    }
    check({.channels = 1, .theta_i_deg = many, .origins = Origins::kMixed}, 100'000);
  }
  SECTION("light of its own azimuth") {
    check({.phi_i_deg = {123}, .origins = Origins::kMixed}, 100'000);
  }
  SECTION("rotations") {
    check({.phi_i_deg = {0, 60, 120}, .origins = Origins::kMixed}, 100'000);
  }
  SECTION("other numbers of channels") {
    for (const std::size_t channels : {1, 2, 4, 7}) {
      check({.channels = channels, .origins = Origins::kMixed}, 50'000);
    }
  }
}

TEST_CASE("The last values of a batch stay within their places") {
  const GridBrdf grid = grid_of({});
  const Queries q = queries(200, ScatterType::kBrdf, {20});
  for (const std::size_t count : {0, 1, 2, 15, 16, 17, 63, 64, 65, 129}) {
    std::vector<double> f(3 * count + 4, -7);
    grid.eval_pairs(std::span(q.omega_i).first(count), std::span(q.omega_o).first(count),
                    std::span(f).first(3 * count), {});
    for (std::size_t k = 3 * count; k < f.size(); ++k) {
      REQUIRE(f[k] == -7);
    }
    std::vector<double> g(3 * count + 4, -7);
    grid.eval_batch(q.omega_i[0], std::span(q.omega_o).first(count), std::span(g).first(3 * count), {});
    for (std::size_t k = 3 * count; k < g.size(); ++k) {
      REQUIRE(g[k] == -7);
    }
  }
}

TEST_CASE("What is no direction has no value") {
  const GridBrdf grid = grid_of({});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const Direction good = from_spherical(0.5, 1);
  const std::array<Direction, 6> bad{Direction{nan, 0, 1},    Direction{0, nan, 1},
                                     Direction{0, 0, nan},    Direction{0, 0, 0},
                                     Direction{0.1, 0.2, -1}, Direction{-inf, inf, -inf}};
  for (const Direction& w : bad) {
    for (const auto& [i, o] : {std::pair(w, good), std::pair(good, w)}) {
      if (o.z == 0 && i.z > 0) {
        continue;  // A zero vector lies on the horizon; any value will do that does no harm.
      }
      std::array<double, 3> f{-1, -1, -1};
      CHECK(grid.eval(i, o, f) == Origin::kInvalid);
      CHECK(f == std::array<double, 3>{});
      Origin origin = Origin::kMeasured;
      f.fill(-1);
      grid.eval_pairs({&i, 1}, {&o, 1}, f, {&origin, 1});
      CHECK(origin == Origin::kInvalid);
      CHECK(f == std::array<double, 3>{});
      origin = Origin::kMeasured;
      f.fill(-1);
      grid.eval_batch(i, {&o, 1}, f, {&origin, 1});
      CHECK(origin == Origin::kInvalid);
      CHECK(f == std::array<double, 3>{});
    }
  }
}

TEST_CASE("Every way to evaluate a specular grid gives the same value and origin") {
  const auto check = [](bool symmetric, bool equal_steps, bool repeated, Origins origins,
                        std::size_t rotations, ScatterType type, double first_radial) {
    std::mt19937_64 random(11);
    SpecularGridBrdf::Content content;
    content.type = type;
    content.plane_symmetric = symmetric;
    for (std::size_t k = 0; k < rotations; ++k) {
      content.rotation.push_back(radians(50.0 * static_cast<double>(k)));
    }
    content.theta_i = {0, radians(20), radians(45), radians(70)};
    const int last_azimuth = symmetric ? 180 : repeated ? 360 : 355;
    for (int k = 0; k <= last_azimuth; k += 5) {
      content.azimuth.push_back(radians(equal_steps || k % 10 == 0 ? k : k + 1));
    }
    for (int k = 0; k <= 40; ++k) {
      content.radial.push_back(radians(equal_steps ? first_radial + 2 * k : 80.0 * k * k / 1600));
    }
    content.f_per_sr.resize(3);
    for (const double q : content.rotation) {
      for (const double a : content.theta_i) {
        for (const double psi : content.azimuth) {
          for (const double rho : content.radial) {
            for (std::size_t c = 0; c < 3; ++c) {
              content.f_per_sr[c].push_back(static_cast<float>(
                  1 + 0.2 * q + 0.1 * a + std::exp(-5 * rho * rho) + 0.3 * std::sin(rho) * std::cos(psi)));
            }
            if (origins == Origins::kMixed) {
              content.origin.push_back(random_origin(origins, random));
            }
          }
        }
      }
    }
    content.sigma_per_sr = content.f_per_sr;
    const SpecularGridBrdf grid = SpecularGridBrdf::make(std::move(content)).value();
    CAPTURE(symmetric, equal_steps, repeated, rotations);
    agree(grid, queries(60'000, type, {0, 20, 45, 70}),
          [&](const Direction& i, const Direction& o, std::span<double> out) {
            std::vector<double> none(out.size());
            return grid.uncertainty(i, o, none, out);
          });
  };
  const auto brdf = ScatterType::kBrdf;
  for (const Origins origins : {Origins::kMeasured, Origins::kMixed}) {
    check(true, true, false, origins, 1, brdf, 0);
    check(true, false, false, origins, 1, brdf, 0);
    check(false, true, false, origins, 1, brdf, 0);
    check(false, false, false, origins, 1, brdf, 0);
    check(false, true, true, origins, 1, brdf, 0);
    check(false, true, false, origins, 3, brdf, 0);
    check(true, true, false, origins, 1, ScatterType::kBtdf, 0);
    check(true, true, false, origins, 1, brdf, 4);
  }
}

TEST_CASE("Angles by polynomial are those of libm") {
  namespace simd = HWY_NAMESPACE;
  namespace hn = hwy::HWY_NAMESPACE;
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  double worst = 0;
  double worst_float = 0;
  const hn::CappedTag<double, 1> d;
  const hn::CappedTag<float, 1> s;
  for (int k = 0; k < 1'000'000; ++k) {
    double y = unit(random);
    double x = unit(random);
    if (k % 4 == 0) {
      y *= std::pow(10, 9 * unit(random) - 9);
    } else if (k % 4 == 1) {
      x *= std::pow(10, 9 * unit(random) - 9);
    }
    const auto turned = [](double angle) { return angle < 0 ? angle + 2 * kPi : angle; };
    worst = std::max(worst, std::abs(hn::GetLane(simd::full_angle(d, hn::Set(d, y), hn::Set(d, x))) -
                                     turned(std::atan2(y, x))));
    const auto fy = static_cast<float>(y);
    const auto fx = static_cast<float>(x);
    const double exact = turned(std::atan2(static_cast<double>(fy), static_cast<double>(fx)));
    worst_float = std::max(
        worst_float,
        std::abs(static_cast<double>(hn::GetLane(simd::full_angle(s, hn::Set(s, fy), hn::Set(s, fx)))) -
                 exact));
  }
  CHECK(worst < 1e-12);
  CHECK(worst_float < 5e-7);
  CHECK(hn::GetLane(simd::full_angle(d, hn::Zero(d), hn::Zero(d))) == 0);
  CHECK(hn::GetLane(simd::full_angle(d, hn::Zero(d), hn::Set(d, 1.0))) == 0);
  CHECK(hn::GetLane(simd::full_angle(d, hn::Zero(d), hn::Set(d, -1.0))) == Approx(kPi).epsilon(1e-15));
}
