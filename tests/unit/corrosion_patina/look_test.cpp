// From layers to what scatters: bare copper is copper, thick patina is its own colour, light is shared out
// once.
#include "simulator/corrosion/patina/look.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "simulator/corrosion/patina/kubelka_munk.h"

namespace scatter::corrosion {
namespace {

LayerStack stack_of(float tarnish_um, float green_um) {
  LayerStack stack = *LayerStack::bare(8, 1);
  if (tarnish_um > 0) {
    REQUIRE(stack.coat(PatinaMaterial::kTarnish, std::vector<float>(64, tarnish_um)));
  }
  if (green_um > 0) {
    REQUIRE(stack.coat(PatinaMaterial::kSulphate, std::vector<float>(64, green_um)));
  }
  return stack;
}

TEST_CASE("Bare copper is metal of copper's colour, flat and without pores") {
  const Appearance look = appearance(stack_of(0, 0));
  CHECK(look.side == 8);
  CHECK(look.regime[5] == Regime::kMetal);
  CHECK(look.albedo[5] == kCopperReflectance);
  CHECK(look.metalness[5] == 1);
  CHECK(look.roughness[5] == Approx(0.15));
  CHECK(look.porosity[5] == 0);
  CHECK(look.opacity[5] == 1);
  CHECK(look.normal[5] == std::array<float, 3>{0, 0, 1});
}

TEST_CASE("Copper's reflectance is that of its refractive index") {
  // Johnson and Christy 1972 between their wavelengths 616.8/659.5, 520.9/548.6, 450.9/471.4 nm.
  const std::array<std::pair<double, double>, 3> n_k{
      {{0.27527, 3.37255}, {1.15632, 2.60341}, {1.24688, 2.45615}}};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto [n, k] = n_k[c];
    CHECK(kCopperReflectance[c] ==
          Approx(((n - 1) * (n - 1) + k * k) / ((n + 1) * (n + 1) + k * k)).margin(0.0006));
  }
}

TEST_CASE("Thick layers show the colour of the topmost one alone") {
  const Appearance look = appearance(stack_of(5, 200));
  const PatinaMaterialData& green = data_of(PatinaMaterial::kSulphate);
  for (std::size_t c = 0; c < 3; ++c) {
    CHECK(look.albedo[0][c] ==
          Approx(infinite_reflectance(green.absorption_per_um[c], green.scattering_per_um[c])).epsilon(1e-5));
  }
  CHECK(look.regime[0] == Regime::kRust);
  CHECK(look.metalness[0] < 1e-6);
  CHECK(look.roughness[0] == Approx(green.roughness).epsilon(1e-4));
  CHECK(look.porosity[0] == Approx(green.porosity).epsilon(1e-4));
}

TEST_CASE("Metal's share and the layers' share together send back what Kubelka and Munk say") {
  for (const float tarnish : {0.01F, 0.1F, 0.4F, 2.0F}) {
    for (const float green : {0.0F, 0.5F, 6.0F, 40.0F}) {
      const LayerStack stack = stack_of(tarnish, green);
      const Appearance look = appearance(stack);
      const std::vector<Rgb> whole = reflectance(stack);
      for (std::size_t c = 0; c < 3; ++c) {
        const double shared =
            look.metalness[0] * kCopperReflectance[c] + (1 - look.metalness[0]) * look.albedo[0][c];
        INFO(tarnish << " um tarnish, " << green << " um green, colour " << c);
        // Thin absorbing films: metalness is one number for all colours, so the blue of the layer is cut off
        // at 0.
        CHECK(shared >= whole[0][c] - 1e-5);
        if (look.albedo[0][c] > 0) {
          CHECK(shared == Approx(whole[0][c]).margin(1e-5));
        }
        CHECK(look.albedo[0][c] >= 0);
        CHECK(look.albedo[0][c] <= 1);
      }
    }
  }
}

TEST_CASE("Metalness is the share of light that goes through all layers twice") {
  const PatinaMaterialData& tarnish = data_of(PatinaMaterial::kTarnish);
  const PatinaMaterialData& green = data_of(PatinaMaterial::kSulphate);
  double expected = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double once =
        layer_optics(tarnish.absorption_per_um[c], tarnish.scattering_per_um[c], 0.05).transmittance *
        layer_optics(green.absorption_per_um[c], green.scattering_per_um[c], 1.0).transmittance;
    expected += once * once / 3;
  }
  CHECK(appearance(stack_of(0.05F, 1.0F)).metalness[3] == Approx(expected).epsilon(1e-5));
}

TEST_CASE("Metalness falls all the way from bare copper to what hides it; whatever lies on it is a layer") {
  double last = 1;
  for (const float um : {0.02F, 0.1F, 0.3F, 0.8F, 2.0F}) {
    const Appearance look = appearance(stack_of(um, 0));
    CHECK(look.metalness[0] < last);
    last = look.metalness[0];
  }
  CHECK(last < 0.01);
  CHECK(appearance(stack_of(0.02F, 0)).regime[0] == Regime::kRust);
  CHECK(appearance(stack_of(1e-9F, 0)).regime[0] == Regime::kMetal);
}

TEST_CASE("Shares of what shows add up to one") {
  const Coverage bare = coverage(stack_of(0, 0));
  CHECK(bare.bare == 1);
  for (const float tarnish : {0.0F, 0.1F, 1.0F}) {
    for (const float green : {0.1F, 1.0F, 10.0F}) {
      const Coverage shares = coverage(stack_of(tarnish, green));
      CHECK(shares.bare + shares.tarnish + shares.patina == Approx(1));
      CHECK(shares.bare >= 0);
      CHECK(shares.patina > 0);
      CHECK((shares.tarnish > 0) == (tarnish > 0));
    }
  }
  CHECK(coverage(stack_of(0, 100)).patina == Approx(1).epsilon(1e-6));
}

TEST_CASE("Normals are those of the profile") {
  // z = h sin(2 pi x / L) on 64 cells: central differences see its slope times sinc(2 pi / 64).
  constexpr std::size_t kSide = 64;
  constexpr double kHeight = 100;
  std::vector<float> profile(kSide * kSide);
  const auto angle = [](std::size_t i) { return 2 * std::numbers::pi * static_cast<double>(i) / kSide; };
  for (std::size_t i = 0; i < profile.size(); ++i) {
    profile[i] = static_cast<float>(kHeight * std::sin(angle(i % kSide)));
  }
  const Appearance look = appearance(*LayerStack::bare(kSide, 6.4, profile));
  const double scale = kHeight / 100 * std::sin(angle(1));
  for (const std::size_t x : {0U, 5U, 16U, 63U}) {
    const double slope = scale * std::cos(angle(x));
    CHECK(look.normal[x][0] == Approx(-slope / std::hypot(slope, 1)).margin(1e-5));
    CHECK(look.normal[x][1] == 0);
    CHECK(look.normal[x][2] == Approx(1 / std::hypot(slope, 1)).margin(1e-5));
  }
  // Up is towards the first row.
  for (std::size_t i = 0; i < profile.size(); ++i) {
    profile[i] = static_cast<float>(kHeight * std::sin(angle(i / kSide)));
  }
  CHECK(appearance(*LayerStack::bare(kSide, 6.4, profile)).normal[0][1] > 0);
}

}  // namespace
}  // namespace scatter::corrosion
