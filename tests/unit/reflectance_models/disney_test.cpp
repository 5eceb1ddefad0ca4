#include "host_sdk/reflectance/models/disney.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

using namespace scatter::reflectance;

namespace {

double lerp(double a, double b, double t) {
  return (1 - t) * a + t * b;
}
double fifth(double cosine) {
  return std::pow(1 - cosine, 5);
}

/// The course notes' model in one piece, vectors and tangents only: what the lobes must add up to.
ChannelValues course_notes(const Disney::Parameters& p, const Direction& l, const Direction& v) {
  const Direction h = normalized({l.x + v.x, l.y + v.y, l.z + v.z});
  const double l_h = dot(l, h);
  const double luminance = 0.3 * p.base_color[0] + 0.6 * p.base_color[1] + 0.1 * p.base_color[2];
  const double fd90 = 0.5 + 2 * l_h * l_h * p.roughness;
  const double fd = lerp(1, fd90, fifth(l.z)) * lerp(1, fd90, fifth(v.z));
  const double fss90 = l_h * l_h * p.roughness;
  const double fss = lerp(1, fss90, fifth(l.z)) * lerp(1, fss90, fifth(v.z));
  const double ss = 1.25 * (fss * (1 / (l.z + v.z) - 0.5) + 0.5);
  const double aspect = std::sqrt(1 - 0.9 * p.anisotropic);
  const double ax = std::max(0.001, p.roughness * p.roughness / aspect);
  const double ay = std::max(0.001, p.roughness * p.roughness * aspect);
  const double slope = std::pow(h.x / ax, 2) + std::pow(h.y / ay, 2) + h.z * h.z;
  const double ds = 1 / (kPi * ax * ay * slope * slope);
  const auto smith = [](double cosine, double alpha) {
    return 1 / (cosine + std::sqrt(alpha * alpha + (1 - alpha * alpha) * cosine * cosine));
  };
  const double rough_g = std::pow(0.5 + p.roughness / 2, 2);
  const double gs = smith(l.z, rough_g) * smith(v.z, rough_g);
  const double a = lerp(0.1, 0.001, p.clearcoat_gloss);
  const double dr = (a * a - 1) / (kPi * std::log(a * a) * (1 + (a * a - 1) * h.z * h.z));
  const double coat =
      0.25 * p.clearcoat * dr * lerp(0.04, 1, fifth(l_h)) * smith(l.z, 0.25) * smith(v.z, 0.25);
  ChannelValues out{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double tint = luminance > 0 ? p.base_color[c] / luminance : 1;
    const double spec0 =
        lerp(p.specular * 0.08 * lerp(1, tint, p.specular_tint), p.base_color[c], p.metallic);
    const double fs = lerp(spec0, 1, fifth(l_h));
    const double sheen = fifth(l_h) * p.sheen * lerp(1, tint, p.sheen_tint);
    const double base = lerp(fd, ss, p.subsurface) * p.base_color[c] / kPi + sheen;
    out[c] = base * (1 - p.metallic) + gs * fs * ds + coat;
  }
  return out;
}

}  // namespace

TEST_CASE("Disney's lobes add up to the course notes' model, whatever the parameters") {
  const Disney::Parameters plain{};
  std::vector<Disney::Parameters> cases{plain};
  cases.push_back({.base_color = {0.8, 0.4, 0.1},
                   .metallic = 0.3,
                   .subsurface = 0.4,
                   .specular = 0.7,
                   .roughness = 0.35,
                   .specular_tint = 0.6,
                   .anisotropic = 0.8,
                   .sheen = 0.9,
                   .sheen_tint = 0.3,
                   .clearcoat = 0.7,
                   .clearcoat_gloss = 0.4});
  cases.push_back({.base_color = {0, 0, 0}, .roughness = 1, .specular_tint = 1, .sheen = 1});
  cases.push_back(
      {.base_color = {1, 1, 1}, .metallic = 1, .subsurface = 1, .roughness = 0.02, .clearcoat = 1});
  for (const Disney::Parameters& p : cases) {
    const Disney model(p);
    for (const Direction& l :
         {from_spherical(0.1, 0.2), from_spherical(0.7, 4.0), from_spherical(1.4, 1.1)}) {
      for (const Direction& v :
           {from_spherical(0.3, 2.0), from_spherical(0.7, 0.9), from_spherical(1.5, 4.1), mirrored(l)}) {
        std::array<double, 3> f{};
        REQUIRE(model.eval(l, v, f) == Origin::kMeasured);
        const ChannelValues expected = course_notes(p, l, v);
        for (std::size_t c = 0; c < 3; ++c) {
          CHECK(f[c] == Approx(expected[c]).epsilon(1e-9));
        }
      }
    }
  }
}

TEST_CASE("Disney's plain parameters mean F0 0.04 and no tint") {
  CHECK(disney_f0({})[0] == Approx(0.04).epsilon(1e-14));
  CHECK(disney_f0({.base_color = {0.9, 0.6, 0.3}, .metallic = 1}) == ChannelValues{0.9, 0.6, 0.3});
  CHECK(disney_tint({0, 0, 0}) == uniform(1));
  CHECK(disney_tint({0.5, 0.5, 0.5})[1] == Approx(1).epsilon(1e-14));
}
