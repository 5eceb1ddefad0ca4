#include "host_sdk/reflectance/compare.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <string>

#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/peak.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

using namespace scatter::reflectance;
using scatter::ErrorCode;

namespace {

std::shared_ptr<const Brdf> model(const char* spec) {
  return make_model(spec).value();
}

GridBrdf grid_of(const char* spec) {
  GridLayout layout;
  layout.theta_count = 76;
  return sample_on_grid(*model(spec), layout).value();
}

}  // namespace

TEST_CASE("A grid sampled from a model equals the model") {
  const Comparison c =
      compare(grid_of("ggx:alpha=0.1,albedo=0.3"), *model("ggx:alpha=0.1,albedo=0.3")).value();
  REQUIRE(c.bins == 4 * 76 * 360);
  // float rounding: 2^-24
  REQUIRE(c.p99_relative_error < 6e-8);
  REQUIRE(c.cosine_weighted_rms_per_sr < 1e-6);
  REQUIRE(c.log_rms < 1e-6);
  REQUIRE(c.incidences.size() == 4);
  for (const auto& incidence : c.incidences) {
    REQUIRE(incidence.albedo_error < 1e-6);
  }
  REQUIRE(c.peak_angle_error_deg.value() < 1e-4);
  REQUIRE(c.peak_ratio.value() == Approx(1).epsilon(1e-6));
  REQUIRE_FALSE(c.reduced_chi_square.has_value());
}

TEST_CASE("A uniform excess of 3 % shows in every figure as the formulas say") {
  // Lambert against Lambert: closed forms throughout.
  const Comparison c = compare(grid_of("lambertian:0.515"), *model("lambertian:0.5")).value();
  REQUIRE(c.median_relative_error == Approx(0.03).margin(1e-7));
  REQUIRE(c.mean_relative_error == Approx(0.03).margin(1e-7));
  REQUIRE(c.p95_relative_error == Approx(0.03).margin(1e-7));
  REQUIRE(c.p99_relative_error == Approx(0.03).margin(1e-7));
  const double s = std::sin(radians(75.5));
  for (const auto& incidence : c.incidences) {
    REQUIRE(incidence.albedo_error == Approx(0.015 * s * s).epsilon(3e-4));
  }
  // Mean of cos^2 over the cap to 75.5 deg = (1 - c^3) / (3 (1 - c)).
  const double cap = std::cos(radians(75.5));
  const double rms = 0.015 / kPi * std::sqrt((1 - cap * cap * cap) / (3 * (1 - cap)));
  REQUIRE(c.cosine_weighted_rms_per_sr == Approx(rms).epsilon(1e-3));
  REQUIRE_FALSE(c.peak_angle_error_deg.has_value());
}

TEST_CASE("Percentiles weigh bins by solid angle") {
  GridBrdf::Content content = grid_of("lambertian:0.5").content();
  content.parts.resize(1);
  // Rows 0..18 hold (1 - cos 18.5 deg) / (1 - cos 75.5 deg) = 6.9 % of the solid angle: above 5 %.
  for (std::size_t n = 0; n < 19 * 360; ++n) {
    for (auto& plane : content.parts[0].f_per_sr) {
      plane[n] *= 1.1F;
    }
  }
  const Comparison c = compare(GridBrdf::make(content).value(), *model("lambertian:0.5")).value();
  REQUIRE(c.median_relative_error < 1e-6);
  REQUIRE(c.p95_relative_error == Approx(0.1).epsilon(1e-5));
  const double share = (1 - std::cos(radians(18.5))) / (1 - std::cos(radians(75.5)));
  REQUIRE(c.mean_relative_error == Approx(0.1 * share).epsilon(1e-4));
}

TEST_CASE("Chi-square is 1 and coverage 95 % when the noise is what the uncertainty says") {
  GridBrdf::Content content = grid_of("lambertian:0.5").content();
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  for (GridPart& part : content.parts) {
    part.random_per_sr.assign(3, std::vector<float>(part.origin.size(), 0.003F));
    part.systematic_per_sr.assign(3, std::vector<float>(part.origin.size(), 0.0F));
    for (auto& plane : part.f_per_sr) {
      for (float& f : plane) {
        f += static_cast<float>(0.003 * normal(generator));
      }
    }
  }
  const Comparison c = compare(GridBrdf::make(content).value(), *model("lambertian:0.5")).value();
  // 328,320 samples: standard error of the mean of chi-square sqrt(2/N) = 0.0025, of the share 0.0004.
  REQUIRE(c.reduced_chi_square.value() == Approx(1).margin(0.0125));
  REQUIRE(c.coverage_95.value() == Approx(0.95).margin(0.002));
}

TEST_CASE("A lobe turned by one degree has a peak error of one degree") {
  const auto truth = model("ggx:alpha=0.1,f0=0.04,albedo=0.3");
  GridLayout layout;
  layout.incidences = {{0, radians(20), 0}, {0, radians(40), 0}};
  const GridBrdf straight = sample_on_grid(*truth, layout).value();
  GridBrdf::Content turned = straight.content();
  for (GridPart& part : turned.parts) {
    for (auto& plane : part.f_per_sr) {
      std::vector<float> shifted(plane.size());
      for (std::size_t n = 0; n < plane.size(); ++n) {
        shifted[n] = plane[n / 360 * 360 + (n + 1) % 360] * 2.0F;
      }
      plane = shifted;
    }
  }
  const Comparison c = compare(GridBrdf::make(turned).value(), *truth).value();
  // A turn by 1 deg about the normal moves a point at theta by about sin(theta) deg; the peak of f
  // lies within 1.3 deg of the mirror direction.
  REQUIRE(c.incidences[0].peak_angle_error_deg.value() == Approx(std::sin(radians(20))).margin(0.023));
  REQUIRE(c.incidences[1].peak_angle_error_deg.value() == Approx(std::sin(radians(40))).margin(0.023));
  REQUIRE(c.peak_ratio.value() == Approx(2).epsilon(1e-3));
}

TEST_CASE("A peak at the pole is found as well as anywhere else") {
  GridLayout layout;
  layout.incidences = {{0, 0, 0}, {0, radians(30), radians(77)}};
  const GridBrdf grid = sample_on_grid(*model("ggx:alpha=0.08,f0=0.5"), layout).value();
  std::vector<Direction> node;
  std::vector<double> weight;
  for (std::size_t n = 0; n < grid.content().parts[0].origin.size(); ++n) {
    node.push_back(grid.omega_o(n));
    weight.push_back(grid.solid_angle_sr(n));
  }
  for (std::size_t p = 0; p < 2; ++p) {
    const auto& plane = grid.content().parts[p].f_per_sr[0];
    const std::vector<double> value(plane.begin(), plane.end());
    const auto peak = find_peak(node, weight, value);
    REQUIRE(peak.has_value());
    // At normal incidence exactly the mirror direction; else f peaks within 1.3 deg of it.
    REQUIRE(degrees(angle_between(peak->at, mirrored(grid.omega_i(p)))) < (p == 0 ? 1e-6 : 1.3));
  }
}

TEST_CASE("Bins that either side did not measure do not count") {
  GridBrdf::Content content = grid_of("lambertian:0.5").content();
  content.parts[0].origin[400] = Origin::kInterpolated;
  content.parts[1].origin[500] = Origin::kInvalid;
  const GridBrdf a = GridBrdf::make(content).value();
  const auto b = model("lambertian:0.5");
  REQUIRE(compare(a, *b).value().bins == 4 * 76 * 360 - 2);
  REQUIRE(compare(a, *b, {.region = Region::kAll}).value().bins == 4 * 76 * 360 - 1);
  // The other way round the grid is the reference: the same nodes, and only invalid and
  // extrapolated references are left out.
  REQUIRE(compare(*b, a).value().bins == 4 * 76 * 360 - 1);
}

TEST_CASE("One channel against three is matched by wavelength; a BTDF is not held against a BRDF") {
  GridBrdf::Content green;
  {
    GridBrdf::Content all = grid_of("lambertian:0.2/0.4/0.6").content();
    green = all;
    green.channels = 1;
    green.wavelengths_nm = {532};
    for (GridPart& part : green.parts) {
      part.f_per_sr = {part.f_per_sr[1]};
    }
  }
  const GridBrdf grid = GridBrdf::make(green).value();
  REQUIRE(compare(grid, *model("lambertian:0.2/0.4/0.6")).value().p99_relative_error < 1e-6);
  REQUIRE(compare(grid, *model("film:transmittance=0.4,haze=1")).error().code == ErrorCode::kInvalidArgument);
}

TEST_CASE("Files of one channel and of many compare either way round") {
  GridBrdf::Content mono = grid_of("lambertian:0.4").content();
  mono.channels = 1;
  mono.wavelengths_nm.clear();
  for (GridPart& part : mono.parts) {
    part.f_per_sr.resize(1);
  }
  const GridBrdf one = GridBrdf::make(mono).value();
  const GridBrdf three = grid_of("lambertian:0.2/0.4/0.8");
  // |a - b| / b over the pairs (0.2, 0.4), (0.4, 0.4), (0.8, 0.4) and back.
  const Comparison down = compare(three, one).value();
  REQUIRE(down.channels.by == ChannelMatch::By::kOneForAll);
  REQUIRE(down.mean_relative_error == Approx((0.5 + 0 + 1) / 3).epsilon(1e-6));
  const Comparison up = compare(one, three).value();
  REQUIRE(up.channels.by == ChannelMatch::By::kOneForAll);
  REQUIRE(up.mean_relative_error == Approx((1 + 0 + 0.5) / 3).epsilon(1e-6));
}

TEST_CASE("Three channels without wavelengths stand against those nearest to red, green and blue") {
  // What a MERL file of a spectral measurement holds, against the measurement.
  GridBrdf::Content spectral = grid_of("lambertian:0.5").content();
  spectral.channels = 5;
  spectral.wavelengths_nm = {450, 500, 550, 600, 650};
  GridBrdf::Content rgb = grid_of("lambertian:0.5").content();
  rgb.wavelengths_nm.clear();
  for (std::size_t p = 0; p < rgb.parts.size(); ++p) {
    const std::vector<float> plane = spectral.parts[p].f_per_sr[0];
    spectral.parts[p].f_per_sr.clear();
    for (const float level : {0.1F, 0.2F, 0.3F, 0.4F, 0.5F}) {
      spectral.parts[p].f_per_sr.emplace_back(plane.size(), level);
    }
    rgb.parts[p].f_per_sr = {std::vector<float>(plane.size(), 0.5F), std::vector<float>(plane.size(), 0.3F),
                             std::vector<float>(plane.size(), 0.1F)};
  }
  const GridBrdf a = GridBrdf::make(rgb).value();
  const GridBrdf b = GridBrdf::make(spectral).value();
  const Comparison c = compare(a, b).value();
  REQUIRE(c.channels.by == ChannelMatch::By::kAssumedRgb);
  REQUIRE(c.p99_relative_error == 0);
  // Back: 500 nm lies between green and blue, 600 between red and green; the first of equals counts.
  const Comparison back = compare(b, a).value();
  REQUIRE(back.channels.pairs.size() == 5);
  REQUIRE(back.channels.pairs[0].b == 2);
  REQUIRE(back.channels.pairs[2].b == 1);
  REQUIRE(back.channels.pairs[4].b == 0);
  // Four channels of nothing known cannot be matched with five.
  GridBrdf::Content four = rgb;
  four.channels = 4;
  for (GridPart& part : four.parts) {
    part.f_per_sr.push_back(part.f_per_sr[0]);
  }
  const auto refused = compare(GridBrdf::make(four).value(), b);
  REQUIRE(refused.error().code == ErrorCode::kInvalidArgument);
  REQUIRE(refused.error().what.find("4 channels against 5, and the one judged") != std::string::npos);
}

TEST_CASE("A mirror that one of two lacks is an albedo error and named, although no bin holds it") {
  const auto mirror = model("mirror:0.9");
  GridBrdf::Content black = grid_of("lambertian:0.5").content();
  for (GridPart& part : black.parts) {
    for (auto& plane : part.f_per_sr) {
      std::ranges::fill(plane, 0.0F);
    }
  }
  const Comparison c = compare(GridBrdf::make(black).value(), *mirror, {.region = Region::kAll}).value();
  REQUIRE_FALSE(c.relative_errors_known);
  for (const auto& incidence : c.incidences) {
    REQUIRE(incidence.albedo_error == Approx(0.9));
    REQUIRE(incidence.dirac_a == 0);
    REQUIRE(incidence.dirac_b == Approx(0.9));
  }
  // Judged the other way round it is sampled on a grid, which must not lose it.
  const Comparison back = compare(*mirror, GridBrdf::make(black).value(), {.region = Region::kAll}).value();
  REQUIRE(back.incidences[0].albedo_error == Approx(0.9));
  REQUIRE(back.incidences[0].dirac_a == Approx(0.9));
  const Comparison same = compare(*mirror, *mirror, {.region = Region::kAll}).value();
  REQUIRE(same.incidences[0].albedo_error == 0);
}

TEST_CASE("Two grids about the mirror direction are compared at their own incidences") {
  SpecularGridBrdf::Content content;
  content.plane_symmetric = true;
  content.rotation = {0};
  content.theta_i = {radians(15), radians(75)};
  for (int k = 0; k <= 180; k += 10) {
    content.azimuth.push_back(radians(k));
  }
  for (int k = 0; k <= 80; k += 10) {
    content.radial.push_back(radians(k));
  }
  content.f_per_sr.assign(1, std::vector<float>(2 * 19 * 9, 0.25F));
  const SpecularGridBrdf b = SpecularGridBrdf::make(content).value();
  content.f_per_sr.assign(1, std::vector<float>(2 * 19 * 9, 0.5F));
  const SpecularGridBrdf a = SpecularGridBrdf::make(content).value();
  const auto check = [](const Comparison& c, double error) {
    REQUIRE(c.incidences.size() == 2);
    REQUIRE(degrees(c.incidences[0].theta_i) == Approx(15));
    REQUIRE(degrees(c.incidences[1].theta_i) == Approx(75));
    REQUIRE(c.mean_relative_error == Approx(error).margin(1e-6));
    REQUIRE(c.incidences[0].bins > 0);
    REQUIRE(c.incidences[1].bins > 0);
  };
  check(compare(a, b).value(), 1);
  // A model has no incidences of its own: those of the reference count.
  check(compare(*model("lambertian:0.7853981634"), b, {.region = Region::kMeasured}).value(), 0);
}

TEST_CASE("Two models compare on the default grid, films on the lower side") {
  const Comparison c = compare(*model("lambertian:0.5"), *model("lambertian:0.4")).value();
  REQUIRE(c.bins == 4 * 91 * 360);
  REQUIRE(c.mean_relative_error == Approx(0.25).epsilon(1e-6));
  const Comparison film =
      compare(*model("film:transmittance=0.6,haze=0.5"), *model("film:transmittance=0.5,haze=0.5")).value();
  REQUIRE(film.mean_relative_error == Approx(0.2).epsilon(1e-6));
}
