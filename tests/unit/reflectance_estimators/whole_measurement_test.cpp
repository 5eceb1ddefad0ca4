#include <algorithm>
#include <array>
#include <catch2/catch.hpp>

#include "host_sdk/reflectance/estimators/blind_spots.h"
#include "host_sdk/reflectance/estimators/merge.h"
#include "host_sdk/reflectance/estimators/symmetry.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tests/unit/reflectance_estimators/made_data.h"

using namespace scatter::reflectance;
using namespace scatter::reflectance::made;

namespace {

constexpr std::size_t kColumns = 72;
std::size_t node(double theta_deg, double phi_deg) {
  return static_cast<std::size_t>(std::lround(theta_deg / 5)) * kColumns +
         static_cast<std::size_t>(std::lround(phi_deg / 5)) % kColumns;
}
double lopsided(double theta_i, double theta_o, double phi) {
  return 2 + theta_i + std::sin(theta_o) * (std::cos(phi) + 0.3 * std::sin(phi));
}
/// Reciprocal: symmetric in theta_i and theta_o.
double fair(double theta_i, double theta_o, double phi) {
  return 1 + std::cos(theta_i) * std::cos(theta_o) + std::sin(theta_i) * std::sin(theta_o) * std::cos(phi);
}

}  // namespace

TEST_CASE("Averaged mirror halves are symmetric and keep the mean") {
  for (const double phi_i : {0.0, 30.0, 32.5, 31.0}) {
    GridBrdf::Content content = grid_content({0, 40}, lopsided);
    for (GridPart& part : content.parts) {
      part.phi_i = radians(phi_i);
    }
    add_uncertainty(content, 0.2F, 0.4F);
    const GridBrdf grid = GridBrdf::make(content).value();
    const AveragedGrid averaged = average_mirror_halves(grid).value();
    REQUIRE(averaged.grid.content().metadata.contains("mirror_symmetry"));
    const Direction i = grid.omega_i(1);
    for (const double off : {20.0, 70.0, 155.0}) {
      // Between columns the mean is taken with interpolated images: error of chords over 5 deg, 1e-3.
      const double expected =
          0.5 * (at(grid, i, deg(50, phi_i + off)).f + at(grid, i, deg(50, phi_i - off)).f);
      REQUIRE(at(averaged.grid, i, deg(50, phi_i + off)).f == Approx(expected).margin(2e-3));
      REQUIRE(at(averaged.grid, i, deg(50, phi_i - off)).f == Approx(expected).margin(2e-3));
    }
  }
}

TEST_CASE("Averaging two halves lowers random uncertainty, not systematic, and leaves the plane alone") {
  GridBrdf::Content content = grid_content({40}, lopsided);
  add_uncertainty(content, 0.2F, 0.4F);
  content.parts[0].origin[node(50, 300)] = Origin::kInterpolated;
  content.parts[0].origin[node(50, 100)] = Origin::kInvalid;
  content.parts[0].f_per_sr[0][node(50, 100)] = NAN;
  const GridBrdf grid = GridBrdf::make(content).value();
  const AveragedGrid averaged = average_mirror_halves(grid).value();
  const GridPart& part = averaged.grid.content().parts[0];
  REQUIRE(part.random_per_sr[0][node(50, 45)] == Approx(0.2 / std::sqrt(2)));
  REQUIRE(part.systematic_per_sr[0][node(50, 45)] == Approx(0.4));
  REQUIRE(part.origin[node(50, 45)] == Origin::kMeasured);
  REQUIRE(part.random_per_sr[0][node(50, 180)] == Approx(0.2));
  REQUIRE(part.f_per_sr[0][node(50, 180)] == content.parts[0].f_per_sr[0][node(50, 180)]);
  // 60 deg has the interpolated 300 deg as its image; 100 deg has only its image's value.
  REQUIRE(part.origin[node(50, 60)] == Origin::kInterpolated);
  REQUIRE(averaged.filled == 1);
  REQUIRE(part.origin[node(50, 100)] == Origin::kInterpolated);
  REQUIRE(part.f_per_sr[0][node(50, 100)] == content.parts[0].f_per_sr[0][node(50, 260)]);
  REQUIRE(part.origin[node(50, 260)] == Origin::kMeasured);
}

TEST_CASE("Reciprocal averaging changes nothing of a reciprocal BRDF and halves what breaks it") {
  const double wrong = 0.1;
  const Function broken = [&](double theta_i, double theta_o, double phi) {
    return fair(theta_i, theta_o, phi) + wrong * (theta_i - theta_o);
  };
  for (const bool is_fair : {true, false}) {
    const GridBrdf grid =
        GridBrdf::make(grid_content({0, 20, 40, 60}, is_fair ? Function(fair) : broken)).value();
    const AveragedGrid averaged = average_reciprocal(grid, grid).value();
    REQUIRE(averaged.grid.content().metadata.contains("reciprocity"));
    const GridPart& part = averaged.grid.content().parts[1];
    // theta_o = 40 deg is a measured incidence: an exact pair. Of 35 deg the reverse is interpolated.
    REQUIRE(part.f_per_sr[0][node(40, 45)] ==
            Approx(fair(radians(20), radians(40), radians(45))).margin(1e-6));
    REQUIRE(part.origin[node(40, 45)] == Origin::kMeasured);
    REQUIRE(part.origin[node(35, 45)] == Origin::kInterpolated);
    // Beyond the last incidence there is no reverse.
    REQUIRE(part.f_per_sr[0][node(70, 45)] == grid.content().parts[1].f_per_sr[0][node(70, 45)]);
    REQUIRE(part.origin[node(70, 45)] == Origin::kMeasured);
  }
}

TEST_CASE("Reciprocal averaging weighs by the uncertainties when both are known") {
  GridBrdf::Content content = grid_content({20, 40}, [](double theta_i, double, double) { return theta_i; });
  add_uncertainty(content, 0, 0.1F);
  std::ranges::fill(content.parts[1].systematic_per_sr[0], 0.3F);
  const GridBrdf grid = GridBrdf::make(content).value();
  const AveragedGrid averaged = average_reciprocal(grid, grid).value();
  // Part 20 deg has 0.1, the reverse from part 40 deg 0.3: shares 0.9 and 0.1.
  REQUIRE(averaged.grid.content().parts[0].f_per_sr[0][node(40, 45)] ==
          Approx(0.9 * radians(20) + 0.1 * radians(40)).epsilon(1e-5));
  REQUIRE(averaged.grid.content().parts[0].systematic_per_sr[0][node(40, 45)] ==
          Approx(0.9 * 0.1 + 0.1 * 0.3));
}

TEST_CASE("Transmission has no reverse to average with") {
  GridBrdf::Content content = grid_content({20}, fair);
  content.type = ScatterType::kBtdf;
  const GridBrdf grid = GridBrdf::make(std::move(content)).value();
  REQUIRE_FALSE(average_reciprocal(grid, grid).has_value());
  REQUIRE_FALSE(fill_blind_spots(grid, &grid).has_value());
  REQUIRE(fill_blind_spots(grid).has_value());
  REQUIRE(average_mirror_halves(grid).has_value());
}

TEST_CASE("A blind spot is filled smoothly, marked, and less sure than its surroundings") {
  // Harmonic on the sphere: tan(theta/2)^k cos(k phi) are the solutions of Laplace's equation.
  const Function harmonic = [](double, double theta_o, double phi) {
    return 1 + std::tan(theta_o / 2) * std::cos(phi) +
           0.5 * std::pow(std::tan(theta_o / 2), 2) * std::sin(2 * phi);
  };
  GridBrdf::Content content = grid_content({20}, harmonic);
  add_uncertainty(content, 0.01F, 0.02F);
  GridPart& part = content.parts[0];
  std::vector<std::size_t> hole;
  for (const double theta : {15.0, 20.0, 25.0, 30.0}) {
    for (const double phi : {345.0, 350.0, 355.0, 0.0, 5.0, 10.0}) {
      hole.push_back(node(theta, phi));
      part.origin[hole.back()] = Origin::kInvalid;
      part.f_per_sr[0][hole.back()] = NAN;
    }
  }
  const FilledGrid filled = fill_blind_spots(GridBrdf::make(content).value()).value();
  REQUIRE(filled.by_neighbors == hole.size());
  REQUIRE(filled.left == 0);
  const GridPart& after = filled.grid.content().parts[0];
  for (const std::size_t n : hole) {
    const double expected = harmonic(0, static_cast<double>(n / kColumns) * radians(5),
                                     static_cast<double>(n % kColumns) * radians(5));
    REQUIRE(after.origin[n] == Origin::kInterpolated);
    // The five-point rule on 5 deg cells: error of order step^2 = 0.008 of the variation, 0.3.
    REQUIRE(after.f_per_sr[0][n] == Approx(expected).margin(3e-3));
    REQUIRE(after.systematic_per_sr[0][n] > 0.02F);
    REQUIRE(std::abs(after.f_per_sr[0][n] - expected) < after.systematic_per_sr[0][n]);
  }
  REQUIRE(after.f_per_sr[0][node(35, 0)] == part.f_per_sr[0][node(35, 0)]);
  REQUIRE(after.systematic_per_sr[0][node(35, 0)] == 0.02F);
}

TEST_CASE("A hole over the pole is one point there, and a hole at the rim is extrapolated") {
  GridBrdf::Content content = grid_content(
      {20}, [](double, double theta_o, double phi) { return 1 + std::tan(theta_o / 2) * std::cos(phi); });
  GridPart& part = content.parts[0];
  for (std::size_t n = 0; n < 3 * kColumns; ++n) {
    part.origin[n] = Origin::kInvalid;
  }
  for (const double theta : {70.0, 75.0}) {
    part.origin[node(theta, 90)] = Origin::kInvalid;
  }
  const FilledGrid filled = fill_blind_spots(GridBrdf::make(content).value()).value();
  const GridPart& after = filled.grid.content().parts[0];
  for (std::size_t n = 0; n < kColumns; ++n) {
    REQUIRE(after.f_per_sr[0][n] == Approx(1).margin(1e-4));
    REQUIRE(after.origin[n] == Origin::kInterpolated);
  }
  REQUIRE(after.f_per_sr[0][node(5, 60)] == Approx(1 + std::tan(radians(2.5)) * 0.5).margin(2e-4));
  REQUIRE(after.origin[node(75, 90)] == Origin::kExtrapolated);
  REQUIRE(after.origin[node(70, 90)] == Origin::kExtrapolated);
}

TEST_CASE("A blind spot takes the exchanged direction's value where that was measured") {
  GridBrdf::Content content = grid_content({0, 20, 40, 60}, fair);
  GridPart& part = content.parts[2];
  part.origin[node(20, 30)] = Origin::kInvalid;
  part.f_per_sr[0][node(20, 30)] = 0;
  part.origin[node(70, 30)] = Origin::kInvalid;
  const GridBrdf grid = GridBrdf::make(content).value();
  const FilledGrid filled = fill_blind_spots(grid, &grid).value();
  REQUIRE(filled.by_reciprocity == 1);
  REQUIRE(filled.by_neighbors == 1);
  const GridPart& after = filled.grid.content().parts[2];
  REQUIRE(after.f_per_sr[0][node(20, 30)] ==
          Approx(fair(radians(40), radians(20), radians(30))).epsilon(1e-6));
  REQUIRE(after.origin[node(20, 30)] == Origin::kInterpolated);
  REQUIRE(filled.grid.content().metadata.at("blind_spots") ==
          "1 nodes filled from their neighbours, 1 by reciprocity");
}

TEST_CASE("A part without any value stays empty and is counted") {
  GridBrdf::Content content = grid_content({20, 40}, fair);
  std::ranges::fill(content.parts[1].origin, Origin::kInvalid);
  const FilledGrid filled = fill_blind_spots(GridBrdf::make(content).value()).value();
  REQUIRE(filled.left > 0);
  REQUIRE(filled.grid.content().parts[1].origin[node(20, 30)] == Origin::kInvalid);
}

TEST_CASE("Three colour files become one; what a file lacks is estimated and says so") {
  const auto colour = [](double factor, const std::vector<double>& theta_i, std::size_t rows,
                         float wavelength) {
    GridBrdf::Content content = grid_content(
        theta_i, [=](double i, double o, double phi) { return factor * lopsided(i, o, phi); }, rows);
    content.wavelengths_nm = {wavelength};
    content.metadata = {{"software", "s"}, {"recording_id", std::to_string(factor)}};
    return std::make_shared<const GridBrdf>(GridBrdf::make(std::move(content)).value());
  };
  const std::array<MergeSource, 3> sources{{{colour(1, {0, 20, 40}, 16, 630), 0, "red"},
                                            {colour(2, {0, 40}, 16, 525), 0, "green"},
                                            {colour(3, {0, 20, 40}, 15, 465), 0, "blue"}}};
  const Merged merged = merge_channels(sources).value();
  const auto& grid = dynamic_cast<const GridBrdf&>(*merged.brdf);
  REQUIRE(grid.channels() == 3);
  REQUIRE(grid.content().parts.size() == 3);
  REQUIRE(grid.content().theta_count == 16);
  REQUIRE(grid.wavelengths_nm()[1] == 525);
  REQUIRE(grid.content().metadata.at("software") == "s");
  REQUIRE(grid.content().metadata.contains("green.recording_id"));
  REQUIRE(grid.content().metadata.at("merged_from") == "red, green, blue");
  const GridPart& whole = grid.content().parts[0];
  const GridPart& between = grid.content().parts[1];
  const std::size_t n = node(30, 45);
  for (std::size_t c = 0; c < 3; ++c) {
    const double factor = 1.0 + static_cast<double>(c);
    REQUIRE(whole.f_per_sr[c][n] == Approx(factor * lopsided(0, radians(30), radians(45))));
    REQUIRE((c == 1 ||
             between.f_per_sr[c][n] == Approx(factor * lopsided(radians(20), radians(30), radians(45)))));
  }
  REQUIRE(whole.origin[n] == Origin::kMeasured);
  REQUIRE(between.origin[n] == Origin::kInterpolated);
  REQUIRE(between.f_per_sr[1][n] > 0);
  // Blue ends at 70 deg.
  REQUIRE(whole.origin[node(75, 45)] == Origin::kExtrapolated);
  // Green lacks one incidence of 16 rows, blue one row of each of three.
  REQUIRE(merged.estimated == 16 * kColumns + 3 * kColumns);
}

TEST_CASE("Grids about the mirror direction merge over the union of their axes") {
  const auto colour = [](double factor, std::vector<double> theta_i_deg) {
    SpecularGridBrdf::Content content;
    content.rotation = {0};
    for (const double theta : theta_i_deg) {
      content.theta_i.push_back(radians(theta));
    }
    for (int a = 0; a <= 360; a += 30) {
      content.azimuth.push_back(radians(a));
    }
    for (int r = 0; r <= 80; r += 10) {
      content.radial.push_back(radians(r));
    }
    content.f_per_sr.resize(1);
    for (std::size_t i = 0; i < content.theta_i.size(); ++i) {
      for (std::size_t a = 0; a < content.azimuth.size(); ++a) {
        for (const double radial : content.radial) {
          content.f_per_sr[0].push_back(static_cast<float>(factor * (1 + content.theta_i[i] + radial)));
        }
      }
    }
    return std::make_shared<const SpecularGridBrdf>(SpecularGridBrdf::make(std::move(content)).value());
  };
  const std::array<MergeSource, 2> sources{
      {{colour(1, {10, 30}), 0, "red"}, {colour(2, {10, 20, 30}), 0, "green"}}};
  const Merged merged = merge_channels(sources).value();
  const auto& content = dynamic_cast<const SpecularGridBrdf&>(*merged.brdf).content();
  REQUIRE(content.theta_i.size() == 3);
  const std::size_t at_20 = (1 * 13 + 3) * 9 + 2;
  REQUIRE(content.f_per_sr[0][at_20] == Approx(1 + radians(20) + radians(20)).epsilon(1e-5));
  REQUIRE(content.f_per_sr[1][at_20] == Approx(2 * (1 + radians(20) + radians(20))).epsilon(1e-6));
  REQUIRE(content.origin[at_20] == Origin::kInterpolated);
  REQUIRE(content.origin[(0 * 13 + 3) * 9 + 2] == Origin::kMeasured);
}

TEST_CASE("Scattered colours merge over the union of their places") {
  const Function one = [](double, double theta_o, double) { return 1 + theta_o; };
  const Function two = [](double, double theta_o, double) { return 2 + 2 * theta_o; };
  const auto red = ScatteredBrdf::make(rings({20, 40}, {0, 10, 20}, 20, one)).value();
  const auto green = ScatteredBrdf::make(rings({20, 40}, {0, 5, 10, 20, 30}, 20, two)).value();
  const std::array<MergeSource, 2> sources{{{red, 0, "red"}, {green, 0, "green"}}};
  const Merged merged = merge_channels(sources).value();
  const auto& samples = dynamic_cast<const ScatteredBrdf&>(*merged.brdf);
  // Per incidence: the pole, and rings at 5, 10, 20 and 30 deg of 18 places.
  REQUIRE(merged.points == 2 * (1 + 4 * 18));
  REQUIRE(merged.estimated == 2 * 2 * 18);
  REQUIRE(merged.dropped == 0);
  std::array<double, 2> f{};
  REQUIRE(samples.eval(deg(20, 0), deg(5, 40), f) == Origin::kInterpolated);
  REQUIRE(f[0] == Approx(1 + radians(5)).epsilon(1e-5));
  REQUIRE(f[1] == Approx(2 + 2 * radians(5)).epsilon(1e-5));
  REQUIRE(samples.eval(deg(20, 0), deg(20, 40), f) == Origin::kMeasured);
  REQUIRE(samples.eval(deg(20, 0), deg(30, 40), f) == Origin::kExtrapolated);
}

TEST_CASE("What cannot be merged is refused by name") {
  const auto grid = std::make_shared<const GridBrdf>(GridBrdf::make(grid_content({20}, fair)).value());
  const auto samples = ScatteredBrdf::make(rings({20}, {10}, 20, fair)).value();
  const auto model = std::make_shared<const FunctionBrdf>(fair);
  const auto refusal = [](const std::vector<MergeSource>& sources) {
    const auto merged = merge_channels(sources);
    return merged ? std::string("accepted") : merged.error().what;
  };
  REQUIRE(refusal({{grid, 0, "red"}}).find("1 source") != std::string::npos);
  REQUIRE(refusal({{grid, 0, "red"}, {grid, 1, "green"}}).find("green has 1 channels") != std::string::npos);
  REQUIRE(refusal({{grid, 0, "red"}, {samples, 0, "green"}}).find("green is scattered samples") !=
          std::string::npos);
  REQUIRE(refusal({{model, 0, "red"}, {grid, 0, "green"}}).find("red has no measured points") !=
          std::string::npos);
}
