#include "host_sdk/reflectance/fitting/fit_family.h"

#include <catch2/catch.hpp>

namespace scatter::reflectance {

TEST_CASE("Family names read back as written", "[fit_family]") {
  for (const char* text : {"lambert", "oren-nayar", "ggx", "ward", "lafortune", "beckmann", "cook-torrance",
                           "disney", "gltf", "metallic-roughness", "oren-nayar+ggx", "ggx2",
                           "oren-nayar+ward2", "ggx+ward", "beckmann+lafortune"}) {
    CAPTURE(text);
    const auto family = fit_family(text);
    REQUIRE(family);
    CHECK(name(*family) == text);
  }
  CHECK(name(*fit_family("lambert+ggx+ggx")) == "ggx2");
}

TEST_CASE("Families that make no sense are refused by name", "[fit_family]") {
  for (const char* text : {"", "gxx", "ggx+", "+ggx", "ggx+lambert", "ggx3", "ggx2+ward", "disney+ggx",
                           "ggx++ward", "2", "GGX", "lambert2", "oren-nayar+oren-nayar"}) {
    CAPTURE(text);
    const auto family = fit_family(text);
    REQUIRE_FALSE(family);
    CHECK(family.error().code == ErrorCode::kInvalidArgument);
    CHECK(family.error().remedy.find("cook-torrance") != std::string::npos);
  }
}

TEST_CASE("The default families are all different", "[fit_family]") {
  const auto families = default_families();
  for (std::size_t a = 0; a < families.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      CHECK_FALSE(families[a] == families[b]);
    }
  }
}

}  // namespace scatter::reflectance
