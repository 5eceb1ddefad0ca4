#include "host_sdk/reflectance/fitting/fit.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "tests/unit/reflectance_fitting/made_samples.h"

namespace scatter::reflectance {
namespace {

using test::add_noise;
using test::samples_of;

const FitParameter& parameter(const FitResult& result, const std::string& name,
                              std::size_t channel = FitParameter::kShared) {
  for (const FitParameter& p : result.parameters) {
    if (p.name == name && p.channel == channel) {
      return p;
    }
  }
  FAIL("no parameter " << name);
  return result.parameters.front();
}

FitResult fitted(const FitSamples& samples, const std::string& family, const FitOptions& options = {}) {
  auto result = fit(samples, fit_family(family).value(), options);
  if (!result) {
    FAIL(result.error().what);
  }
  return *result;
}

/// A truth that the family can be, and what the fit must then find.
struct Case {
  std::string family;
  std::string truth;
  std::vector<std::pair<std::string, double>> shared;
  std::vector<std::pair<std::string, std::array<double, 3>>> colours;
};

const std::vector<Case> kCases{
    {"lambert", "lambertian:0.1/0.5/0.9", {}, {{"albedo", {0.1, 0.5, 0.9}}}},
    {"oren-nayar",
     "oren-nayar:albedo=0.3/0.4/0.5,sigma=0.5",
     {{"sigma", 0.5}},
     {{"albedo", {0.3, 0.4, 0.5}}}},
    {"ggx",
     "ggx:alpha=0.3,f0=0.04,albedo=0.2",
     {{"alpha", 0.3}},
     {{"f0", {0.04, 0.04, 0.04}}, {"albedo", {0.2, 0.2, 0.2}}}},
    {"ggx",
     "ggx:alpha=0.05,f0=0.9/0.6/0.3,albedo=0.02",
     {{"alpha", 0.05}},
     {{"f0", {0.9, 0.6, 0.3}}, {"albedo", {0.02, 0.02, 0.02}}}},
    {"beckmann",
     "beckmann:alpha=0.25,f0=0.1/0.2/0.3,albedo=0.3",
     {{"alpha", 0.25}},
     {{"f0", {0.1, 0.2, 0.3}}, {"albedo", {0.3, 0.3, 0.3}}}},
    {"cook-torrance",
     "cook-torrance:m=0.3,f0=0.2,ks=0.2,albedo=0.1/0.2/0.3",
     {{"m", 0.3}, {"ks", 0.2}},
     {{"f0", {0.2, 0.2, 0.2}}, {"albedo", {0.1, 0.2, 0.3}}}},
    {"ward",
     "ward:alpha=0.15,ks=0.1/0.2/0.3,albedo=0.4",
     {{"alpha", 0.15}},
     {{"ks", {0.1, 0.2, 0.3}}, {"albedo", {0.4, 0.4, 0.4}}}},
    {"lafortune",
     "lafortune:n=40,ks=0.1/0.2/0.3,albedo=0.4",
     {{"n", 40}},
     {{"ks", {0.1, 0.2, 0.3}}, {"albedo", {0.4, 0.4, 0.4}}}},
    {"oren-nayar+ggx",
     "sum:oren-nayar:albedo=0.4,sigma=0.6,ggx:alpha=0.2,f0=0.05",
     {{"sigma", 0.6}, {"alpha", 0.2}},
     {{"f0", {0.05, 0.05, 0.05}}, {"albedo", {0.4, 0.4, 0.4}}}},
    {"ggx2",
     "sum:lambertian:0.2,ggx:alpha=0.08,f0=0.1/0.2/0.3,weight=0.4,ggx:alpha=0.4,f0=0.1/0.2/0.3,weight=0.5",
     {{"alpha1", 0.08}, {"weight1", 0.4}, {"alpha2", 0.4}, {"weight2", 0.5}},
     {{"f01", {0.1, 0.2, 0.3}}, {"f02", {0.1, 0.2, 0.3}}, {"albedo", {0.2, 0.2, 0.2}}}},
    {"ward2",
     "sum:lambertian:0.2,ward:alpha=0.06,ks=0.1,ward:alpha=0.3,ks=0.2/0.3/0.4",
     {{"alpha1", 0.06}, {"alpha2", 0.3}},
     {{"ks1", {0.1, 0.1, 0.1}}, {"ks2", {0.2, 0.3, 0.4}}, {"albedo", {0.2, 0.2, 0.2}}}},
    {"disney",
     "disney:base=0.6/0.4/0.2,roughness=0.45,metallic=0.3,specular=0.6",
     {{"roughness", 0.45}, {"metallic", 0.3}, {"specular", 0.6}},
     {{"base", {0.6, 0.4, 0.2}}}},
};

}  // namespace

TEST_CASE("Every family finds the parameters of a material of its own kind", "[fit]") {
  for (const Case& c : kCases) {
    CAPTURE(c.family, c.truth);
    for (const Residual residual : {Residual::kLog, Residual::kCubeRoot}) {
      const FitResult result = fitted(samples_of(c.truth, 1500), c.family, {.residual = residual});
      // Exact data: what is left is where the search stops (parameter tolerance 1e-9 per step).
      for (const auto& [name, value] : c.shared) {
        CAPTURE(name);
        CHECK(parameter(result, name).value == Approx(value).epsilon(1e-4));
        CHECK(parameter(result, name).standing == Standing::kDetermined);
      }
      for (const auto& [name, value] : c.colours) {
        for (std::size_t channel = 0; channel < 3; ++channel) {
          CAPTURE(name, channel);
          CHECK(parameter(result, name, channel).value == Approx(value[channel]).epsilon(1e-4).margin(1e-6));
        }
      }
      CHECK(result.mean_relative_error < 1e-5);
    }
  }
}

TEST_CASE("The spec of a fit makes the same BRDF", "[fit]") {
  for (const Case& c : kCases) {
    FitSamples samples = samples_of(c.truth, 400);
    add_noise(samples, 0.02, 0, 3);
    const FitResult result = fitted(samples, c.family);
    CAPTURE(result.spec);
    const auto again = make_model(result.spec);
    REQUIRE(again);
    for (std::size_t k = 0; k < samples.incidences[2].count; k += 7) {
      const Direction omega_i = from_spherical(samples.incidences[2].theta_i, 0.3);
      const Direction& omega_o = samples.omega_o[samples.incidences[2].first + k];
      std::array<double, 3> a{};
      std::array<double, 3> b{};
      (void)result.model->eval(omega_i, omega_o, a);
      (void)(*again)->eval(omega_i, omega_o, b);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        REQUIRE(a[channel] == Approx(b[channel]).epsilon(1e-8));
      }
    }
  }
}

TEST_CASE("Intervals of 95 % hold the truth in about 95 of 100 noisy measurements", "[fit]") {
  // 200 seeds and 7 parameters; a count of n = 1400 tries at p = 0.95 has a standard deviation of 8
  // (0.6 %); parameters of one fit are correlated, so 3 % either way is allowed, and 5 of 100 for one.
  struct Noise {
    Residual residual;
    double relative;
    double additive;
  };
  const FitSamples clean = samples_of("ggx:alpha=0.3,f0=0.04/0.1/0.2,albedo=0.2", 150);
  const std::vector<std::pair<std::string, std::array<double, 3>>> truth{{"f0", {0.04, 0.1, 0.2}},
                                                                         {"albedo", {0.2, 0.2, 0.2}}};
  for (const Noise& noise : {Noise{Residual::kLog, 0.05, 0}, Noise{Residual::kLog, 0.01, 0.004},
                             Noise{Residual::kCubeRoot, 0.05, 0}, Noise{Residual::kUncertainty, 0, 0.005}}) {
    constexpr int kSeeds = 200;
    int alpha_inside = 0;
    int inside = 0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      FitSamples samples = clean;
      add_noise(samples, noise.relative, noise.additive, 1000 + static_cast<std::uint64_t>(seed));
      if (noise.residual == Residual::kUncertainty) {
        samples.sigma_per_sr.assign(samples.f_per_sr.size(), noise.additive);
      }
      const FitResult result = fitted(samples, "ggx", {.residual = noise.residual, .starts = 1});
      const FitParameter& alpha = parameter(result, "alpha");
      alpha_inside += alpha.low_95 <= 0.3 && 0.3 <= alpha.high_95 ? 1 : 0;
      for (const auto& [name, values] : truth) {
        for (std::size_t c = 0; c < 3; ++c) {
          const FitParameter& p = parameter(result, name, c);
          inside += p.low_95 <= values[c] && values[c] <= p.high_95 ? 1 : 0;
        }
      }
      if (noise.residual == Residual::kUncertainty) {
        CHECK(*result.reduced_chi_square == Approx(1).margin(0.15));  // 1793 degrees: sd 0.033
      }
    }
    CAPTURE(static_cast<int>(noise.residual), noise.relative, noise.additive);
    CHECK(alpha_inside / 200.0 == Approx(0.95).margin(0.05));
    CHECK(inside / 1200.0 == Approx(0.95).margin(0.03));
  }
}

TEST_CASE("A lobe that is not there is said to be undetermined", "[fit]") {
  FitSamples samples = samples_of("lambertian:0.4", 400);
  add_noise(samples, 0.01, 0, 9);
  const FitResult result = fitted(samples, "ward");
  for (std::size_t c = 0; c < 3; ++c) {
    const FitParameter& ks = parameter(result, "ks", c);
    CHECK(ks.value < 0.02);
    CHECK(parameter(result, "albedo", c).value == Approx(0.4).epsilon(0.02));
  }
  bool said = false;
  for (const FitParameter& p : result.parameters) {
    said = said || p.standing != Standing::kDetermined;
  }
  CHECK(said);
  CHECK_FALSE(result.remarks.empty());
}

TEST_CASE("Two lobes for one are said to be undetermined", "[fit]") {
  const FitResult result = fitted(samples_of("ggx:alpha=0.3,f0=0.04,albedo=0.2", 1000), "ggx2");
  bool said = false;
  for (const FitParameter& p : result.parameters) {
    said = said || p.standing != Standing::kDetermined;
  }
  CHECK(said);
}

TEST_CASE("A parameter that the data push out of its range stands at the bound and says so", "[fit]") {
  // Twice the light that an albedo of 1 gives.
  FitSamples samples = samples_of("lambertian:1", 300);
  for (double& f : samples.f_per_sr) {
    f *= 2;
  }
  const FitResult result = fitted(samples, "lambert");
  const FitParameter& albedo = parameter(result, "albedo", 1);
  CHECK(albedo.value == Approx(1));
  CHECK(albedo.standing == Standing::kAtUpperBound);
  CHECK(albedo.sigma == 0);
}

TEST_CASE("The loss per incidence is that of the model against the samples", "[fit]") {
  // Samples 10 % brighter than a Lambertian at one incidence, 10 % darker at the other.
  FitSamples samples = samples_of("lambertian:0.5", 200, {10, 50});
  for (std::size_t k = 0; k < samples.f_per_sr.size(); ++k) {
    samples.f_per_sr[k] *= k < samples.f_per_sr.size() / 2 ? 1.1 : 0.9;
  }
  const auto found = losses(**make_model("lambertian:0.5"), samples).value();
  REQUIRE(found.size() == 2);
  CHECK(found[0].theta_i == Approx(radians(10)));
  CHECK(found[0].samples == 200);
  CHECK(found[0].mean_relative_error == Approx(0.1 / 1.1));
  CHECK(found[1].mean_relative_error == Approx(0.1 / 0.9));
  CHECK(found[0].relative_flux_error == Approx(0.1 / 1.1));
  // e is a thousandth of the median: it moves the logarithm by no more.
  CHECK(found[0].rms_residual == Approx(std::log(1.1)).epsilon(2e-3));
}

TEST_CASE("Any number of channels is fitted, with the shape shared by all", "[fit]") {
  const FitSamples three = samples_of("ggx:alpha=0.2,f0=0.05/0.1/0.2,albedo=0.3", 300);
  FitSamples samples = three;
  samples.channels = 9;
  samples.f_per_sr.clear();
  for (std::size_t k = 0; k < three.size(); ++k) {
    for (std::size_t c = 0; c < 9; ++c) {
      samples.f_per_sr.push_back(three.f_per_sr[k * 3 + c % 3]);
    }
  }
  const FitResult result = fitted(samples, "ggx");
  CHECK(parameter(result, "alpha").value == Approx(0.2).epsilon(1e-4));
  CHECK(parameter(result, "f0", 8).value == Approx(0.2).epsilon(1e-4));
  CHECK(result.spec.empty());
  CHECK(result.model->channels() == 9);
}

TEST_CASE("Samples that cannot be fitted are refused with the reason", "[fit]") {
  const FitFamily ggx = fit_family("ggx").value();
  const FitSamples good = samples_of("ggx:alpha=0.3,albedo=0.2", 50);
  const auto code = [&](const FitSamples& samples, const FitOptions& options = {}) {
    const auto result = fit(samples, ggx, options);
    REQUIRE_FALSE(result);
    CHECK_FALSE(result.error().remedy.empty());
    return result.error().code;
  };
  SECTION("too few") {
    CHECK(code(samples_of("ggx:alpha=0.3,albedo=0.2", 1)) == ErrorCode::kInvalidArgument);
  }
  SECTION("none") {
    CHECK(code(FitSamples{}) == ErrorCode::kInvalidArgument);
  }
  SECTION("not a number") {
    FitSamples samples = good;
    samples.f_per_sr[7] = std::numeric_limits<double>::quiet_NaN();
    CHECK(code(samples) == ErrorCode::kInvalidArgument);
  }
  SECTION("all zero") {
    FitSamples samples = good;
    samples.f_per_sr.assign(samples.f_per_sr.size(), 0.0);
    CHECK(code(samples) == ErrorCode::kFailedPrecondition);
  }
  SECTION("negative") {
    FitSamples samples = good;
    for (double& f : samples.f_per_sr) {
      f = -f;
    }
    CHECK(code(samples) == ErrorCode::kFailedPrecondition);
  }
  SECTION("below the horizon") {
    FitSamples samples = good;
    samples.omega_o[3].z *= -1;
    CHECK(code(samples) == ErrorCode::kInvalidArgument);
  }
  SECTION("no uncertainty where one is needed") {
    CHECK(code(good, {.residual = Residual::kUncertainty}) == ErrorCode::kInvalidArgument);
  }
  SECTION("no start") {
    CHECK(code(good, {.starts = 0}) == ErrorCode::kInvalidArgument);
  }
  SECTION("stopped") {
    std::stop_source stop;
    stop.request_stop();
    CHECK(code(good, {.stop = stop.get_token()}) == ErrorCode::kAborted);
  }
}

TEST_CASE("One incidence is fitted, and said to be a guess elsewhere", "[fit]") {
  const FitResult result = fitted(samples_of("ggx:alpha=0.3,f0=0.3,albedo=0.2", 800, {30}), "ggx");
  CHECK(parameter(result, "alpha").value == Approx(0.3).epsilon(1e-3));
  REQUIRE_FALSE(result.remarks.empty());
  CHECK(result.remarks.back().find("one incidence") != std::string::npos);
}

TEST_CASE("Scattered negative values among noise do not move the fit", "[fit]") {
  // A dark channel whose noise often passes zero: the estimate with known sigma stays unbiased.
  FitSamples samples = samples_of("lambertian:0.003", 2000);
  add_noise(samples, 0, 0.001, 4);
  samples.sigma_per_sr.assign(samples.f_per_sr.size(), 0.001);
  const FitResult result = fitted(samples, "lambert", {.residual = Residual::kUncertainty});
  // sigma of the mean of 8000 values of 0.001 is 1.1e-5 1/sr, times pi 3.5e-5.
  CHECK(parameter(result, "albedo", 0).value == Approx(0.003).margin(4 * 3.5e-5));
  CHECK(parameter(result, "albedo", 0).sigma == Approx(3.5e-5).epsilon(0.1));
}

}  // namespace scatter::reflectance
