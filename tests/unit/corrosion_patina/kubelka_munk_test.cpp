// Diffuse light in layers: the limits that Kubelka's solution has, and light that is neither lost nor made.
#include "simulator/corrosion/patina/kubelka_munk.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace scatter::corrosion {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST_CASE("A layer's optics are those of the hyperbolic solution") {
  // Dorsey and Hanrahan 1996, eq. for R and T with a = (S + K) / S and b = sqrt(a^2 - 1).
  for (const double S : {0.01, 0.3, 5.0}) {
    for (const double K : {0.001, 0.2, 4.0}) {
      for (const double d : {0.01, 1.0, 3.0}) {
        const double a = (S + K) / S;
        const double b = std::sqrt(a * a - 1);
        const double denominator = a * std::sinh(b * S * d) + b * std::cosh(b * S * d);
        const LayerOptics optics = layer_optics(K, S, d);
        CHECK(optics.reflectance == Approx(std::sinh(b * S * d) / denominator).epsilon(1e-10));
        CHECK(optics.transmittance == Approx(b / denominator).epsilon(1e-10));
      }
    }
  }
}

TEST_CASE("A layer without thickness is not there") {
  const LayerOptics optics = layer_optics(2, 3, 0);
  CHECK(optics.reflectance == 0);
  CHECK(optics.transmittance == 1);
}

TEST_CASE("A layer that only absorbs dims by Beer's law") {
  const LayerOptics optics = layer_optics(0.7, 0, 2);
  CHECK(optics.reflectance == 0);
  CHECK(optics.transmittance == Approx(std::exp(-1.4)));
}

TEST_CASE("A layer that only scatters loses nothing") {
  for (const double d : {1e-6, 0.5, 40.0, 1e9}) {
    const LayerOptics optics = layer_optics(0, 0.4, d);
    CHECK(optics.reflectance == Approx(0.4 * d / (1 + 0.4 * d)));
    CHECK(optics.reflectance + optics.transmittance == Approx(1).epsilon(1e-14));
  }
  CHECK(layer_optics(0, 0.4, kInfinity).reflectance == 1);
  CHECK(layer_optics(0, 0, 5).transmittance == 1);
}

TEST_CASE("Little absorption joins none without a step") {
  for (double K = 1e-3; K > 1e-40; K *= 1e-3) {
    const LayerOptics optics = layer_optics(K, 0.4, 10);
    CHECK(optics.reflectance == Approx(0.8).margin(40 * K + 1e-13));
    CHECK(optics.transmittance == Approx(0.2).margin(40 * K + 1e-13));
  }
}

TEST_CASE("A thick layer shows its own colour, 1 + K/S - sqrt((K/S)^2 + 2 K/S)") {
  for (const double ratio : {1e-3, 0.1, 1.0, 20.0}) {
    const double expected = 1 + ratio - std::sqrt(ratio * ratio + 2 * ratio);
    CHECK(infinite_reflectance(ratio * 0.3, 0.3) == Approx(expected));
    CHECK(layer_optics(ratio * 0.3, 0.3, 1e6).reflectance == Approx(expected));
    CHECK(layer_optics(ratio * 0.3, 0.3, kInfinity).reflectance == Approx(expected));
    CHECK(layer_optics(ratio * 0.3, 0.3, kInfinity).transmittance == 0);
  }
  CHECK(infinite_reflectance(1, 0) == 0);
  CHECK(infinite_reflectance(0, 1) == 1);
}

TEST_CASE("Two halves of a layer are the layer") {
  for (const double d : {0.1, 2.0, 9.0}) {
    const LayerOptics half = layer_optics(0.3, 0.5, d / 2);
    const LayerOptics whole = layer_optics(0.3, 0.5, d);
    CHECK(over(half, half).reflectance == Approx(whole.reflectance));
    CHECK(over(half, half).transmittance == Approx(whole.transmittance));
  }
}

TEST_CASE("No layer and no stack of layers sends out more light than came in") {
  for (double K = 0; K < 10; K += 0.37) {
    for (double S = 0; S < 10; S += 0.41) {
      for (const double d : {0.0, 1e-9, 0.03, 1.0, 50.0, 1e8}) {
        const LayerOptics optics = layer_optics(K, S, d);
        REQUIRE(optics.reflectance >= 0);
        REQUIRE(optics.transmittance >= 0);
        REQUIRE(optics.reflectance + optics.transmittance <= 1 + 1e-14);
        const LayerOptics seen = over(optics, {0.9, 0});
        REQUIRE(seen.reflectance >= 0);
        REQUIRE(seen.reflectance <= 1);
        REQUIRE(seen.transmittance == 0);
      }
    }
  }
  CHECK(over({1, 0}, {1, 0}).reflectance == 1);
}

}  // namespace
}  // namespace scatter::corrosion
