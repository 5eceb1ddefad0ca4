// What guided interpolation promises besides accuracy: exactness, origins, uncertainty, bad input.
#include "host_sdk/reflectance/estimators/guided_brdf.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"

using namespace scatter::reflectance;

namespace {

constexpr std::size_t kRows = 26;
constexpr std::size_t kColumns = 60;

/// 3 deg x 6 deg to 75 deg: coarse, so that the tests are quick.
GridLayout layout(const std::vector<double>& theta_i_deg) {
  GridLayout grid;
  grid.incidences.clear();
  for (const double theta_i : theta_i_deg) {
    grid.incidences.push_back({0, radians(theta_i), 0});
  }
  grid.theta_count = kRows;
  grid.phi_count = kColumns;
  grid.theta_step = radians(3);
  return grid;
}

GridBrdf::Content measured(const char* spec, const std::vector<double>& theta_i_deg) {
  const auto model = make_model(spec);
  REQUIRE(model);
  auto grid = sample_on_grid(**model, layout(theta_i_deg));
  REQUIRE(grid);
  GridBrdf::Content content = grid->content();
  for (GridPart& part : content.parts) {
    part.random_per_sr = part.f_per_sr;
    part.systematic_per_sr = part.f_per_sr;
    for (std::size_t c = 0; c < content.channels; ++c) {
      for (std::size_t node = 0; node < part.origin.size(); ++node) {
        part.random_per_sr[c][node] *= 0.01F;
        part.systematic_per_sr[c][node] *= 0.02F;
      }
    }
  }
  return content;
}

std::shared_ptr<const GridBrdf> grid_of(GridBrdf::Content content) {
  auto grid = GridBrdf::make(std::move(content));
  REQUIRE(grid);
  return std::make_shared<const GridBrdf>(std::move(*grid));
}

std::shared_ptr<const GuidedBrdf> guided(const std::shared_ptr<const Brdf>& inner) {
  auto made = GuidedBrdf::make(inner);
  REQUIRE(made);
  return *made;
}

constexpr const char* kGlossy = "ggx:alpha=0.25,f0=0.04,albedo=0.2";
constexpr const char* kWard = "ward:alpha=0.3,ks=0.2,albedo=0.2";

/// A material at four incidences and its link; made once, since choosing takes a second.
struct Material {
  std::shared_ptr<const GridBrdf> grid;
  std::shared_ptr<const GuidedBrdf> link;
};
const Material& glossy() {
  static const Material kMaterial = [] {
    const auto grid = grid_of(measured(kGlossy, {0, 20, 40, 60}));
    return Material{grid, guided(grid)};
  }();
  return kMaterial;
}
const Material& ward() {
  static const Material kMaterial = [] {
    const auto grid = grid_of(measured(kWard, {0, 20, 40, 60}));
    return Material{grid, guided(grid)};
  }();
  return kMaterial;
}

}  // namespace

TEST_CASE("Guided interpolation gives measured values back to the bit, with their origins") {
  const auto& [grid, link] = glossy();
  std::array<double, 3> expected{};
  std::array<double, 3> found{};
  for (std::size_t part = 0; part < 4; ++part) {
    for (std::size_t node = 0; node < kRows * kColumns; node += 7) {
      const Origin origin = grid->eval(grid->omega_i(part), grid->omega_o(node), expected);
      CHECK(link->eval(grid->omega_i(part), grid->omega_o(node), found) == origin);
      CHECK(found == expected);
    }
  }
}

TEST_CASE("Guided interpolation meets the measured values as the incidence nears theirs") {
  const auto& [grid, link] = ward();
  std::array<double, 3> at{};
  std::array<double, 3> near{};
  for (std::size_t node = 0; node < kRows * kColumns; node += 11) {
    const Direction o = grid->omega_o(node);
    REQUIRE(grid->eval(grid->omega_i(2), o, at) == Origin::kMeasured);
    (void)link->eval(from_spherical(radians(40 - 1e-3), 0), o, near);
    // A thousandth of a degree changes no lobe of 17 deg by more than this.
    CHECK(near[0] == Approx(at[0]).epsilon(1e-3));
  }
}

TEST_CASE("Guided values are interpolated where both neighbours were measured, else extrapolated") {
  const auto& link = glossy().link;
  std::array<double, 3> f{};
  CHECK(link->eval(from_spherical(radians(30), 0), from_spherical(radians(74), kPi), f) ==
        Origin::kInterpolated);
  CHECK(link->eval(from_spherical(radians(30), 0), from_spherical(radians(77), kPi), f) ==
        Origin::kExtrapolated);
  CHECK(f[0] > 0);
  CHECK(link->eval(from_spherical(radians(30), 0), {0, 0, -1}, f) == Origin::kInvalid);
  CHECK(f[0] == 0);
}

TEST_CASE("Guided values of a hole in the data are extrapolated, of the size of their surroundings") {
  GridBrdf::Content content = measured(kGlossy, {0, 20, 40, 60});
  for (GridPart& part : content.parts) {
    for (std::size_t row = 5; row < 9; ++row) {
      for (std::size_t column = 0; column < 3; ++column) {
        const std::size_t node = row * kColumns + column;
        part.origin[node] = Origin::kInvalid;
        for (auto& plane : part.f_per_sr) {
          plane[node] = 0;
        }
      }
    }
  }
  const auto link = guided(grid_of(content));
  const auto truth = make_model(kGlossy);
  std::array<double, 3> f{};
  std::array<double, 3> expected{};
  const Direction i = from_spherical(radians(30), 0);
  const Direction o = from_spherical(radians(21), radians(6));
  CHECK(link->eval(i, o, f) == Origin::kExtrapolated);
  (void)(*truth)->eval(i, o, expected);
  CHECK(f[0] == Approx(expected[0]).epsilon(0.02));
}

TEST_CASE("Guided values are never negative, whatever the noise does to the data") {
  GridBrdf::Content content = measured("ggx:alpha=0.1,f0=0.04", {0, 20, 40, 60});
  unsigned state = 1;
  for (GridPart& part : content.parts) {
    for (auto& plane : part.f_per_sr) {
      for (float& f : plane) {
        state = state * 1664525U + 1013904223U;
        f += 0.02F * (static_cast<float>(state >> 8U) / static_cast<float>(1U << 24U) - 0.5F);
      }
    }
  }
  const auto link = guided(grid_of(content));
  std::array<double, 3> f{};
  for (const double theta_i : {5.0, 15.0, 33.0, 59.0}) {
    for (double theta_o = 0; theta_o < 90; theta_o += 4.5) {
      for (double phi_o = 0; phi_o < 360; phi_o += 30) {
        (void)link->eval(from_spherical(radians(theta_i), 0),
                         from_spherical(radians(theta_o), radians(phi_o)), f);
        for (const double value : f) {
          CHECK(value >= 0);
          CHECK(std::isfinite(value));
        }
      }
    }
  }
}

TEST_CASE("Guided batches equal single evaluations") {
  const auto& link = glossy().link;
  std::vector<Direction> o;
  for (int k = 0; k < 1500; ++k) {
    o.push_back(from_spherical(1.5 * k / 1500.0, 0.37 * k));
  }
  const Direction i = from_spherical(radians(47), 0.4);
  std::vector<double> batch(o.size() * 3);
  std::vector<Origin> origin(o.size());
  link->eval_batch(i, o, batch, origin);
  for (std::size_t k = 0; k < o.size(); k += 13) {
    std::array<double, 3> one{};
    CHECK(link->eval(i, o[k], one) == origin[k]);
    CHECK(one[1] == batch[3 * k + 1]);
  }
}

TEST_CASE("An isotropic sample answers alike from all azimuths") {
  const auto& link = glossy().link;
  std::array<double, 3> a{};
  std::array<double, 3> b{};
  (void)link->eval(from_spherical(radians(33), 0), from_spherical(radians(41), 2.5), a);
  (void)link->eval(from_spherical(radians(33), 1.1), from_spherical(radians(41), 3.6), b);
  CHECK(a[0] == Approx(b[0]).epsilon(1e-5));
}

TEST_CASE("Between incidences the uncertainty holds the neighbours' and the cross-validation error") {
  const auto& link = ward().link;
  const Direction o = from_spherical(radians(35), radians(150));
  std::array<double, 3> f{};
  std::array<double, 3> random{};
  std::array<double, 3> systematic{};
  REQUIRE(link->uncertainty(from_spherical(radians(40), 0), o, random, systematic));
  (void)link->eval(from_spherical(radians(40), 0), o, f);
  CHECK(random[0] == Approx(0.01 * f[0]).epsilon(1e-4));
  CHECK(systematic[0] == Approx(0.02 * f[0]).epsilon(1e-4));
  REQUIRE(link->uncertainty(from_spherical(radians(30), 0), o, random, systematic));
  (void)link->eval(from_spherical(radians(30), 0), o, f);
  // Half-way, 1 % of either neighbour: 0.01 / sqrt 2.
  CHECK(random[0] == Approx(0.01 * f[0] / std::sqrt(2.0)).epsilon(0.01));
  CHECK(systematic[0] >= 0.0199 * f[0]);
  // The Ward family is among the guides: hardly any error of interpolation is added.
  CHECK(systematic[0] < 0.025 * f[0]);
}

TEST_CASE("The method and its cross-validation error are reported") {
  const auto& link = ward().link;
  const GuidedMixture& mixture = *link->mixtures().front();
  double weight = 0;
  bool ward = false;
  for (const GuidedMember& member : mixture.members) {
    weight += member.weight;
    ward = ward || member.name.starts_with("ward ");
  }
  CHECK(weight == Approx(1.0).epsilon(1e-4));
  CHECK(ward);
  REQUIRE(mixture.error);
  REQUIRE(mixture.specular_error);
  CHECK(*mixture.error < 0.25 * *mixture.specular_error);
  CHECK(mixture.held_back.size() == 3);
  const auto text = link->metadata();
  CHECK(text.at("interpolation").starts_with("guided: "));
  CHECK(std::stod(text.at("interpolation_error")) == Approx(*mixture.error).epsilon(0.01));
  CHECK(text.contains("interpolation_error_specular_linear"));
}

TEST_CASE("Two incidences are interpolated without cross-validation, and that is said") {
  const auto link = guided(grid_of(measured(kGlossy, {20, 50})));
  CHECK_FALSE(link->cross_validation_error());
  CHECK(link->metadata().at("interpolation_error").starts_with("unknown"));
  const auto truth = make_model(kGlossy);
  std::array<double, 3> f{};
  std::array<double, 3> expected{};
  (void)link->eval(from_spherical(radians(35), 0), from_spherical(radians(36), kPi), f);
  (void)(*truth)->eval(from_spherical(radians(35), 0), from_spherical(radians(36), kPi), expected);
  CHECK(f[0] == Approx(expected[0]).epsilon(0.02));
}

TEST_CASE("Several sample rotations answer for themselves, and linearly in between") {
  const auto dull = grid_of(measured("lambertian:0.2", {0, 20, 40, 60}));
  const auto bright = grid_of(measured("lambertian:0.6", {0, 20, 40, 60}));
  GridBrdf::Content both = dull->content();
  for (GridPart part : bright->content().parts) {
    part.rotation_rad = radians(60);
    part.phi_i = radians(60);
    both.parts.push_back(part);
  }
  const auto link = guided(grid_of(both));
  CHECK(link->mixtures().size() == 2);
  std::array<double, 3> f{};
  const auto at = [&](double phi_deg) {
    (void)link->eval(from_spherical(radians(30), radians(phi_deg)), from_spherical(radians(20), 1.0), f);
    return f[0];
  };
  CHECK(at(0) == Approx(0.2 / kPi).epsilon(1e-3));
  CHECK(at(60) == Approx(0.6 / kPi).epsilon(1e-3));
  CHECK(at(30) == Approx(0.4 / kPi).epsilon(1e-3));
  // More than 90 deg apart on this side: the nearest one.
  CHECK(at(200) == Approx(0.6 / kPi).epsilon(1e-3));
}

TEST_CASE("Transmission is interpolated without models") {
  GridBrdf::Content content = measured(kGlossy, {0, 20, 40, 60});
  content.type = ScatterType::kBtdf;
  const auto link = guided(grid_of(content));
  std::array<double, 3> f{};
  CHECK(link->eval(from_spherical(radians(30), 0), {0, 0, -1}, f) == Origin::kInterpolated);
  CHECK(f[0] > 0);
  CHECK(link->eval(from_spherical(radians(30), 0), {0, 0, 1}, f) == Origin::kInvalid);
}

TEST_CASE("Data that cannot be interpolated are refused with a remedy") {
  const auto one = GuidedBrdf::make(grid_of(measured(kGlossy, {30})));
  REQUIRE_FALSE(one);
  CHECK(one.error().code == scatter::ErrorCode::kFailedPrecondition);
  CHECK_FALSE(one.error().remedy.empty());
  const auto grid = grid_of(measured(kGlossy, {0, 20}));
  const auto wrong =
      GuidedBrdf::make(grid, {.theta_i = {radians(20), radians(10)}, .azimuth = 0, .theta_o_to = kPi / 2});
  REQUIRE_FALSE(wrong);
  CHECK(wrong.error().code == scatter::ErrorCode::kInvalidArgument);
  GridBrdf::Content dark = measured(kGlossy, {0, 20, 40});
  for (auto& plane : dark.parts[1].f_per_sr) {
    for (float& f : plane) {
      f = 0;
    }
  }
  // An incidence that is black everywhere still is a measurement; no light at all is none.
  CHECK(GuidedBrdf::make(grid_of(dark)));
  for (GridPart& part : dark.parts) {
    for (auto& plane : part.f_per_sr) {
      std::ranges::fill(plane, 0.0F);
    }
  }
  const auto black = GuidedBrdf::make(grid_of(dark));
  REQUIRE_FALSE(black);
  CHECK(black.error().code == scatter::ErrorCode::kFailedPrecondition);
}
