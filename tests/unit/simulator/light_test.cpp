#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "host_sdk/reflectance/models/model_spec.h"
#include "simulator/bench/light.h"

namespace {

using namespace scatter::simulator;
using scatter::reflectance::from_spherical;
using scatter::reflectance::kPi;
using scatter::reflectance::make_model;
using scatter::reflectance::radians;
using Vector = scatter::reflectance::Direction;

/// HS-1's lens with the image moved so that `seen` falls on the middle of a size x size window.
LensParameters window_on(double theta, double phi, double size) {
  LensParameters p{.center_x_px = 0,
                   .center_y_px = 0,
                   .radius_px = 184,
                   .a1 = 1,
                   .a3 = -1.0 / 24,
                   .a5 = 1.0 / 1920,
                   .rotation_rad = 0.1,
                   .theta_max_rad = radians(80)};
  const double r = 184 * (theta - std::pow(theta, 3) / 24 + std::pow(theta, 5) / 1920);
  p.center_x_px = size / 2 - r * std::cos(phi + 0.1);
  p.center_y_px = size / 2 - r * std::sin(phi + 0.1);
  return p;
}

std::shared_ptr<const Sample> sample(const std::string& spec) {
  auto made = Sample::make(spec);
  REQUIRE(made.has_value());
  return *made;
}

/// Direction that images at (x, y), by bisection of the lens formula.
Vector direction_at(const LensParameters& p, double x, double y) {
  const double dx = x - p.center_x_px;
  const double dy = y - p.center_y_px;
  const double r = std::hypot(dx, dy);
  double low = 0;
  double high = radians(90);
  for (int i = 0; i < 60; ++i) {
    const double t = (low + high) / 2;
    (p.radius_px * (p.a1 * t + p.a3 * std::pow(t, 3) + p.a5 * std::pow(t, 5)) < r ? low : high) = t;
  }
  return from_spherical(low, std::atan2(dy, dx) - p.rotation_rad);
}

/// Brute force: f cos(theta_i) over 20 x 20 points of the pixel and 400 points of the disc.
double brute_force(const scatter::reflectance::Brdf& brdf, const LensParameters& lens, double theta_i, int x,
                   int y) {
  constexpr int kSource = 400;
  constexpr int kPixel = 20;
  const double radius = radians(0.5);
  std::vector<Vector> to;
  for (int k = 0; k < kPixel * kPixel; ++k) {
    to.push_back(direction_at(lens, x + (k % kPixel + 0.5) / kPixel, y + (k / kPixel + 0.5) / kPixel));
  }
  double sum = 0;
  for (int s = 0; s < kSource; ++s) {
    // Sunflower pattern about z, each point with its opposite so that its middle is exact, turned to
    // the head about y.
    const double rho = radius * std::sqrt((s / 2 + 0.5) / (kSource / 2));
    const Vector local = from_spherical(rho, (s / 2) * kPi * (3 - std::sqrt(5.0)) + (s % 2) * kPi);
    const Vector w{local.x * std::cos(theta_i) + local.z * std::sin(theta_i), local.y,
                   local.z * std::cos(theta_i) - local.x * std::sin(theta_i)};
    for (const Vector& camera : to) {
      double f[3];
      (void)brdf.eval(w, camera, f);
      sum += f[0] * w.z;
    }
  }
  return sum / (kSource * kPixel * kPixel);
}

}  // namespace

TEST_CASE("Lens maps a direction to its image and back") {
  const LensParameters p = window_on(0.6, 1.0, 480);
  const Lens lens(p);
  for (double theta = 0; theta < radians(80); theta += 0.037) {
    const Vector w = from_spherical(theta, 2.3 + theta);
    const Lens::Point at = lens.image(w);
    const Vector back = lens.direction(at.x_px, at.y_px);
    CHECK(std::abs(dot(back, back) - 1) < 1e-7);
    CHECK(angle_between(back, w) < 2e-8);
  }
}

TEST_CASE("Light of a pixel agrees with brute force within 0.05 percent for alpha 0.05 and above") {
  for (const double theta_i_deg : {0.0, 20.0, 60.0}) {
    const double theta_i = radians(theta_i_deg);
    const LensParameters p = window_on(theta_i, kPi, 90);
    const Lens lens(p);
    const Head head{from_spherical(theta_i, 0), radians(0.5)};
    for (const std::string spec : {"ggx:alpha=0.05,f0=0.04,albedo=0.1", "ggx:alpha=0.2,f0=0.04,albedo=0.3"}) {
      const Aspect aspect(*sample(spec), 3, head.towards);
      const LightImage light = integrate(lens, 90, 90, head, aspect);
      const auto model = *make_model(spec);
      for (const auto& [x, y] : {std::pair{45, 45}, {50, 45}, {45, 57}, {36, 40}, {70, 70}}) {
        const double truth = brute_force(*model, p, theta_i, x, y);
        CAPTURE(spec, theta_i_deg, x, y);
        CHECK(light[0][static_cast<std::size_t>(y * 90 + x)] == Approx(truth).epsilon(3e-4));
      }
    }
  }
}

TEST_CASE("The adaptive rule stays within 0.05 percent of the finest in every pixel") {
  for (const double theta_i_deg : {0.0, 60.0}) {
    const LensParameters p = window_on(radians(theta_i_deg), kPi, 60);
    const Lens lens(p);
    const Head head{from_spherical(radians(theta_i_deg), 0), radians(0.5)};
    for (const std::string spec : {"ggx:alpha=0.05,f0=0.04,albedo=0.1", "ggx:alpha=0.1,f0=0.5",
                                   "ggx:alpha=0.3,f0=0.04,albedo=0.02+tilt=1@30"}) {
      const Aspect aspect(*sample(spec), 3, head.towards);
      const LightImage quick = integrate(lens, 60, 60, head, aspect);
      const LightImage finest = integrate(lens, 60, 60, head, aspect, Fineness::kFinest);
      double worst = 0;
      for (std::size_t i = 0; i < quick[0].size(); ++i) {
        if (finest[0][i] > 0) {
          worst = std::max(worst, std::abs(double{quick[0][i]} / double{finest[0][i]} - 1));
        }
      }
      CAPTURE(spec, theta_i_deg);
      CHECK(worst < 5e-4);
      CHECK(worst > 0);
    }
  }
}

TEST_CASE("A Lambertian shows rho / pi times the mean cosine in every pixel of the image") {
  const LensParameters p = window_on(0, 0, 480);
  const Head head{from_spherical(radians(60), 0), radians(0.5)};
  const LightImage light =
      integrate(Lens(p), 480, 480, head, Aspect(*sample("lambertian:0.5"), 3, head.towards));
  const double expected = 0.5 / kPi * mean_cosine(head);
  // The disc's cosine is its middle's, less a share of radius^2 / 4.
  CHECK(mean_cosine(head) == Approx(0.5).epsilon(3e-5));
  std::size_t seen = 0;
  for (const float value : light[1]) {
    if (value != 0) {
      ++seen;
      REQUIRE(value == Approx(expected).epsilon(3e-5));
    }
  }
  // The image's disc: pi r(80 deg)^2 pixels.
  const double t = radians(80);
  CHECK(static_cast<double>(seen) ==
        Approx(kPi * std::pow(184 * (t - std::pow(t, 3) / 24 + std::pow(t, 5) / 1920), 2)).epsilon(2e-3));
}

TEST_CASE("Light that goes straight through a film keeps its power") {
  for (const double theta_deg : {160.0, 140.0}) {
    const Head head{from_spherical(radians(theta_deg), 0), radians(0.5)};
    const LensParameters p = window_on(radians(180 - theta_deg), kPi, 40);
    const Aspect aspect(*sample("film:transmittance=0.6,haze=0"), 3, head.towards);
    const LightImage light = integrate(Lens(p), 40, 40, head, aspect);
    // Solid angle of a pixel from the lens formula: sin(theta) dtheta dphi over r dr dphi.
    double power = 0;
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 40; ++x) {
        const Vector w = direction_at(p, x + 0.5, y + 0.5);
        const double t = theta_of(w);
        const double r = std::hypot(x + 0.5 - p.center_x_px, y + 0.5 - p.center_y_px);
        const double slope = 184 * (1 - t * t / 8 + std::pow(t, 4) / 384);
        power += light[0][static_cast<std::size_t>(y * 40 + x)] * std::sin(t) / (r * slope);
      }
    }
    CHECK(power == Approx(0.6).epsilon(3e-3));
  }
}
