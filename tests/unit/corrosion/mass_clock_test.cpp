// Expected values: the loss of each cell by its formula, summed.
#include "simulator/corrosion/mass_clock.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace scatter::corrosion {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();

double loss_of_cell(const DepthLaw& law, double birth, double rate, double tau) {
  const double way = std::max(tau - birth, 0.0);
  return std::min(1.0, law.skin * std::min(way / law.width, 1.0) + rate * way);
}

double mean_loss(const DepthLaw& law, const std::vector<float>& births, const std::vector<float>& rates,
                 double tau) {
  double sum = 0;
  for (std::size_t i = 0; i < births.size(); ++i) {
    sum += births[i] == kNever
               ? 0
               : loss_of_cell(law, static_cast<double>(births[i]), static_cast<double>(rates[i]), tau);
  }
  return sum / static_cast<double>(births.size());
}

/// A clock that ran until nothing happens any more; births must rise.
MassClock run_out(const DepthLaw& law, const std::vector<float>& births, const std::vector<float>& rates) {
  MassClock clock(law, births.size());
  std::size_t next = 0;
  while (next < births.size() || !clock.idle()) {
    while (next < births.size() &&
           (births[next] == kNever || static_cast<double>(births[next]) < clock.edge())) {
      if (births[next] < kNever) {
        clock.add(births[next], rates[next]);
      }
      ++next;
    }
    clock.close_bin();
  }
  return clock;
}

TEST_CASE("Bins hold what lies between their edges, 1024 to each doubling") {
  CHECK(MassClock::bin_of(0) == 0);
  CHECK(MassClock::bin_of(2) - MassClock::bin_of(1) == 1024);
  CHECK(MassClock::bin_of(1e300) == MassClock::bin_of(0x1p60));
  MassClock clock(DepthLaw{}, 1);
  for (std::size_t bin = 0; bin < 30000; ++bin) {
    const double edge = clock.edge();
    REQUIRE(MassClock::bin_of(edge) == bin + 1);
    REQUIRE(MassClock::bin_of(std::nextafter(edge, 0)) == bin);
    clock.close_bin();
  }
}

TEST_CASE("One cell loses its skin, then deepens until nothing is left") {
  const DepthLaw law{.skin = 0.25, .width = 0.5};
  const MassClock clock = run_out(law, {1.0F}, {0.125F});
  const std::vector<float> birth{1.0F};
  const std::vector<float> rate{0.125F};
  // Half the skin and half its time's deepening; the whole skin; half the sheet; all of it.
  const std::vector<double> losses{0.125 + 0.25 * 0.125, 0.25 + 0.5 * 0.125, 0.5, 1.0};
  const std::vector<double> taus = clock.solve(losses, birth, rate);
  CHECK(taus[0] == Approx(1.25).epsilon(1e-14));
  CHECK(taus[1] == Approx(1.5).epsilon(1e-14));
  CHECK(taus[2] == Approx(1 + 0.25 / 0.125).epsilon(1e-14));
  CHECK(taus[3] == Approx(1 + 0.75 / 0.125).epsilon(1e-12));
}

TEST_CASE("A cell thinner than its skin is gone before the skin is complete") {
  const DepthLaw law{.skin = 4, .width = 1};
  const std::vector<float> birth{2.0F};
  const std::vector<float> rate{1.0F};
  const MassClock clock = run_out(law, birth, rate);
  const std::vector<double> losses{0.5};
  CHECK(clock.solve(losses, birth, rate)[0] == Approx(2.1).epsilon(1e-14));
  CHECK(clock.loss() == Approx(1).epsilon(1e-14));
}

TEST_CASE("Loss at every edge, and at every tau found for a loss, is the sum over the cells") {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<float> unit(0, 1);
  const DepthLaw law{.skin = 0.01, .width = 0.1};
  std::vector<float> births(5000);
  std::vector<float> rates(births.size());
  for (std::size_t i = 0; i < births.size(); ++i) {
    births[i] = i < 5 ? 0 : 20 * unit(random);
    rates[i] = 0.02F * std::exp(4 * unit(random) - 2);
  }
  std::ranges::sort(births);
  births.back() = kNever;
  const MassClock clock = run_out(law, births, rates);
  const std::vector<MassClock::Point> edges = clock.edges();
  for (std::size_t i = 0; i < edges.size(); i += 997) {
    CHECK(edges[i].loss == Approx(mean_loss(law, births, rates, edges[i].tau)).epsilon(1e-12).margin(1e-16));
  }
  std::vector<double> losses;
  for (int i = 1; i < 400; ++i) {
    losses.push_back(std::pow(10.0, -6 + 6.0 * i / 400));
  }
  const std::vector<double> taus = clock.solve(losses, births, rates);
  for (std::size_t i = 0; i < losses.size(); ++i) {
    CHECK(mean_loss(law, births, rates, taus[i]) == Approx(losses[i]).epsilon(1e-12));
  }
  CHECK(std::ranges::is_sorted(taus));
}

TEST_CASE("Where metal of perfect quality is left, a greater loss is never reached") {
  const DepthLaw law{.skin = 0.25, .width = 0.5};
  const std::vector<float> births{0.0F, 1.0F};
  const std::vector<float> rates{0.5F, 0.0F};
  const MassClock clock = run_out(law, births, rates);
  CHECK(clock.loss() == Approx((1 + 0.25) / 2).epsilon(1e-14));
  const std::vector<double> losses{0.9};
  const double tau = clock.solve(losses, births, rates)[0];
  CHECK(mean_loss(law, births, rates, tau) == Approx(0.625).epsilon(1e-14));
}

}  // namespace
}  // namespace scatter::corrosion
