#include "host_sdk/reflectance/adapted_brdf.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/compare.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"

using namespace scatter;
using namespace scatter::reflectance;

namespace {

std::shared_ptr<const Brdf> model(const std::string& spec) {
  return make_model(spec).value();
}

/// Error over the hemisphere at incidences that the tables have, and between them.
Comparison error_of(const Brdf& brdf, const Brdf& truth, std::vector<double> theta_deg) {
  GridLayout layout;
  layout.incidences.clear();
  for (const double deg : theta_deg) {
    layout.incidences.push_back({0, radians(deg), 0});
  }
  layout.theta_count = 81;
  layout.phi_count = 120;
  const GridBrdf grid = sample_on_grid(truth, layout).value();
  // compare() judges its first argument at that one's nodes.
  const GridBrdf mine = sample_on_grid(brdf, GridLayout::of(grid)).value();
  return compare(mine, grid, {.region = Region::kAll}).value();
}

}  // namespace

TEST_CASE("The adaptive form gives a model back within the stated error") {
  // Stated in docs/formats.md and adapted_brdf.h: 32 x 32 nodes, theta_o up to 80 deg.
  struct Case {
    const char* spec;
    double mean;
    double p99;
  };
  for (const Case& c :
       {Case{"lambertian:0.5", 0.01, 0.06}, Case{"ggx:alpha=0.1,f0=0.04,albedo=0.2", 0.02, 0.15},
        Case{"ggx:alpha=0.3,f0=0.04,albedo=0.2", 0.02, 0.1}, Case{"ggx:alpha=0.5,f0=0.9", 0.02, 0.15}}) {
    const auto truth = model(c.spec);
    const AdaptiveBrdf brdf = adapt(*truth).value();
    const Comparison at_nodes = error_of(brdf, *truth, {0, 20, 40, 60});
    const Comparison between = error_of(brdf, *truth, {5, 25, 45, 65});
    WARN(c.spec << ": at nodes mean " << at_nodes.mean_relative_error << " p99 "
                << at_nodes.p99_relative_error << " peak " << at_nodes.peak_ratio.value_or(0)
                << "; between mean " << between.mean_relative_error << " p99 " << between.p99_relative_error
                << " peak " << between.peak_ratio.value_or(0) << " by "
                << brdf.content().metadata.at("adaptive_ndf"));
    CHECK(at_nodes.mean_relative_error < c.mean);
    CHECK(at_nodes.p99_relative_error < c.p99);
  }
}

TEST_CASE("Projected area is 1 at the normal and that of GGX elsewhere") {
  // sigma(theta) = cos(theta) / G1(theta), Walter 2007 eq. 34; F0 1 takes the Fresnel term out.
  const double alpha = 0.4;
  const AdaptiveBrdf brdf = adapt(*model("ggx:alpha=0.4,f0=1")).value();
  const BilinearTables& sigma = brdf.content().sigma;
  for (const double deg : {0.0, 20.0, 40.0, 60.0, 80.0}) {
    const double x = std::sqrt(deg / 90);
    const double t = std::tan(radians(deg));
    const double g1 = 2 / (1 + std::sqrt(1 + alpha * alpha * t * t));
    const double found =
        bilinear(sigma.values.data(), sigma.width, cell_at(sigma.width, sigma.height, {x, 0.5}));
    // The model's own G is not that of eq. 8, and 2 % of the normals are spread evenly.
    CHECK(found == Approx(std::cos(radians(deg)) / g1).epsilon(0.05));
  }
}

TEST_CASE("Warps are their own inverses, and densities integrate to 1") {
  const AdaptiveBrdf brdf = adapt(*model("ggx:alpha=0.2,f0=0.04,albedo=0.1")).value();
  const BilinearWarp warp = BilinearWarp::make(brdf.vndf()).value();
  const TableMix mix{.table = {2, 3}, .weight = {0.3, 0.7}, .count = 2};
  double sum = 0;
  for (int r = 0; r < 254; ++r) {
    for (int c = 0; c < 254; ++c) {
      const SquarePoint at{(c + 0.5) / 254, (r + 0.5) / 254};
      sum += warp.density(at, mix) / (254.0 * 254.0);
      if (warp.density(at, mix) > 0.01) {
        const SquarePoint back = warp.sample(warp.invert(at, mix), mix);
        REQUIRE(back.x == Approx(at.x).margin(2e-4));
        REQUIRE(back.y == Approx(at.y).margin(2e-4));
      }
    }
  }
  REQUIRE(sum == Approx(1).epsilon(1e-3));
}

TEST_CASE("Sampling and its density agree: albedo by sampling equals albedo by quadrature") {
  for (const std::size_t azimuths : {1U, 9U}) {
    AdaptOptions options;
    options.azimuths = azimuths;
    const AdaptiveBrdf brdf = adapt(*model("ggx:alpha=0.3,f0=0.5,albedo=0.2"), options).value();
    const Direction i = from_spherical(radians(35), 0.7);
    const Albedo by_quadrature = albedo(brdf, i, {.tolerance = 1e-4});
    const int side = 200;
    double sum = 0;
    std::array<double, 3> f{};
    for (int r = 0; r < side; ++r) {
      for (int c = 0; c < side; ++c) {
        const Direction o = brdf.sample(i, {(c + 0.5) / side, (r + 0.5) / side});
        if (o.z <= 0) {
          continue;
        }
        REQUIRE(brdf.eval(i, o, f) != Origin::kInvalid);
        const double p = brdf.pdf(i, o);
        REQUIRE(p > 0);
        sum += f[0] * o.z / p / (side * side);
      }
    }
    CHECK(sum == Approx(by_quadrature.value[0]).epsilon(0.01));
  }
}

TEST_CASE("Where the retro-reflection is unknown the half vectors serve") {
  GridLayout layout;
  layout.phi_count = 180;
  GridBrdf::Content content =
      sample_on_grid(*model("ggx:alpha=0.2,f0=0.3,albedo=0.1"), layout).value().content();
  const GridBrdf whole = GridBrdf::make(content).value();
  for (GridPart& part : content.parts) {
    const Direction i = from_spherical(part.theta_i, part.phi_i);
    for (std::size_t n = 0; n < part.origin.size(); ++n) {
      if (angle_between(whole.omega_o(n), i) < radians(6)) {
        part.origin[n] = Origin::kInvalid;
      }
    }
  }
  const GridBrdf blind = GridBrdf::make(content).value();
  CHECK(adapt(whole).value().content().metadata.at("adaptive_ndf") == "retro-reflection");
  const AdaptiveBrdf brdf = adapt(blind).value();
  CHECK(brdf.content().metadata.at("adaptive_ndf") == "half vectors");
  const Comparison c = error_of(brdf, whole, {20, 40, 60});
  CHECK(c.mean_relative_error < 0.05);
  // What was never measured is not passed off as measured.
  std::array<double, 3> f{};
  const Direction i = from_spherical(radians(40), 0);
  CHECK(brdf.eval(i, i, f) == Origin::kExtrapolated);
}

TEST_CASE("An anisotropic material keeps its azimuths") {
  // Two rotations of a made-up material: brighter by 1 + cos(2 phi_i) / 2.
  GridLayout layout;
  layout.incidences.clear();
  for (int r = 0; r < 8; ++r) {
    for (const double deg : {0.0, 30.0, 60.0}) {
      layout.incidences.push_back({radians(45.0 * r), radians(deg), radians(45.0 * r)});
    }
  }
  layout.phi_count = 72;
  GridBrdf::Content content =
      sample_on_grid(*model("ggx:alpha=0.4,f0=0.3,albedo=0.1"), layout).value().content();
  for (GridPart& part : content.parts) {
    for (auto& plane : part.f_per_sr) {
      for (float& f : plane) {
        f *= static_cast<float>(1 + 0.5 * std::cos(2 * part.phi_i));
      }
    }
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  const AdaptiveBrdf brdf = adapt(grid).value();
  REQUIRE_FALSE(brdf.isotropic());
  std::array<double, 3> along{};
  std::array<double, 3> across{};
  for (const double phi : {0.0, 90.0}) {
    const Direction i = from_spherical(radians(30), radians(phi));
    REQUIRE(brdf.eval(i, mirrored(i), phi == 0 ? along : across) != Origin::kInvalid);
  }
  CHECK(along[0] / across[0] == Approx(3).epsilon(0.02));
}

TEST_CASE("The adaptive form refuses transmission, wrong options and emptiness") {
  CHECK(adapt(*model("film:transmittance=0.6,haze=0.3")).error().code == ErrorCode::kInvalidArgument);
  const auto lambert = model("lambertian:0.5");
  for (const AdaptOptions& options : {AdaptOptions{.resolution = 3}, AdaptOptions{.resolution = 100'000},
                                      AdaptOptions{.normals_resolution = 1}, AdaptOptions{.azimuths = 3},
                                      AdaptOptions{.theta_i = {0.5, 0.4}}, AdaptOptions{.theta_i = {kPi / 2}},
                                      AdaptOptions{.theta_i = {std::nan("")}}}) {
    CHECK(adapt(*lambert, options).error().code == ErrorCode::kInvalidArgument);
  }
  CHECK(adapt(*model("lambertian:0")).error().code == ErrorCode::kFailedPrecondition);
  CHECK(adapt(*model("lambertian:0"), {.theta_i = {0, radians(20)}}).error().what ==
        "adaptive form: every value is 0 at theta_i = 0, 20 deg");
  GridBrdf::Content content = sample_on_grid(*lambert, GridLayout()).value().content();
  for (GridPart& part : content.parts) {
    part.origin.assign(part.origin.size(), Origin::kInvalid);
  }
  const auto empty = adapt(GridBrdf::make(content).value(), {.theta_i = {0, radians(20)}}).error();
  CHECK(empty.what == "adaptive form: too few values to make a material of: none at theta_i = 0, 20 deg");
  CHECK(empty.remedy.find("--incidences") != std::string::npos);
  const auto mirror = adapt(*model("mirror:0.9")).error();
  CHECK(mirror.what.find("mirror direction alone") != std::string::npos);
}
