#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "host_sdk/reflectance/models/model_spec.h"

using namespace scatter::reflectance;

namespace {

double eval_red(const Brdf& model, const Direction& i, const Direction& o) {
  std::array<double, 3> f{};
  (void)model.eval(i, o, f);
  return f[0];
}

/// Some directions over the hemisphere, without a preferred one (golden-angle spiral).
std::vector<Direction> spiral(std::size_t count) {
  std::vector<Direction> out;
  for (std::size_t k = 0; k < count; ++k) {
    const double z = (static_cast<double>(k) + 0.5) / static_cast<double>(count);
    out.push_back(from_spherical(std::acos(z), 2.399963229728653 * static_cast<double>(k)));
  }
  return out;
}

}  // namespace

TEST_CASE("Lambert is albedo over pi at every pair of upper directions") {
  const auto model = make_model("lambertian:0.5/0.25/1").value();
  for (const Direction& i : spiral(20)) {
    for (const Direction& o : spiral(20)) {
      std::array<double, 3> f{};
      REQUIRE(model->eval(i, o, f) == Origin::kMeasured);
      REQUIRE(f[0] == Approx(0.5 / kPi).epsilon(1e-14));
      REQUIRE(f[1] == Approx(0.25 / kPi).epsilon(1e-14));
      REQUIRE(f[2] == Approx(1 / kPi).epsilon(1e-14));
    }
  }
}

TEST_CASE("GGX equals Walter's formula written with tangents") {
  // PROVES: reflectance.md 2, row GGX.
  const double alpha = 0.3;
  const double f0 = 0.04;
  const auto model = make_model("ggx:alpha=0.3,f0=0.04,albedo=0.2").value();
  for (const Direction& i : spiral(31)) {
    for (const Direction& o : spiral(29)) {
      const Direction h = normalized({i.x + o.x, i.y + o.y, i.z + o.z});
      const double theta_h = theta_of(h);
      const double tan_h = std::tan(theta_h);
      const double d =
          alpha * alpha / (kPi * std::pow(std::cos(theta_h), 4) * std::pow(alpha * alpha + tan_h * tan_h, 2));
      const auto g1 = [&](const Direction& w) {
        const double t = std::tan(theta_of(w));
        return 2 / (1 + std::sqrt(1 + alpha * alpha * t * t));
      };
      const double fresnel = f0 + (1 - f0) * std::pow(1 - dot(i, h), 5);
      const double expected = fresnel * g1(i) * g1(o) * d / (4 * i.z * o.z) + 0.2 / kPi;
      REQUIRE(eval_red(*model, i, o) == Approx(expected).epsilon(1e-9));
    }
  }
}

TEST_CASE("Models are reciprocal and never negative") {
  for (const char* spec : {"lambertian:0.5", "ggx:alpha=0.05,f0=0.9", "ggx:alpha=0.6,f0=0.04,albedo=0.3"}) {
    const auto model = make_model(spec).value();
    for (const Direction& i : spiral(40)) {
      for (const Direction& o : spiral(37)) {
        const double f = eval_red(*model, i, o);
        REQUIRE(f >= 0);
        REQUIRE(f == Approx(eval_red(*model, o, i)).epsilon(1e-12));
      }
    }
  }
}

TEST_CASE("Models give nothing for a direction on the wrong side") {
  std::array<double, 3> f{1, 1, 1};
  const Direction up{0, 0, 1};
  const Direction down{0, 0, -1};
  for (const char* spec : {"lambertian:0.5", "ggx:alpha=0.3"}) {
    const auto model = make_model(spec).value();
    REQUIRE(model->type() == ScatterType::kBrdf);
    for (const auto& [i, o] : {std::pair(up, down), std::pair(down, up), std::pair(down, down)}) {
      f.fill(1);
      REQUIRE(model->eval(i, o, f) == Origin::kInvalid);
      REQUIRE(f == std::array<double, 3>{});
    }
  }
  const auto film = make_model("film:transmittance=0.6,haze=0.3").value();
  REQUIRE(film->type() == ScatterType::kBtdf);
  REQUIRE(film->eval(up, up, f) == Origin::kInvalid);
}

TEST_CASE("A film splits its transmittance between haze and the straight direction") {
  const auto film = make_model("film:transmittance=0.6,haze=0.3").value();
  const Direction i = from_spherical(radians(20), 1);
  std::array<double, 3> f{};
  REQUIRE(film->eval(i, {0.6, 0, -0.8}, f) == Origin::kMeasured);
  REQUIRE(f[1] == Approx(0.6 * 0.3 / kPi));
  std::array<double, 3> straight{};
  REQUIRE(film->dirac(i, straight));
  REQUIRE(straight[2] == Approx(0.6 * 0.7));
  REQUIRE_FALSE(make_model("lambertian:0.5").value()->dirac(i, straight));
}

TEST_CASE("A batch equals single evaluations") {
  const auto directions = spiral(50);
  for (const char* spec : {"lambertian:0.5", "ggx:alpha=0.3/0.2/0.1,albedo=0.1"}) {
    const auto model = make_model(spec).value();
    const Direction i = from_spherical(0.5, 0.2);
    std::vector<double> all(3 * directions.size());
    std::vector<Origin> origin(directions.size());
    model->eval_batch(i, directions, all, origin);
    for (std::size_t k = 0; k < directions.size(); ++k) {
      std::array<double, 3> f{};
      REQUIRE(model->eval(i, directions[k], f) == origin[k]);
      for (std::size_t c = 0; c < 3; ++c) {
        REQUIRE(all[3 * k + c] == Approx(f[c]).epsilon(1e-13));
      }
    }
  }
}
