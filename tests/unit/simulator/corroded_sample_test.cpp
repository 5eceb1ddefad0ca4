#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "simulator/bench/bench.h"
#include "simulator/bench/light.h"
#include "simulator/samples/corroded_spec.h"
#include "simulator/samples/patina_spec.h"
#include "simulator/samples/sample.h"

#include "simulator/samples/sample_brdf.h"
#include "simulator/samples/spec_sheet.h"
#include "simulator/samples/textured_spec.h"
#include "tests/unit/simulator/made_sheet.h"

namespace {

using namespace scatter::simulator;
using scatter::reflectance::Direction;
using scatter::reflectance::from_spherical;
using scatter::reflectance::radians;

/// Small enough to grow at once: 10 mm with 256 cells.
const std::string kSmall = "corroded:extent_mm=10,age=5,starting_points=6";

}  // namespace

TEST_CASE("A corroded sample's text says everything that grows it") {
  const auto all = parse_corroded(
      "corroded:age=12.5,corrosivity=very-high,law=iso9224,mode=thesis,border=clamped,starting_points=7,seed="
      "9,"
      "extent_mm=20,side=512,thickness_mm=2,surface=0.25,material=0.75,exposure=2,opening=1,"
      "least_susceptibility=0.01,late_points=3,reserve=0.1,bite=0.02,conversion_removes=yes,"
      "depth_per_spread=0.05,skin_um=4,front_sigma=0.3,front_length_mm=2,pit_sigma=0.2,pit_length_mm=0.5,"
      "metal_alpha=0.3,backing=0.5,spot=0.25/0.75");
  REQUIRE(all.has_value());
  CHECK(all->growth.age_years == 12.5);
  CHECK(all->growth.corrosivity == scatter::corrosion::Corrosivity::kVeryHigh);
  CHECK(all->growth.law == scatter::corrosion::Law::kIso9224);
  CHECK(all->growth.mode == scatter::corrosion::Mode::kThesis);
  CHECK(all->growth.border == scatter::corrosion::Border::kClamped);
  CHECK(all->growth.starting_points == 7);
  CHECK(all->growth.seed == 9);
  CHECK(all->growth.side == 512);
  CHECK(all->growth.surface.values == std::vector<float>{0.25F});
  CHECK(all->growth.exposure.values == std::vector<float>{2.0F});
  CHECK(all->growth.late_points == 3.0);
  CHECK(all->growth.events.conversion_removes);
  CHECK(all->growth.front.pit_length_mm == 0.5);
  CHECK(all->optics.metal_alpha == 0.3);
  CHECK(all->optics.backing == 0.5);
  REQUIRE(all->place.has_value());
  CHECK(all->place->u == 0.25);
  CHECK(all->place->v == 0.75);
  CHECK_FALSE(parse_corroded("corroded:spot=whole")->place.has_value());
  CHECK(parse_corroded("corroded:backing=black")->optics.backing == 0);
}

TEST_CASE("The grid is as fine as the spot asks, and coarser ones are refused") {
  // 3 mm / 50 = 0.06 mm: 50 mm have 834 cells at least, the next power of two is 1024.
  CHECK(parse_corroded("corroded:age=1")->growth.side == 1024);
  CHECK(parse_corroded("corroded:extent_mm=100")->growth.side == 2048);
  CHECK(parse_corroded("corroded:extent_mm=10")->growth.side == 256);
  CHECK(parse_corroded("corroded:side=834")->growth.side == 834);
  const auto coarse = parse_corroded("corroded:side=833");
  REQUIRE_FALSE(coarse.has_value());
  CHECK(coarse.error().what.find("side is '833', expected 834..16384") != std::string::npos);
}

TEST_CASE("A bad corroded sample is refused with the key, what was found and its range") {
  for (const auto& [spec, part] :
       {std::pair<const char*, const char*>{"corroded:age=101", "age is '101', expected 0..100"},
        {"corroded:age=nan", "age is 'nan'"},
        {"corroded:corrosivity=mild", "very low, low, medium, high, very high"},
        {"corroded:starting_points=0", "starting_points is '0'"},
        {"corroded:starting_points=100000,extent_mm=10", "1..65536, the cells of the sheet"},
        {"corroded:extent_mm=2", "extent_mm is '2', expected 3.."},
        {"corroded:thickness_mm=0", "0.001..1000"},
        {"corroded:spot=0.5", "spot is '0.5', expected u/v"},
        {"corroded:spot=1.5/0", "spot is '1.5/0'"},
        {"corroded:surface=2", "surface is '2', expected 0..1"},
        {"corroded:surface=/no/such/map.png", "cannot read the map /no/such/map.png"},
        {"corroded:backing=white", "backing is 'white'"},
        {"corroded:rustiness=3", "unknown key 'rustiness'"},
        {"corroded:age=1,age=2", "age is given twice"},
        {"corroded:age", "not of the form key=value"},
        {"corroded:age=1,", "ends with a comma"}}) {
    const auto made = Sample::make(spec);
    INFO(spec);
    REQUIRE_FALSE(made.has_value());
    INFO(made.error().what);
    CHECK(made.error().what.find(part) != std::string::npos);
    CHECK_FALSE(made.error().remedy.empty());
  }
}

TEST_CASE("Weathered copper turns from metal to a green that does not shine") {
  const auto seen = [](const std::string& age) {
    const auto sample = Sample::make("patina:atmosphere=marine,extent_mm=6,age=" + age);
    REQUIRE(sample.has_value());
    const Footprint light{.diameter_mm = 3, .omega_i = from_spherical(radians(40), 0)};
    const auto brdf = (*sample)->surface().lit(light);
    std::array<std::array<double, 3>, 2> f{};
    (void)brdf->eval(light.omega_i, from_spherical(radians(40), scatter::reflectance::kPi), f[0]);
    (void)brdf->eval(light.omega_i, from_spherical(radians(40), 0.5), f[1]);
    return f;
  };
  const auto fresh = seen("0");
  const auto old = seen("60");
  CHECK(fresh[0][0] > 20 * fresh[1][0]);  // A peak,
  CHECK(fresh[0][0] > fresh[0][2]);       // copper-red;
  CHECK(old[0][0] < 0.2 * fresh[0][0]);   // none left,
  CHECK(old[1][1] > old[1][0]);           // green.
  const auto coarse = parse_patina("patina:side=100");
  REQUIRE_FALSE(coarse.has_value());
  CHECK(coarse.error().what.find("834..8192") != std::string::npos);
  CHECK_FALSE(Sample::make("patina:atmosphere=lunar").has_value());
  CHECK_FALSE(Sample::make("patina:corrosivity=medium").has_value());
}

TEST_CASE("All places of a sheet share one growth, and the text says where each is") {
  const std::size_t before = sheets_grown();
  const auto first = Sample::make(kSmall + ",spot=0.1/0.2+tilt=1@0");
  REQUIRE(first.has_value());
  CHECK((*first)->defects().tilt_rad > 0);
  CHECK((*first)->surface_spec() == kSmall + ",spot=0.1/0.2");
  const auto moved = (*first)->moved({0.7, 1.0 / 3});
  REQUIRE(moved != nullptr);
  CHECK(moved->defects().tilt_rad == (*first)->defects().tilt_rad);
  CHECK(moved->surface().place()->v == 0.333333);
  CHECK(moved->surface_spec() == kSmall + ",spot=0.7/0.333333");
  const auto again = Sample::make(moved->surface_spec());
  REQUIRE(again.has_value());
  CHECK(sheets_grown() == before + 1);
  // The same place by its text scatters alike; the other place does not.
  const Footprint light{.diameter_mm = 3, .omega_i = from_spherical(radians(20), 0)};
  std::array<double, 3> a{};
  std::array<double, 3> b{};
  std::array<double, 3> c{};
  const Direction wo = from_spherical(radians(25), 3.1);
  (void)moved->surface().lit(light)->eval(light.omega_i, wo, a);
  (void)(*again)->surface().lit(light)->eval(light.omega_i, wo, b);
  (void)(*first)->surface().lit(light)->eval(light.omega_i, wo, c);
  CHECK(a == b);
  CHECK(a != c);
  CHECK(Sample::make("lambertian:0.5").value()->moved({0.5, 0.5}) == nullptr);
}

TEST_CASE("A sample's truth has the spot of every incidence") {
  const auto truth = SampleBrdf::make(kSmall + ",spot=0.4/0.4");
  REQUIRE(truth.has_value());
  const auto sample = Sample::make(kSmall + ",spot=0.4/0.4");
  for (const double theta : {0.0, 20.0, 60.0, 20.0}) {
    const Direction wi = from_spherical(radians(theta), 0);
    const Direction wo = from_spherical(radians(33), 2.0);
    std::array<double, 3> seen{};
    std::array<double, 3> expected{};
    CHECK((*truth)->eval(wi, wo, seen) == scatter::reflectance::Origin::kMeasured);
    (void)(*sample)->surface().lit({.diameter_mm = 3, .omega_i = wi})->eval(wi, wo, expected);
    CHECK(seen == expected);
  }
  const auto tilted = SampleBrdf::make(kSmall + "+tilt=1@0");
  REQUIRE_FALSE(tilted.has_value());
  CHECK(tilted.error().what.find("defects") != std::string::npos);
}

TEST_CASE("Raw frames show the texture: places differ, and so do the spots of different incidences") {
  const auto sample = Sample::make(kSmall + ",spot=0.5/0.5");
  REQUIRE(sample.has_value());
  auto bench = Bench::make({.sample = *sample});
  REQUIRE(bench.has_value());
  const std::size_t width = (*bench)->descriptor().sensor.width_px;
  const auto frame = [&](std::uint8_t illumination) {
    std::vector<float> electrons(width * (*bench)->descriptor().sensor.height_px);
    (*bench)->expected_electrons({.illumination = illumination, .exposure_us = 1000}, electrons);
    double sum = 0;
    for (const float e : electrons) {
      sum += static_cast<double>(e);
    }
    return sum;
  };
  const double here = frame(0);
  CHECK(frame(0) == here);
  (*bench)->put((*sample)->moved({0.1, 0.9}));
  const double there = frame(0);
  CHECK(std::abs(there - here) > 0.01 * here);
  (*bench)->put(*sample);
  CHECK(frame(0) == here);
  // The light at 60 deg reaches rust or metal that the light from above does not: albedos differ.
  const auto share = [&](double theta) {
    const Footprint light{.diameter_mm = 3, .omega_i = from_spherical(radians(theta), 0)};
    const auto& surface = dynamic_cast<const TexturedSurface&>((*sample)->surface());
    double metal = 0;
    for (const SheetCell& cell :
         surface.sheet().cells(lit_cells(surface.sheet().side(), 10, {0.5, 0.5}, light))) {
      metal += cell.weight * cell.metal;
    }
    return metal;
  };
  CHECK(share(0) != share(60));
}

TEST_CASE("A spot of level and leaning metal is averaged over source and pixel to 5e-4 of its peak") {
  using namespace scatter::simulator::test;
  for (const double alpha : {0.05, 0.15}) {
    const auto sheet = made_sheet({.rust = 0.3, .depth_mm = 0.1}, {.metal_alpha = alpha});
    const Sample sample(std::make_shared<const TexturedSurface>(sheet, Place{0.3, 0.3}), {});
    const Head head{.towards = from_spherical(radians(30), 0), .angular_radius_rad = radians(0.5)};
    // HS-1's scale, a window on the mirror direction.
    constexpr std::size_t kWindow = 24;
    const double r = 184 * (radians(30) - std::pow(radians(30), 3) / 24 + std::pow(radians(30), 5) / 1920);
    const Lens lens({.center_x_px = kWindow / 2.0 + r,
                     .center_y_px = kWindow / 2.0,
                     .radius_px = 184,
                     .a1 = 1,
                     .a3 = -1.0 / 24,
                     .a5 = 1.0 / 1920,
                     .rotation_rad = 0,
                     .theta_max_rad = radians(80)});
    const auto image = [&](Fineness fineness) {
      std::vector<double> sum(kWindow * kWindow);
      for (const Aspect& aspect : Aspect::summands(sample, 3, head.towards)) {
        const LightImage light = integrate(lens, kWindow, kWindow, head, aspect, fineness);
        for (std::size_t k = 0; k < sum.size(); ++k) {
          sum[k] += static_cast<double>(light[1][k]);
        }
      }
      return sum;
    };
    const auto fast = image(Fineness::kAdaptive);
    const auto fine = image(Fineness::kFinest);
    const double peak = *std::max_element(fine.begin(), fine.end());
    // The window's border has no neighbours to take second differences from; a real image's lies beyond what
    // is measured.
    for (std::size_t y = 1; y + 1 < kWindow; ++y) {
      for (std::size_t x = 1; x + 1 < kWindow; ++x) {
        CHECK(std::abs(fast[y * kWindow + x] - fine[y * kWindow + x]) <= 5e-4 * peak);
      }
    }
  }
}
