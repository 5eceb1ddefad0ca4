#include "tools/scatter/spot_statistics.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace {

using namespace scatter;
using namespace scatter::cli;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;

/// f everywhere, light at 40 deg, 76 rings of 1 deg; `peak` within 3 deg of the mirror direction.
GridBrdf grid(float f, float random, float systematic, float peak) {
  GridBrdf::Content content;
  content.channels = 1;
  GridPart part;
  part.theta_i = reflectance::radians(40);
  const std::size_t nodes = content.theta_count * content.phi_count;
  part.f_per_sr.assign(1, std::vector<float>(nodes, f));
  part.random_per_sr.assign(1, std::vector<float>(nodes, random));
  part.systematic_per_sr.assign(1, std::vector<float>(nodes, systematic));
  part.origin.assign(nodes, Origin::kMeasured);
  for (std::size_t node = 0; node < nodes; ++node) {
    const auto out = reflectance::from_spherical(reflectance::radians(static_cast<double>(node / 360)),
                                                 reflectance::radians(static_cast<double>(node % 360)));
    const auto mirror = reflectance::from_spherical(reflectance::radians(40), reflectance::kPi);
    if (reflectance::angle_between(out, mirror) < reflectance::radians(3)) {
      part.f_per_sr[0][node] = peak;
    }
  }
  content.parts.push_back(std::move(part));
  auto made = GridBrdf::make(std::move(content));
  REQUIRE(made.has_value());
  return std::move(*made);
}

}  // namespace

TEST_CASE("Peak, diffuse part and albedo of a spot are those of its measured directions") {
  const auto figures = spot_figures(grid(0.2F, 0.003F, 0.004F, 5.0F), 0);
  REQUIRE(figures.size() == 1);
  CHECK(figures[0].peak->value == Approx(5.0));
  CHECK(figures[0].diffuse->value == Approx(0.2));
  // What is added within 3 deg of the mirror direction is not farther than 45 deg from it.
  const auto flat = spot_figures(grid(0.2F, 0.003F, 0.004F, 0.2F), 0);
  CHECK(figures[0].share->value * figures[0].albedo->value ==
        Approx(flat[0].share->value * flat[0].albedo->value));
  CHECK(figures[0].share->value < flat[0].share->value);
  CHECK(figures[0].diffuse->uncertainty == Approx(0.005));  // 3, 4, 5
  // pi f sin^2 of the region's edge, half a step beyond the last ring; the peak adds 4.8 over a cap of 3 deg.
  const double edge = std::pow(std::sin(reflectance::radians(75.5)), 2);
  const double cap =
      reflectance::kPi * std::pow(reflectance::radians(3), 2) * std::cos(reflectance::radians(40));
  CHECK(figures[0].albedo->value == Approx(reflectance::kPi * 0.2 * edge + 4.8 * cap).epsilon(0.02));
}

TEST_CASE("The spread over spots is mean, standard deviation and the spots' own uncertainty") {
  const std::optional<SpotFigure> spots[] = {SpotFigure{1.0, 0.1}, SpotFigure{2.0, 0.1},
                                             SpotFigure{6.0, 0.1}};
  const auto spread = spread_of(spots);
  REQUIRE(spread.has_value());
  CHECK(spread->mean == Approx(3));
  CHECK(spread->deviation == Approx(std::sqrt(7.0)));  // (4 + 1 + 9) / 2
  CHECK(spread->uncertainty == Approx(0.1));
  CHECK(spread_of(std::span(spots).first(1))->deviation == 0);
  const std::optional<SpotFigure> missing[] = {SpotFigure{1.0, 0.1}, std::nullopt};
  CHECK_FALSE(spread_of(missing).has_value());
  CHECK_FALSE(spread_of({}).has_value());
}

TEST_CASE("The mean of spots is plain, its noise falls with their number, what they share does not") {
  const GridBrdf a = grid(0.1F, 0.003F, 0.01F, 0.1F);
  GridBrdf::Content holed = grid(0.3F, 0.004F, 0.02F, 0.3F).content();
  holed.parts[0].origin[500] = Origin::kInvalid;
  const auto b = GridBrdf::make(holed);
  const GridBrdf* const both[] = {&a, &*b};
  const auto combined = combine_spots(both);
  REQUIRE(combined.has_value());
  const GridPart& mean = combined->mean.content().parts[0];
  CHECK(mean.f_per_sr[0][7] == Approx(0.2));
  CHECK(mean.random_per_sr[0][7] == Approx(0.0025));
  CHECK(mean.systematic_per_sr[0][7] == Approx(0.015));
  CHECK(combined->deviation.content().parts[0].f_per_sr[0][7] == Approx(0.2 / std::sqrt(2.0)));
  // Where one spot has no value there is none.
  CHECK(mean.origin[500] == Origin::kInvalid);
  CHECK(mean.f_per_sr[0][500] == 0);
  CHECK(mean.origin[501] == Origin::kMeasured);
  holed.theta_count = 75;
  for (auto* plane : {&holed.parts[0].f_per_sr[0], &holed.parts[0].random_per_sr[0],
                      &holed.parts[0].systematic_per_sr[0]}) {
    plane->resize(75 * 360);
  }
  holed.parts[0].origin.resize(75 * 360);
  const auto smaller = GridBrdf::make(holed);
  REQUIRE(smaller.has_value());
  const GridBrdf* const different[] = {&a, &*smaller};
  CHECK_FALSE(combine_spots(different).has_value());
  CHECK_FALSE(combine_spots({}).has_value());
}
