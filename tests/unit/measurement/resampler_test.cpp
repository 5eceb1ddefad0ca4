// PROVES: instrument.md section 4, step 7.
#include "host_sdk/measurement/resampler.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "host_sdk/measurement/local_fit.h"

using namespace scatter;
using namespace scatter::measurement;
using reflectance::Direction;
using reflectance::kPi;
using reflectance::radians;

namespace {

protocol::Descriptor instrument(std::uint16_t size) {
  protocol::Descriptor d;
  d.sensor.width_px = size;
  d.sensor.height_px = size;
  d.optics.center_x_px = static_cast<float>(size) / 2 + 0.3F;
  d.optics.center_y_px = static_cast<float>(size) / 2 - 0.2F;
  d.optics.radius_px = static_cast<float>(size) / 2 * 0.98F;
  d.optics.a1 = static_cast<float>(1.0 / radians(80));
  d.optics.rotation_rad = 0.02F;
  d.optics.theta_max_rad = static_cast<float>(radians(75));
  d.optics.image_theta_max_rad = static_cast<float>(radians(80));
  d.blind_spots.push_back({static_cast<float>(radians(40)), 0.0F, static_cast<float>(radians(2.5))});
  return d;
}

/// One lane holding f at every pixel.
template <typename F>
std::vector<float> image(const PixelGeometry& g, F f) {
  std::vector<float> out(g.usable.size());
  for (std::size_t p = 0; p < out.size(); ++p) {
    out[p] = static_cast<float>(
        f(Direction{static_cast<double>(g.x[p]), static_cast<double>(g.y[p]), static_cast<double>(g.z[p])}));
  }
  return out;
}

}  // namespace

TEST_CASE("Pixel directions and the projection of directions are inverse to each other") {
  const protocol::Descriptor d = instrument(300);
  const PixelGeometry g = pixel_geometry(d, {});
  for (const std::size_t p :
       {std::size_t{150 * 300 + 150}, std::size_t{60 * 300 + 200}, std::size_t{150 * 300 + 20}}) {
    REQUIRE(g.usable[p] == 1);
    const SensorPoint at = project(
        d.optics, {static_cast<double>(g.x[p]), static_cast<double>(g.y[p]), static_cast<double>(g.z[p])});
    CHECK(at.x == Approx(static_cast<double>(p % 300) + 0.5).margin(1e-3));
    CHECK(at.y == Approx(static_cast<double>(p / 300) + 0.5).margin(1e-3));
  }
  CHECK(g.usable[0] == 0);
}

TEST_CASE("A quadratic in the tangent plane comes out exactly, its known blur taken back") {
  const protocol::Descriptor d = instrument(300);
  const PixelGeometry g = pixel_geometry(d, {});
  const LocalFit fit(g, d.optics);
  const Direction centre = reflectance::from_spherical(radians(33), radians(100));
  constexpr double kCurvature = 4.0;  // of u^2 + v^2 [1/rad^2]
  const auto f = [&](const Direction& w) {
    const double c = dot(w, centre);
    return 2.0 + kCurvature * (1 - c * c);  // sin^2 of the distance = u^2 + v^2 in the tangent plane
  };
  const auto pixels = image(g, f);
  FitWeights weights;
  const double blur = 1e-3;
  REQUIRE(fit.solve({centre, radians(3), blur, 2}, {}, 1, 0, weights));
  double value = 0;
  double total = 0;
  for (std::size_t k = 0; k < weights.pixel.size(); ++k) {
    value += static_cast<double>(weights.weight[k]) * static_cast<double>(pixels[weights.pixel[k]]);
    total += static_cast<double>(weights.weight[k]);
  }
  CHECK(total == Approx(1).epsilon(1e-5));
  // f = g - sigma^2 (c_uu + c_vv)
  CHECK(value == Approx(2.0 - blur * 2 * kCurvature).epsilon(1e-5));
}

TEST_CASE(
    "A smooth hemisphere is recovered at every node, one value at the pole, blind nodes filled and named") {
  const protocol::Descriptor d = instrument(300);
  const PixelGeometry g = pixel_geometry(d, {static_cast<std::uint32_t>(140 * 300 + 170)});
  const auto f = [](const Direction& w) { return 1 + 0.5 * w.x - 0.3 * w.y + 0.2 * w.z; };
  const auto pixels = image(g, f);
  const std::vector<float> variance(pixels.size(), 0.01F);
  const Resampler resampler = Resampler::build(g, d, sample_frame(0, 0, 0), {});
  const NodeValues nodes = resampler.apply(pixels, variance, 1);
  std::size_t blind = 0;
  for (std::size_t node = 0; node < resampler.grid().nodes(); ++node) {
    REQUIRE(nodes.kind[node] != NodeKind::kEmpty);
    blind += nodes.kind[node] == NodeKind::kBlind ? 1 : 0;
    const double expected = f(resampler.grid().direction(node));
    const double limit = nodes.kind[node] == NodeKind::kBlind ? 2e-3 : 1e-4;
    if (std::abs(static_cast<double>(nodes.value[node]) - expected) > limit) {
      FAIL("node " << node << ": " << nodes.value[node] << " where " << expected << " was expected");
    }
    REQUIRE(nodes.variance[node] < 0.01F);
    REQUIRE(nodes.pixels[node] > 1.0F);
  }
  for (std::size_t i = 1; i < 360; ++i) {
    CHECK(nodes.value[i] == nodes.value[0]);
  }
  // Nodes of the 1 deg grid within 2.5 deg of (40, 0): about pi 2.5^2 / sin 40.
  CHECK(blind > 20);
  CHECK(blind < 45);
}

TEST_CASE("Saturated pixels leave no trace: nodes on them have no value, nodes beside them the right one") {
  const protocol::Descriptor d = instrument(300);
  const PixelGeometry g = pixel_geometry(d, {});
  auto pixels = image(g, [](const Direction& w) { return 1 + w.x; });
  std::vector<float> variance(pixels.size(), 1e-4F);
  const Direction hot = reflectance::from_spherical(radians(30), radians(90));
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    const Direction w{static_cast<double>(g.x[p]), static_cast<double>(g.y[p]), static_cast<double>(g.z[p])};
    if (g.usable[p] == 1 && reflectance::angle_between(w, hot) < radians(1.2)) {
      pixels[p] = 0;
      variance[p] = std::numeric_limits<float>::infinity();
    }
  }
  const Resampler resampler = Resampler::build(g, d, sample_frame(0, 0, 0), {});
  const NodeValues nodes = resampler.apply(pixels, variance, 1);
  CHECK(std::isinf(nodes.variance[30 * 360 + 90]));
  for (std::size_t j = 26; j <= 34; ++j) {
    for (std::size_t i = 84; i <= 96; ++i) {
      const std::size_t node = j * 360 + i;
      if (std::isfinite(nodes.variance[node])) {
        CHECK(static_cast<double>(nodes.value[node]) ==
              Approx(1 + resampler.grid().direction(node).x).margin(1e-3));
      }
    }
  }
}

TEST_CASE("A tilted sample's nodes are looked up where the tilt has moved them") {
  const protocol::Descriptor d = instrument(300);
  const PixelGeometry g = pixel_geometry(d, {});
  const auto pixels = image(g, [](const Direction& w) { return w.z; });
  const std::vector<float> variance(pixels.size(), 1.0F);
  const SampleFrame frame = sample_frame(radians(1.5), radians(-1), 0);
  const Resampler resampler = Resampler::build(g, d, frame, {});
  const NodeValues nodes = resampler.apply(pixels, variance, 1);
  for (const std::size_t node : {std::size_t{0}, std::size_t{40 * 360 + 77}, std::size_t{70 * 360 + 200}}) {
    const double expected = frame.to_instrument(resampler.grid().direction(node)).z;
    CHECK(static_cast<double>(nodes.value[node]) == Approx(expected).margin(2e-4));
  }
  // The sample's normal, seen from the instrument, leans towards +x and -y.
  const Direction normal = frame.to_instrument({0, 0, 1});
  CHECK(std::atan2(normal.x, normal.z) == Approx(radians(1.5)).epsilon(0.01));
  CHECK(std::atan2(normal.y, normal.z) == Approx(radians(-1)).epsilon(0.01));
}
