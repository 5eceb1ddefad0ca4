// Six checks of every model (reflectance.md 2), and chi-square of its draws.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "simulator/random/philox.h"
#include "tests/unit/reflectance_models/promise_table.h"
#include "tests/unit/reflectance_models/sphere_cells.h"

using namespace scatter::reflectance;
using namespace scatter::reflectance::test;

namespace {

/// Incidences; the azimuth is no special one.
constexpr std::array kTheta{0.0, radians(40), radians(75)};
constexpr double kPhi = 0.7;
constexpr std::size_t kDraws = 30'000;

/// Chance of one false alarm in all comparisons together, by Bonferroni.
constexpr double kSignificance = 0.01;

SampleInput random_input(std::uint32_t test, std::uint32_t draw) {
  const auto bits = scatter::simulator::philox4x32({draw, test, 0, 0}, {2026, 3});
  return {bits[0] * 0x1p-32, bits[1] * 0x1p-32, bits[2] * 0x1p-32};
}

/// Directions of one side without a preferred one (golden-angle spiral).
std::vector<Direction> spiral(std::size_t count, double side) {
  std::vector<Direction> out;
  for (std::size_t k = 0; k < count; ++k) {
    const double z = (static_cast<double>(k) + 0.5) / static_cast<double>(count);
    Direction w = from_spherical(std::acos(z), 2.399963229728653 * static_cast<double>(k));
    w.z *= side;
    out.push_back(w);
  }
  return out;
}

std::array<double, 3> eval(const Brdf& model, const Direction& i, const Direction& o) {
  std::array<double, 3> f{};
  (void)model.eval(i, o, f);
  return f;
}

double side_of(const Brdf& model) {
  return model.type() == ScatterType::kBtdf ? -1 : 1;
}

std::shared_ptr<const SampledBrdf> made(const std::string& spec) {
  auto model = make_sampled_model(spec);
  REQUIRE(model.has_value());
  return *model;
}

/// What many draws at one incidence show.
struct Draws {
  std::vector<double> counts = std::vector<double>(kRows * kColumns + 1);  ///< Last: Dirac or no direction.
  std::array<double, 3> mean{};
  std::array<double, 3> standard_error{};
  double mirror_share = 0;
  double without_density = 0;  ///< Share of draws that found no direction.
  bool lost = false;           ///< Some ended on the wrong side.
};

Draws draw(const SampledBrdf& model, const Direction& omega_i, std::uint32_t test) {
  Draws out;
  std::array<double, 3> square{};
  for (std::uint32_t k = 0; k < kDraws; ++k) {
    std::array<double, 3> t{};
    const DrawnDirection d = model.sample(omega_i, random_input(test, k), t);
    if (d.is_dirac) {
      out.mirror_share = d.density;
      out.counts.back() += 1;
    } else if (d.density > 0) {
      out.counts[cell_of(d.omega_o)] += 1;
      if (k % 16 == 0 && d.density != Approx(model.pdf(omega_i, d.omega_o)).epsilon(1e-12)) {
        FAIL("density of a draw is not the pdf there");
      }
      out.lost = out.lost || d.omega_o.z * side_of(model) <= 0;
    } else {
      out.counts.back() += 1;
      out.without_density += 1.0 / kDraws;
      out.lost = true;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      out.mean[c] += t[c] / kDraws;
      square[c] += t[c] * t[c] / kDraws;
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    out.standard_error[c] = std::sqrt(std::max(square[c] - out.mean[c] * out.mean[c], 0.0) / kDraws);
  }
  return out;
}

}  // namespace

TEST_CASE("The table of promises names every model") {
  const auto table = promise_table();
  for (const ModelDescription& model : model_descriptions()) {
    CAPTURE(model.name);
    CHECK(std::ranges::any_of(table, [&](const Promise& p) {
      return std::string_view(p.spec).substr(0, p.spec.find(':')) == model.name;
    }));
  }
}

TEST_CASE("Models are never negative, and reciprocal where they promise it") {
  for (const Promise& promise : promise_table()) {
    CAPTURE(promise.spec);
    const auto model = made(promise.spec);
    double worst = 0;
    double least = 0;
    for (const Direction& i : spiral(40, 1)) {
      for (const Direction& o : spiral(37, side_of(*model))) {
        const auto f = eval(*model, i, o);
        const auto reversed = promise.reciprocal ? eval(*model, o, i) : f;
        for (std::size_t c = 0; c < 3; ++c) {
          REQUIRE(std::isfinite(f[c]));
          least = std::min(least, f[c]);
          worst = std::max(worst, std::abs(f[c] - reversed[c]) / std::max({f[c], reversed[c], 1e-12}));
        }
      }
    }
    CHECK(least >= 0);
    if (promise.reciprocal) {
      CAPTURE(worst);
      CHECK((*promise.reciprocal ? worst < 1e-9 : worst > 1e-3));
    }
  }
}

TEST_CASE("Models have the albedo that their table says, at most 1 where they promise it") {
  for (const Promise& promise : promise_table()) {
    CAPTURE(promise.spec);
    const auto model = made(promise.spec);
    double most = 0;
    for (std::size_t k = 0; k < kAlbedoDegrees.size(); ++k) {
      const Direction omega_i = from_spherical(radians(kAlbedoDegrees[k]), kPhi);
      const Albedo a = albedo(*model, omega_i, {.tolerance = 1e-4});
      CAPTURE(kAlbedoDegrees[k]);
      CHECK(a.value[1] + a.dirac[1] == Approx(promise.albedo.at(k)).margin(7e-4));
      for (std::size_t c = 0; c < 3; ++c) {
        most = std::max(most, a.value[c] + a.dirac[c]);
      }
    }
    CAPTURE(most);
    REQUIRE(promise.conserving.has_value());
    CHECK((*promise.conserving ? most <= 1 + 1e-4 : most > 1.001));
  }
}

TEST_CASE("Draws follow the pdf, which integrates to 1, and their mean is the albedo") {
  const auto table = promise_table();
  const double comparisons = static_cast<double>(table.size() * kTheta.size());
  // Two-sided normal quantile for a chance of kSignificance in all comparisons of all channels.
  const double sigmas = 4.9;
  REQUIRE(std::erfc(sigmas / std::sqrt(2.0)) < kSignificance / (3 * comparisons));
  std::uint32_t test = 0;
  for (const Promise& promise : table) {
    CAPTURE(promise.spec);
    const auto model = made(promise.spec);
    bool lost = false;
    for (const double theta : kTheta) {
      CAPTURE(degrees(theta));
      const Direction omega_i = from_spherical(theta, kPhi);
      const Draws draws = draw(*model, omega_i, test++);
      lost = lost || draws.lost;

      const Albedo quadrature = albedo(*model, omega_i, {.tolerance = 1e-4});
      for (std::size_t c = 0; c < 3; ++c) {
        CAPTURE(c, draws.standard_error[c]);
        CHECK(std::abs(draws.mean[c] - quadrature.value[c] - quadrature.dirac[c]) <=
              sigmas * draws.standard_error[c] + quadrature.error + 1e-9);
      }

      double least = 0;
      std::vector<double> expected = integrals([&](const Direction& o) {
        const double p = model->pdf(omega_i, o);
        least = std::min(least, p);
        return p;
      });
      CHECK(least >= 0);
      double total = 0;
      for (double& value : expected) {
        total += value;
        value *= kDraws;
      }
      // Draws without a direction exist only where a refraction is impossible.
      const double slack =
          sigmas * std::sqrt(draws.without_density * (1 - draws.without_density) / kDraws) + 5e-4;
      CHECK(std::abs(total + draws.mirror_share + draws.without_density - 1) < slack);

      expected.push_back(std::max(1 - total, 0.0) * kDraws);
      CHECK(chi_square_p(draws.counts, expected) > kSignificance / comparisons);
    }
    if (promise.draws_lost) {
      CHECK(lost == *promise.draws_lost);
    }
  }
}

TEST_CASE("Batches equal single calls, whatever the side of the directions") {
  auto directions = spiral(90, 1);
  const auto below = spiral(50, -1);
  directions.insert(directions.begin() + 20, below.begin(), below.end());
  for (const Promise& promise : promise_table()) {
    CAPTURE(promise.spec);
    const auto model = made(promise.spec);
    const Direction i = from_spherical(0.5, 0.2);
    const std::size_t n = directions.size();
    std::vector<double> f(3 * n, -1);
    std::vector<Origin> origin(n);
    model->eval_batch(i, directions, f, origin);
    std::vector<double> density(n, -1);
    model->pdf_batch(i, directions, density);
    std::vector<SampleInput> u;
    for (std::uint32_t k = 0; k < n; ++k) {
      u.push_back(random_input(999, k));
    }
    std::vector<DrawnDirection> drawn(n);
    std::vector<double> throughput(3 * n);
    model->sample_batch(i, u, drawn, throughput);
    bool same = true;
    for (std::size_t k = 0; k < n; ++k) {
      std::array<double, 3> one{};
      same = same && model->eval(i, directions[k], one) == origin[k];
      for (std::size_t c = 0; c < 3; ++c) {
        same = same && one[c] == Approx(f[3 * k + c]).epsilon(1e-12).margin(1e-13);
      }
      same = same && model->pdf(i, directions[k]) == Approx(density[k]).epsilon(1e-12);
      const DrawnDirection d = model->sample(i, u[k], one);
      same = same && d.density == drawn[k].density && d.omega_o.x == drawn[k].omega_o.x;
      same = same && std::ranges::equal(one, std::span(throughput).subspan(3 * k, 3));
    }
    CHECK(same);
  }
}
