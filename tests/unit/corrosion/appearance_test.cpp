// PROVES: corrosion.md 5.1 checks 13 and 14, and simulator/corrosion/appearance.h, interpolation.h. Sheets
// are made by hand.
#include "simulator/corrosion/appearance.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "simulator/corrosion/interpolation.h"

using namespace scatter;
using namespace scatter::corrosion;

namespace {

Sheet intact(std::size_t side, bool toroidal = true) {
  Sheet sheet;
  sheet.side = side;
  sheet.extent_mm = static_cast<double>(side) * 0.5;
  sheet.thickness_mm = 1;
  sheet.toroidal = toroidal;
  sheet.height.assign(side * side, 1.0F);
  sheet.state.assign(side * side, CellState::kUntouched);
  return sheet;
}

void corrode(Sheet& sheet, std::size_t x, std::size_t y, float height) {
  sheet.height[y * sheet.side + x] = height;
  sheet.state[y * sheet.side + x] = height > 0 ? CellState::kSpreading : CellState::kHole;
}

/// Every state and many heights.
Sheet varied(std::size_t side, bool toroidal = true) {
  Sheet sheet = intact(side, toroidal);
  for (std::size_t n = 0; n < side * side; ++n) {
    if (n * 7919 % 5 > 1) {
      corrode(sheet, n % side, n / side, std::max(0.0F, static_cast<float>(n * 104729 % 1000) / 900 - 0.1F));
    }
  }
  return sheet;
}

/// Four textures that have nothing in common.
AppearanceOptions textured(LookRule rule) {
  AppearanceOptions options;
  options.rule = rule;
  for (std::size_t layer = 0; layer < 4; ++layer) {
    ColourMap& map = options.layers[layer];
    map = {.width = 3 + layer, .height = 2, .values = {}};
    for (std::size_t n = 0; n < map.width * 2; ++n) {
      const auto at = static_cast<float>((n * 37 + layer * 11) % 20);
      map.values.push_back({at / 20, 1 - at / 40, static_cast<float>(layer) / 4});
    }
  }
  return options;
}

/// Share of cells' areas that has `regime`, by a fine raster around the middle of an otherwise intact sheet.
double area_in_cells(const Sheet& sheet, LookRule rule, Regime regime) {
  AppearanceOptions options;
  options.rule = rule;
  constexpr int kSteps = 1500;
  int inside = 0;
  const auto side = static_cast<double>(sheet.side);
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      // A square of 4 x 4 cells about the middle of cell (4, 4).
      const double u = (4.5 + 4 * ((i + 0.5) / kSteps - 0.5)) / side;
      const double v = (4.5 + 4 * ((j + 0.5) / kSteps - 0.5)) / side;
      inside += evaluate(sheet, options, u, v).regime == regime ? 1 : 0;
    }
  }
  return 16.0 * inside / (kSteps * kSteps);
}

}  // namespace

// PROVES: check 13, first part.
TEST_CASE(
    "Between cells is bilinear: exact in the middle of each cell, on toroidal and clamped sheets, in both "
    "rules") {
  for (const bool toroidal : {true, false}) {
    for (const LookRule rule : {LookRule::kByState, LookRule::kByHeight}) {
      const Sheet sheet = varied(24, toroidal);
      const AppearanceOptions options = textured(rule);
      const Appearance look = appearance(sheet, options);
      for (std::size_t y = 0; y < 24; ++y) {
        for (std::size_t x = 0; x < 24; ++x) {
          const std::size_t n = y * 24 + x;
          const Place place = evaluate(sheet, options, (static_cast<double>(x) + 0.5) / 24,
                                       (static_cast<double>(y) + 0.5) / 24);
          REQUIRE(place.height == sheet.height[n]);
          REQUIRE(place.rust == (sheet.state[n] >= CellState::kSpreading ? 1.0F : 0.0F));
          REQUIRE(place.regime == look.regime[n]);
          for (std::size_t c = 0; c < 3; ++c) {
            REQUIRE(place.albedo[c] == Approx(look.albedo[n][c]).margin(1e-6));
          }
        }
      }
    }
  }
}

TEST_CASE(
    "Half way between two cells the height is their mean; a toroidal sheet repeats, a clamped one goes on") {
  Sheet sheet = intact(8);
  corrode(sheet, 0, 0, 0.5F);
  corrode(sheet, 1, 0, 0.25F);
  corrode(sheet, 7, 0, 0.75F);
  const AppearanceOptions options;
  CHECK(evaluate(sheet, options, 1.0 / 8, 0.5 / 8).height == 0.375F);
  CHECK(evaluate(sheet, options, 0, 0.5 / 8).height == 0.625F);
  CHECK(evaluate(sheet, options, 1, 0.5 / 8).height == 0.625F);
  CHECK(evaluate(sheet, options, -3 + 1.0 / 8, 5 + 0.5 / 8).height == 0.375F);
  sheet.toroidal = false;
  CHECK(evaluate(sheet, options, 0, 0.5 / 8).height == 0.5F);
  CHECK(evaluate(sheet, options, -3, 0.5 / 8).height == 0.5F);
  CHECK(evaluate(sheet, options, 1, 0.5 / 8).height == 0.75F);
}

// PROVES: check 13, second part.
TEST_CASE("A constant field comes out as that constant everywhere, to the bit") {
  Sheet sheet = intact(16);
  std::ranges::fill(sheet.height, 0.7F);
  std::ranges::fill(sheet.state, CellState::kDeepening);
  AppearanceOptions options;
  options.layer_limits = {0, 0.3F, 0.7F, 1};
  for (int k = 0; k < 1000; ++k) {
    const double u = std::fmod(k * 0.618034, 1.0);
    const double v = std::fmod(k * 0.7548777, 1.0);
    REQUIRE(evaluate(sheet, options, u, v).height == 0.7F);
    REQUIRE(evaluate(sheet, options, u, v).rust == 1.0F);
    options.rule = LookRule::kByHeight;
    REQUIRE(evaluate(sheet, options, u, v).albedo == options.layers[2].values.front());
    options.rule = LookRule::kByState;
  }
  for (ColourMap& layer : options.layers) {
    layer = {.width = 2, .height = 2, .values = std::vector<Rgb>(4, Rgb{0.3F, 0.2F, 0.1F})};
  }
  CHECK(evaluate(varied(16), options, 0.123, 0.456).albedo[0] == Approx(0.3F));
}

// PROVES: check 13, third part.
TEST_CASE("Every colour lies in the convex hull of the four layers' colours at that place") {
  const Sheet sheet = varied(24);
  for (const LookRule rule : {LookRule::kByState, LookRule::kByHeight}) {
    const AppearanceOptions options = textured(rule);
    for (int k = 0; k < 2000; ++k) {
      const double u = std::fmod(k * 0.618034, 1.0);
      const double v = std::fmod(k * 0.7548777, 1.0);
      const Rgb got = evaluate(sheet, options, u, v).albedo;
      // A point is in the hull when no direction tells it from all corners.
      for (int d = 0; d < 50; ++d) {
        const std::array<double, 3> towards{std::sin(d * 1.7), std::cos(d * 2.3), std::sin(d * 3.1 + 1)};
        const auto along = [&towards](const Rgb& colour) {
          return towards[0] * colour[0] + towards[1] * colour[1] + towards[2] * colour[2];
        };
        double most = -10;
        for (const ColourMap& layer : options.layers) {
          most = std::max(most, along(colour_at(layer, u, v)));
        }
        REQUIRE(along(got) <= most + 1e-6);
      }
    }
  }
}

TEST_CASE("Layers are reached at their depths and limits, with colours mixed in proportion between") {
  AppearanceOptions options;
  const auto red = [&](float height, float depth_um, float rust) {
    return colour(options, 0, 0, height, depth_um, rust)[0];
  };
  CHECK(red(1, 0, 0) == 0.529F);
  CHECK(red(1, 5, 1) == 0.34F);
  CHECK(red(1, 0, 1) == 0.34F);
  CHECK(red(1, 180, 1) == 0.20F);
  CHECK(red(1, 92.5F, 1) == Approx(0.27F));
  CHECK(red(1, 700, 1) == 0.08F);
  CHECK(red(1, 5000, 1) == 0.08F);
  CHECK(red(1, 5, 0.5F) == Approx(0.5 * (0.34 + 0.529)));
  options.rule = LookRule::kByHeight;
  CHECK(red(1, 0, 0) == 0.529F);
  CHECK(red(2.0F / 3, 0, 0) == Approx(0.34F));
  CHECK(red(0.5F, 0, 0) == Approx(0.27F));
  CHECK(red(0, 0, 0) == 0.08F);
}

// PROVES: check 14; corrosion.md 1.10 rows 19 and 20.
TEST_CASE(
    "The thesis's limits shrink an isolated hole to 0.01 cells and leave 1.9 cells of rust; states do not") {
  Sheet hole = intact(9);
  corrode(hole, 4, 4, 0);
  // Where 1 - (1 - |x|)(1 - |y|) < 0.07, and < 0.99 for a depth of 0.05: integrals of the hyperbola.
  const double holes = 4 * (0.07 + 0.93 * std::log(0.93));
  CHECK(holes == Approx(0.01).epsilon(0.01));
  CHECK(area_in_cells(hole, LookRule::kByHeight, Regime::kHole) == Approx(holes).epsilon(0.03));
  CHECK(area_in_cells(hole, LookRule::kByState, Regime::kHole) == Approx(1).epsilon(0.005));
  Sheet rust = intact(9);
  corrode(rust, 4, 4, 0.95F);
  const double rusty = 4 * (0.8 + 0.2 * std::log(0.2));
  CHECK(rusty == Approx(1.91).epsilon(0.01));
  CHECK(area_in_cells(rust, LookRule::kByHeight, Regime::kRust) == Approx(rusty).epsilon(0.005));
  // (1 - |x|)(1 - |y|) >= 0.5.
  CHECK(area_in_cells(rust, LookRule::kByState, Regime::kRust) ==
        Approx(4 * (0.5 + 0.5 * std::log(0.5))).epsilon(0.005));
  rust.height[4 * 9 + 4] = 0.995F;  // thin rust: shiny by its height, rust by its state
  CHECK(area_in_cells(rust, LookRule::kByHeight, Regime::kRust) == 0);
  CHECK(area_in_cells(rust, LookRule::kByState, Regime::kRust) > 0.6);
}

TEST_CASE("Normals are those of the height field in millimetres, y up, whatever the border") {
  // 1 mm thick, cells of 0.5 mm: heights fall by 0.1 mm a cell to the right and by 0.05 mm a cell downwards.
  Sheet sheet = intact(8, false);
  for (std::size_t y = 0; y < 8; ++y) {
    for (std::size_t x = 0; x < 8; ++x) {
      sheet.height[y * 8 + x] = 1 - 0.1F * static_cast<float>(x) - 0.03F * static_cast<float>(y);
    }
  }
  const Appearance ramp = appearance(sheet);
  const double length = std::sqrt(0.2 * 0.2 + 0.06 * 0.06 + 1);
  for (const auto& normal : ramp.normal) {
    CHECK(normal[0] == Approx(0.2 / length).margin(1e-5));
    CHECK(normal[1] == Approx(-0.06 / length).margin(1e-5));
    CHECK(normal[2] == Approx(1 / length).margin(1e-5));
  }
  sheet.toroidal = true;
  const Appearance wrapped = appearance(sheet);
  // Between the last column and the second one lie two cells and 0.6 mm.
  const auto& seam = wrapped.normal[3 * 8];
  CHECK(-seam[0] / seam[2] == Approx(0.6).epsilon(1e-5));
}

TEST_CASE("A bump map multiplies the height for normals and changes nothing else") {
  Sheet sheet = intact(8, false);
  AppearanceOptions options;
  options.bump = {.width = 2, .height = 1, .values = {1.0F, 0.5F}};
  const Appearance flat = appearance(sheet);
  const Appearance bumped = appearance(sheet, options);
  CHECK(bumped.albedo == flat.albedo);
  CHECK(bumped.regime == flat.regime);
  // Bilinear from 1 in the middle of the left half to 0.5 in the middle of the right one: 0.5 mm over 2 mm.
  const auto& normal = bumped.normal[3 * 8 + 3];
  CHECK(normal[0] / normal[2] == Approx(0.25).epsilon(1e-5));
}

TEST_CASE("Metal, rust and holes have the roughness, porosity, metalness and opacity that are theirs") {
  Sheet sheet = intact(8);
  corrode(sheet, 1, 0, 0.94F);
  corrode(sheet, 2, 0, 0);
  const Appearance look = appearance(sheet);
  CHECK(look.roughness[0] == 0.15F);
  CHECK(look.porosity[0] == 0);
  CHECK(look.metalness[0] == 1);
  CHECK(look.opacity[0] == 1);
  CHECK(look.roughness[1] == Approx(0.40 + 0.40 * (1 - std::exp(-1.0))));
  CHECK(look.porosity[1] == Approx(0.10 + 0.45 * (1 - std::exp(-0.6))));
  CHECK(look.metalness[1] == 0);
  CHECK(look.opacity[1] == 1);
  CHECK(look.regime[2] == Regime::kHole);
  CHECK(look.metalness[2] == 0);
  CHECK(look.opacity[2] == 0);
  for (float depth = 0; depth < 5000; depth += 10) {
    CHECK(rust_roughness(depth + 10) >= rust_roughness(depth));
    CHECK(rust_porosity(depth + 10) >= rust_porosity(depth));
  }
  CHECK(rust_roughness(1e9F) <= 1);
  CHECK(rust_porosity(1e9F) <= 1);
}

TEST_CASE("Options out of range are refused by name") {
  CHECK(check(AppearanceOptions{}).has_value());
  const auto refused = [](const auto& change, const char* word) {
    AppearanceOptions options;
    change(options);
    const Status status = check(options);
    REQUIRE_FALSE(status.has_value());
    CHECK(status.error().code == ErrorCode::kInvalidArgument);
    INFO(status.error().what);
    CHECK(status.error().what.find(word) != std::string::npos);
  };
  refused([](auto& o) { o.layers[1].values[0][2] = 1.5F; }, "layer 1");
  refused([](auto& o) { o.layers[2].values[0][0] = std::numeric_limits<float>::quiet_NaN(); }, "layer 2");
  refused([](auto& o) { o.layers[3].width = 2; }, "layer 3");
  refused([](auto& o) { o.metal_roughness = 0; }, "metal roughness");
  refused([](auto& o) { o.layer_depths_um = {1, 2, 3}; }, "layer depths");
  refused([](auto& o) { o.layer_limits = {0, 0.5F, 0.4F, 1}; }, "layer limits");
  refused([](auto& o) { o.bump.values[0] = 2; }, "bump");
}
