#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

#include "host_sdk/reflectance/models/model_spec.h"
#include "simulator/samples/lit_cells.h"
#include "simulator/samples/slope_clusters.h"
#include "simulator/samples/textured_sheet.h"
#include "tests/unit/simulator/made_sheet.h"

namespace {

using namespace scatter::simulator;
using namespace scatter::simulator::test;
using scatter::reflectance::from_spherical;
using scatter::reflectance::mirrored;
using scatter::reflectance::radians;

Values at(const scatter::reflectance::Brdf& brdf, const Direction& wi, const Direction& wo) {
  Values f{};
  (void)brdf.eval(wi, wo, f);
  return f;
}

Footprint footprint(double theta_deg, double phi_deg = 0) {
  return {.diameter_mm = 3, .omega_i = from_spherical(radians(theta_deg), radians(phi_deg))};
}

}  // namespace

TEST_CASE("The light covers an ellipse of the spot's area over cos(theta_i), in the plane of incidence") {
  for (const double theta : {0.0, 20.0, 40.0, 60.0}) {
    for (const double phi : {0.0, 30.0, 90.0}) {
      constexpr std::size_t kSide = 512;
      constexpr double kExtent = 20;
      const double cell = kExtent / kSide;
      const auto cells = lit_cells(kSide, kExtent, {0.5, 0.5}, footprint(theta, phi));
      double sum = 0;
      double xx = 0;
      double yy = 0;
      double xy = 0;
      for (const LitCell& c : cells) {
        const double x = (static_cast<double>(c.cell % kSide) + 0.5 - 256) * cell;
        const double y = (256 - static_cast<double>(c.cell / kSide) - 0.5) * cell;
        sum += c.weight;
        xx += c.weight * x * x;
        yy += c.weight * y * y;
        xy += c.weight * x * y;
      }
      CHECK(sum == Approx(1).epsilon(1e-12));
      // Second moments of an ellipse are its half axes squared / 4.
      const double a2 = std::pow(1.5 / std::cos(radians(theta)), 2) / 4;
      const double b2 = 1.5 * 1.5 / 4;
      const double c2 = std::pow(std::cos(radians(phi)), 2);
      CHECK(xx == Approx(a2 * c2 + b2 * (1 - c2)).epsilon(2e-3));
      CHECK(yy == Approx(a2 * (1 - c2) + b2 * c2).epsilon(2e-3));
      CHECK(xy == Approx((a2 - b2) * std::sin(radians(phi)) * std::cos(radians(phi))).margin(2e-3));
      CHECK(static_cast<double>(cells.size()) ==
            Approx(kPi * 2.25 / std::cos(radians(theta)) / (cell * cell)).epsilon(0.05));
    }
  }
}

TEST_CASE("Light that reaches over the sheet's border falls on its other side") {
  constexpr std::size_t kSide = 64;
  const auto middle = lit_cells(kSide, 10, {0.5, 0.5}, footprint(40));
  const auto corner = lit_cells(kSide, 10, {0.0, 1.0}, footprint(40));
  std::vector<double> a(kSide * kSide);
  std::vector<double> b(kSide * kSide);
  for (const LitCell& c : middle) {
    a[c.cell] += c.weight;
  }
  for (const LitCell& c : corner) {
    b[c.cell] += c.weight;
  }
  for (std::size_t k = 0; k < a.size(); ++k) {
    const std::size_t x = (k % kSide + 32) % kSide;
    const std::size_t y = (k / kSide + 32) % kSide;
    CHECK(a[k] == Approx(b[y * kSide + x]).margin(1e-15));
  }
}

TEST_CASE("Facets are grouped whole: weights and means of the groups are those of the points") {
  std::vector<SlopePoint> points;
  for (int k = 0; k < 1000; ++k) {
    points.push_back(
        {0.1 * std::sin(k * 1.7) + (k % 3 == 0 ? 1.0 : 0.0), 0.2 * std::cos(k * 2.3), 1.0 + k % 5});
  }
  const auto group = cluster_slopes(points, 7);
  const std::size_t groups = 1 + *std::max_element(group.begin(), group.end());
  CHECK(groups == 7);
  double weight = 0;
  double x = 0;
  for (const SlopeMoments& m : moments_of_groups(points, group, groups)) {
    weight += m.weight;
    x += m.weight * m.mean_x;
    // The two heaps are 1 apart: no group may lie between them.
    CHECK((m.mean_x < 0.2 || m.mean_x > 0.8));
  }
  const auto all = moments_of_groups(points, std::vector<std::size_t>(points.size(), 0), 1).front();
  CHECK(weight == Approx(all.weight));
  CHECK(x / weight == Approx(all.mean_x));
  CHECK(cluster_slopes(std::vector<SlopePoint>(5, SlopePoint{0.3, 0.1, 1.0}), 4) ==
        std::vector<std::size_t>(5, 0));
}

TEST_CASE("Bare metal is the conductor's lobe, nothing else") {
  const auto sheet = made_sheet({.side = 64, .extent_mm = 5, .rust = -1});
  REQUIRE(sheet != nullptr);
  const auto brdf = sheet->scattering(lit_cells(64, 5, {0.5, 0.5}, footprint(40)));
  CHECK(brdf->facets() == 1);
  const auto iron = scatter::reflectance::make_model("conductor:metal=iron,alpha=0.15");
  REQUIRE(iron.has_value());
  for (const double theta : {0.0, 35.0, 70.0}) {
    const Direction wi = footprint(40).omega_i;
    const Direction wo = from_spherical(radians(theta), 2.8);
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(at(*brdf, wi, wo)[c] == Approx(at(**iron, wi, wo)[c]).epsilon(1e-9));
    }
  }
}

TEST_CASE("Metal that leans shines where its normal sends the light") {
  auto maps = made_maps({.side = 64, .extent_mm = 5, .rust = -1});
  const Direction n = from_spherical(radians(8), radians(25));
  std::fill(maps.normal.begin(), maps.normal.end(),
            std::array{static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)});
  const auto sheet = TexturedSheet::make(maps, 5, {.metal_alpha = 0.05});
  REQUIRE(sheet.has_value());
  const auto brdf = (*sheet)->scattering(all_cells(64));
  const Direction wi = from_spherical(radians(30), radians(200));
  const double twice = 2 * dot(wi, n);
  const Direction mirror{twice * n.x - wi.x, twice * n.y - wi.y, twice * n.z - wi.z};
  const double there = at(*brdf, wi, mirror)[0];
  CHECK(there > 5);
  CHECK(there > 20 * at(*brdf, wi, mirrored(wi))[0]);
  CHECK(there > 20 * at(*brdf, wi, {mirror.x, -mirror.y, mirror.z})[0]);
}

TEST_CASE("A spot as large as a level map is the mean over its area") {
  auto maps = made_maps({.side = 64, .extent_mm = 5, .rust = 0.6, .depth_mm = 0.3, .hole_depth_mm = 0.12});
  std::fill(maps.normal.begin(), maps.normal.end(), std::array{0.0F, 0.0F, 1.0F});
  const auto sheet = TexturedSheet::make(maps, 5, {.backing = 0.4});
  REQUIRE(sheet.has_value());
  const auto brdf = (*sheet)->scattering(all_cells(64));
  const auto cells = (*sheet)->cells(all_cells(64));
  double metal = 0;
  double holes = 0;
  for (const SheetCell& cell : cells) {
    metal += cell.weight * cell.metal;
    holes += cell.weight * (1 - cell.metal - cell.rust);
  }
  CHECK(metal > 0.1);
  CHECK(holes > 0.02);
  const auto iron = scatter::reflectance::make_model("conductor:metal=iron,alpha=0.15");
  for (const auto& [i, o] : {std::pair{20.0, 20.0}, {60.0, 30.0}, {0.0, 70.0}}) {
    const Direction wi = from_spherical(radians(i), 0.4);
    const Direction wo = from_spherical(radians(o), 3.0);
    // All rust leans alike, so that diffuse parts add linearly; the coat's mean roughness is only near.
    const Values f = at(*brdf, wi, wo);
    Values mean{};
    for (const SheetCell& cell : cells) {
      auto plain = cell;
      plain.weight = 1;
      const Values one = cell_sum({&plain, 1}, **sheet, wi, wo);
      for (std::size_t c = 0; c < 3; ++c) {
        mean[c] += cell.weight * one[c];
      }
    }
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(f[c] == Approx(mean[c]).epsilon(2e-3));
    }
  }
}

TEST_CASE("With one roughness of rust the mean over a level map is right to 1e-6") {
  auto maps = made_maps({.side = 64, .extent_mm = 5, .rust = 0.6, .depth_mm = 0.3, .hole_depth_mm = 0.12});
  std::fill(maps.normal.begin(), maps.normal.end(), std::array{0.0F, 0.0F, 1.0F});
  std::fill(maps.roughness.begin(), maps.roughness.end(), 0.5F);
  const auto sheet = TexturedSheet::make(maps, 5, {.backing = 0.4});
  const auto brdf = (*sheet)->scattering(all_cells(64));
  const auto cells = (*sheet)->cells(all_cells(64));
  for (const auto& [i, o] : {std::pair{20.0, 20.0}, {60.0, 30.0}, {0.0, 70.0}}) {
    const Direction wi = from_spherical(radians(i), 0.4);
    const Direction wo = from_spherical(radians(o), 3.0);
    const Values f = at(*brdf, wi, wo);
    const Values mean = cell_sum(cells, **sheet, wi, wo);
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(f[c] == Approx(mean[c]).epsilon(1e-6));
    }
  }
}

TEST_CASE("Few facets scatter as all cells do") {
  double worst_peak = 0;
  double worst_albedo = 0;
  for (const double rust : {-0.2, 0.3, 0.9, 1.6}) {
    for (const double depth : {0.05, 0.2}) {
      const auto sheet = made_sheet({.rust = rust, .depth_mm = depth});
      for (const double theta : {0.0, 40.0, 60.0}) {
        const Footprint light = footprint(theta);
        const auto lit = lit_cells(sheet->side(), sheet->extent_mm(), {0.1, 0.8}, light);
        const auto brdf = sheet->scattering(lit);
        const auto cells = sheet->cells(lit);
        double peak = 0;
        double error = 0;
        double albedo = 0;
        double albedo_error = 0;
        for (int t = 0; t < 8; ++t) {
          for (int p = 0; p < 8; ++p) {
            const double theta_o = radians(3 + 10.2 * t);
            const Direction wo = from_spherical(theta_o, 2 * kPi * p / 8);
            const Values fast = at(*brdf, light.omega_i, wo);
            const Values exact = cell_sum(cells, *sheet, light.omega_i, wo);
            for (std::size_t c = 0; c < 3; ++c) {
              peak = std::max(peak, exact[c]);
              error = std::max(error, std::abs(fast[c] - exact[c]));
            }
            const double solid = std::sin(theta_o) * std::cos(theta_o);
            albedo += solid * exact[0];
            albedo_error += solid * (fast[0] - exact[0]);
          }
        }
        const Values fast = at(*brdf, light.omega_i, mirrored(light.omega_i));
        const Values exact = cell_sum(cells, *sheet, light.omega_i, mirrored(light.omega_i));
        for (std::size_t c = 0; c < 3; ++c) {
          peak = std::max(peak, exact[c]);
          error = std::max(error, std::abs(fast[c] - exact[c]));
        }
        CAPTURE(rust, depth, theta, peak, error);
        CHECK(error <= 0.03 * peak);
        CHECK(std::abs(albedo_error) <= 0.01 * albedo);
        worst_peak = std::max(worst_peak, error / peak);
        worst_albedo = std::max(worst_albedo, std::abs(albedo_error) / albedo);
      }
    }
  }
  std::printf("few facets against all cells: %.3f %% of the peak, %.3f %% of the albedo at worst\n",
              100 * worst_peak, 100 * worst_albedo);
}

TEST_CASE("A spot is reciprocal and never reflects more light than comes in") {
  for (const double depth : {0.2, 1.5}) {  // The second one leans up to 60 deg.
    const auto sheet = made_sheet({.rust = 0.7, .depth_mm = depth}, {.metal_alpha = 0.05, .backing = 1});
    const auto brdf = sheet->scattering(lit_cells(256, 15, {0.3, 0.3}, footprint(60)));
    for (int k = 0; k < 50; ++k) {
      const Direction a = from_spherical(radians(1 + 1.77 * k), 0.7 * k);
      const Direction b = from_spherical(radians(88 - 1.5 * k), 1.9 * k);
      for (std::size_t c = 0; c < 3; ++c) {
        CHECK(at(*brdf, a, b)[c] == Approx(at(*brdf, b, a)[c]).epsilon(1e-10));
      }
    }
    for (const double theta : {0.0, 60.0, 85.0}) {
      const Direction wi = from_spherical(radians(theta), 0.5);
      double albedo = 0;
      constexpr int kTheta = 100;
      constexpr int kPhi = 60;
      for (int t = 0; t < kTheta; ++t) {
        // Even steps of sin^2: each counts alike under the cosine.
        const double s = std::sqrt((t + 0.5) / kTheta);
        for (int p = 0; p < kPhi; ++p) {
          albedo += at(*brdf, wi, from_spherical(std::asin(s), 2 * kPi * (p + 0.5) / kPhi))[0];
        }
      }
      albedo *= kPi / (kTheta * kPhi);
      CAPTURE(depth, theta);
      CHECK(albedo <= 1.0);
      CHECK(albedo > 0.05);
    }
  }
}

TEST_CASE("Maps of different sizes and optics out of range are refused") {
  auto maps = made_maps({.side = 16, .extent_mm = 3});
  maps.porosity.pop_back();
  const auto uneven = TexturedSheet::make(maps, 3, {});
  REQUIRE_FALSE(uneven.has_value());
  CHECK(uneven.error().what.find("255 cells, expected 16 x 16") != std::string::npos);
  const auto alpha = TexturedSheet::make(made_maps({.side = 16, .extent_mm = 3}), 3, {.metal_alpha = 2});
  REQUIRE_FALSE(alpha.has_value());
  CHECK(alpha.error().what.find("0.01..1") != std::string::npos);
  CHECK_FALSE(
      TexturedSheet::make(made_maps({.side = 16, .extent_mm = 3}), 3, {.metal = "cheese"}).has_value());
}
