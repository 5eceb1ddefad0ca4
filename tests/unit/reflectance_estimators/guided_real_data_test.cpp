// Incidences of real measurements, held back and predicted.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/reflectance/estimators/guided_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tests/unit/reflectance_estimators/guided_figures.h"

using namespace scatter::reflectance;
using scatter::reflectance::test::figures_of;

namespace {

/// A file that nobody here wrote, or nothing, said aloud.
std::shared_ptr<const Brdf> real_brdf(const std::string& name) {
  const char* folder = std::getenv("SCATTER_REAL_DATA");
  const auto path = std::filesystem::path(folder != nullptr ? folder : "../shared/data") / name;
  if (!std::filesystem::exists(path)) {
    std::cout << "skipped: no real data (" << name << ")\n";
    return nullptr;
  }
  auto brdf = scatter::formats::open_brdf(path.string());
  REQUIRE(brdf);
  return *brdf;
}

/// Only the incidences named.
std::shared_ptr<const SpecularGridBrdf> kept(const SpecularGridBrdf& all,
                                             const std::vector<double>& theta_i_deg) {
  SpecularGridBrdf::Content content = all.content();
  const std::size_t block = content.azimuth.size() * content.radial.size();
  content.theta_i.clear();
  content.stated_total.clear();
  content.origin.clear();
  for (auto& plane : content.f_per_sr) {
    plane.clear();
  }
  for (std::size_t k = 0; k < all.content().theta_i.size(); ++k) {
    const bool wanted = std::ranges::any_of(theta_i_deg, [&](double angle) {
      return std::abs(radians(angle) - all.content().theta_i[k]) < 1e-6;
    });
    if (!wanted) {
      continue;
    }
    content.theta_i.push_back(all.content().theta_i[k]);
    for (std::size_t c = 0; c < content.f_per_sr.size(); ++c) {
      const auto from = all.content().f_per_sr[c].begin() + static_cast<std::ptrdiff_t>(k * block);
      content.f_per_sr[c].insert(content.f_per_sr[c].end(), from, from + static_cast<std::ptrdiff_t>(block));
    }
  }
  REQUIRE(content.theta_i.size() == theta_i_deg.size());
  auto grid = SpecularGridBrdf::make(std::move(content));
  REQUIRE(grid);
  return std::make_shared<const SpecularGridBrdf>(std::move(*grid));
}

}  // namespace

TEST_CASE(
    "Brown vinyl at 30 and 50 deg is predicted from 20, 40 and 60 at half the error of specular-linear") {
  const auto file = real_brdf("zemax/brown_vinyl_measured_brdf.bsdf");
  if (!file) {
    return;
  }
  const auto all = std::dynamic_pointer_cast<const SpecularGridBrdf>(file);
  REQUIRE(all);
  const auto some = kept(*all, {20, 40, 60});
  const auto link = GuidedBrdf::make(some);
  REQUIRE(link);
  for (const double theta_i_deg : {30.0, 50.0}) {
    CAPTURE(theta_i_deg);
    // SpecularGridBrdf::eval is specular-linear.
    const auto simple = figures_of(*some, *all, radians(theta_i_deg));
    const auto found = figures_of(**link, *all, radians(theta_i_deg));
    CHECK(found.mean <= 0.5 * simple.mean);
    CHECK(found.peak_ratio > 0.9);
    CHECK(found.peak_ratio < 1.1);
  }
}

TEST_CASE("RGL materials are predicted 30 % better than specular-linear on the median file, worse on none") {
  std::vector<double> ratios;
  for (const char* name :
       {"aurora_white", "cc_ibiza_sunset", "chm_orange", "ilm_solo_m_68", "irid_flake_paint1"}) {
    const auto truth = real_brdf("rgl/" + std::string(name) + "_rgb.bsdf");
    if (!truth) {
      return;
    }
    GridLayout layout;  // 0, 20, 40 and 60 deg.
    layout.theta_count = 76;
    auto grid = sample_on_grid(*truth, layout);
    REQUIRE(grid);
    GridBrdf::Content red = grid->content();  // One channel: a third of the time.
    red.channels = 1;
    red.wavelengths_nm.clear();
    for (GridPart& part : red.parts) {
      part.f_per_sr.resize(1);
    }
    auto one_channel = GridBrdf::make(std::move(red));
    REQUIRE(one_channel);
    const auto some = std::make_shared<const GridBrdf>(std::move(*one_channel));
    const auto link = GuidedBrdf::make(some);
    REQUIRE(link);
    double ratio = 0;
    for (const double theta_i_deg : {10.0, 30.0, 50.0}) {
      // GridBrdf::eval is specular-linear. Nearly black materials have relative errors above 1: the
      // ratio is taken per incidence, so that none of them outweighs the others.
      ratio += figures_of(**link, *truth, radians(theta_i_deg)).mean /
               figures_of(*some, *truth, radians(theta_i_deg)).mean / 3;
    }
    CAPTURE(name, ratio);
    CHECK(ratio < 1);
    ratios.push_back(ratio);
  }
  std::ranges::sort(ratios);
  CHECK(ratios[2] <= 0.7);
}
