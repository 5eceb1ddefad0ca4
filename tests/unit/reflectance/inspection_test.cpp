#include "host_sdk/reflectance/inspection.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "host_sdk/reflectance/adapted_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/negative_values.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

using namespace scatter::reflectance;

namespace {

/// One channel of a formula.
class Formula final : public Brdf {
 public:
  using Function = std::function<double(const Direction&, const Direction&)>;
  explicit Formula(Function f) : f_(std::move(f)) {}
  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return 1; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override { return {}; }
  [[nodiscard]] Origin eval(const Direction& i, const Direction& o,
                            std::span<double> f) const noexcept override {
    f[0] = i.z > 0 && o.z > 0 ? f_(i, o) : 0;
    return i.z > 0 && o.z > 0 ? Origin::kMeasured : Origin::kInvalid;
  }

 private:
  Function f_;
};

}  // namespace

TEST_CASE("A reciprocal and symmetric model shows no deviation") {
  const Inspection found = inspect(*make_model("ggx:alpha=0.3,f0=0.04,albedo=0.2").value());
  REQUIRE(found.incidences.size() == 4);
  REQUIRE(found.reciprocity.has_value());
  // Six pairs of incidences, 72 azimuths.
  REQUIRE(found.reciprocity->pairs == 6 * 72);
  REQUIRE(found.reciprocity->relative_rms < 1e-12);
  REQUIRE(found.reciprocity->median < 1e-12);
  REQUIRE(found.mirror_symmetry->relative_rms < 1e-12);
  REQUIRE_FALSE(found.incidences[0].mirror_symmetry.has_value());
  REQUIRE_FALSE(found.gains_energy);
  REQUIRE_FALSE(found.looks_cosine_weighted);
}

TEST_CASE("A measured grid is compared with itself at its nodes, where nothing is interpolated") {
  const auto model = make_model("ggx:alpha=0.1,f0=0.04,albedo=0.2").value();
  const GridBrdf grid = sample_on_grid(*model, {}).value();
  const Inspection found = inspect(grid);
  // Nothing but the rounding of values to float.
  REQUIRE(found.reciprocity->relative_rms < 1e-6);
  REQUIRE(found.mirror_symmetry->relative_rms < 1e-6);
}

TEST_CASE("Deviations from reciprocity and symmetry are those of the formula") {
  // f = 1 / cos_i (Phong's normalisation): at 20 and 60 deg the two ways give 1/cos 20 and 1/cos 60.
  const Formula phong([](const Direction& i, const Direction&) { return 1 / i.z; });
  InspectionOptions options;
  options.incidences = {from_spherical(radians(20), 0), from_spherical(radians(60), 1)};
  const double a = 1 / std::cos(radians(20));
  const double b = 1 / std::cos(radians(60));
  const Inspection found = inspect(phong, options);
  REQUIRE(found.reciprocity->median == Approx((b - a) / ((a + b) / 2)).epsilon(1e-12));
  REQUIRE(found.reciprocity->relative_rms == Approx((b - a) / ((a + b) / 2)).epsilon(1e-12));

  // f = 1 + y with light in y = 0: halves 1 + y and 1 - y, so rms = sqrt of the mean of (2y)^2 over
  // the half sphere; the mean of y^2 over the hemisphere is 1/3.
  const Formula tilted([](const Direction&, const Direction& o) { return 1 + o.y; });
  options.incidences = {from_spherical(radians(20), 0)};
  const Inspection lopsided = inspect(tilted, options);
  // The columns in the plane, where y = 0, are no pairs: 179 of 180 steps hold all of the square.
  REQUIRE(lopsided.incidences[0].mirror_symmetry->relative_rms ==
          Approx(2 / std::sqrt(3) * std::sqrt(180.0 / 179)).epsilon(2e-4));
  // Half of the quarter sphere has |y| below 1/2, by Archimedes.
  REQUIRE(lopsided.mirror_symmetry->median == Approx(1).epsilon(0.01));
  REQUIRE_FALSE(lopsided.reciprocity.has_value());
}

TEST_CASE("Coverage is the share of the hemisphere's solid angle") {
  GridLayout layout;
  layout.theta_count = 76;
  layout.incidences = {{0, radians(20), 0}};
  const auto model = make_model("lambertian:0.5").value();
  GridBrdf::Content content = sample_on_grid(*model, layout).value().content();
  for (std::size_t n = 0; n < content.parts[0].origin.size(); ++n) {
    content.parts[0].origin[n] = n / 360 < 30 ? Origin::kInvalid : Origin::kMeasured;
  }
  const Inspection found = inspect(GridBrdf::make(content).value());
  const OriginShares& shares = found.origin_shares;
  // Nodes stand for cells that end half-way; cells from 0 to 29.5 deg, then to 75.5 deg.
  REQUIRE(shares[0] == Approx(1 - std::cos(radians(29.5))).epsilon(1e-9));
  REQUIRE(shares[1] == Approx(std::cos(radians(29.5)) - std::cos(radians(75.5))).epsilon(1e-9));
  REQUIRE(shares[2] == 0);
  REQUIRE(shares[3] == Approx(std::cos(radians(75.5))).epsilon(1e-9));
  // f is constant, so the extrapolated share of the albedo is that of the projected solid angle:
  // cos^2 75.5 of cos^2 29.5. The node at the horizon stands for cos^2 89.5 = 7.6e-5 of it and counts as
  // none.
  const double c = std::cos(radians(75.5)) / std::cos(radians(29.5));
  REQUIRE(found.incidences[0].extrapolated_albedo_share == Approx(c * c).margin(1.1e-4));
}

TEST_CASE("Energy above 1 is flagged, energy of 1 is not") {
  const Formula white([](const Direction&, const Direction&) { return 1 / kPi; });
  REQUIRE_FALSE(inspect(white).gains_energy);
  const Formula more([](const Direction&, const Direction&) { return 1.01 / kPi; });
  const Inspection found = inspect(more);
  REQUIRE(found.gains_energy);
  REQUIRE(found.incidences[1].albedo.value[0] == Approx(1.01).margin(1e-4));
}

TEST_CASE("Energy of a model is judged up to grazing incidence") {
  // docs/models.md: at most 0.886 up to 60 deg, 1.220 at 85 deg.
  const Inspection phong = inspect(*make_model("phong:n=20,ks=2,kd=0.1").value());
  REQUIRE(phong.incidences.size() == 4);
  REQUIRE(phong.gains_energy);
  REQUIRE(phong.energy.largest_albedo.value() >= 1.220);
  REQUIRE(degrees(phong.energy.judged_to) >= 85);
  REQUIRE(degrees(phong.energy.largest_at) > 80);
  REQUIRE_FALSE(inspect(*make_model("ggx:alpha=0.3,f0=0.9").value()).gains_energy);
  // Measured data are judged where they were measured.
  const GridBrdf grid = sample_on_grid(*make_model("phong:n=20,ks=2,kd=0.1").value(), {}).value();
  REQUIRE(degrees(inspect(grid).energy.judged_to) == Approx(60));
}

TEST_CASE("A mirror's share is in the albedo that energy is judged by") {
  const Inspection found = inspect(*make_model("sum:mirror:0.3,lambertian:0.3").value());
  REQUIRE(found.energy.largest_albedo.value() == Approx(0.6).margin(1e-3));
}

TEST_CASE("Where nothing is known energy cannot be told") {
  GridLayout layout;
  layout.incidences = {{0, radians(20), 0}};
  GridBrdf::Content content = sample_on_grid(*make_model("lambertian:0.5").value(), layout).value().content();
  content.parts[0].origin.assign(content.parts[0].origin.size(), Origin::kInvalid);
  const Inspection found = inspect(GridBrdf::make(content).value());
  REQUIRE(found.incidences[0].nothing_known);
  REQUIRE_FALSE(found.energy.largest_albedo.has_value());
  REQUIRE_FALSE(found.gains_energy);
  // Black is known to be black, and a mirror has no value in any direction but one.
  REQUIRE(inspect(*make_model("lambertian:0").value()).energy.largest_albedo.value() == 0);
  REQUIRE(inspect(*make_model("mirror:0.9").value()).energy.largest_albedo.value() == Approx(0.9));
}

TEST_CASE("Adaptive tables are inspected at their own incidences, which are measured") {
  const auto model = make_model("ggx:alpha=0.3,f0=0.04,albedo=0.2").value();
  const AdaptiveBrdf brdf = adapt(*model, {.theta_i = {0, radians(25), radians(50), radians(70)}}).value();
  const Inspection found = inspect(brdf);
  REQUIRE(found.incidences.size() == 4);
  REQUIRE(found.available_incidences == 4);
  const double theta_deg[] = {0, 25, 50, 70};
  for (std::size_t k = 0; k < 4; ++k) {
    REQUIRE(degrees(found.incidences[k].theta_i) == Approx(theta_deg[k]).margin(1e-4));
    REQUIRE(found.incidences[k].coverage[2] == 0);  // nothing interpolated
    REQUIRE(found.incidences[k].coverage[1] > 0.5);
  }
  // All azimuths: once along the normal, and the last of a whole turn is the first.
  const AdaptiveBrdf turned =
      adapt(*model, {.theta_i = {0, radians(50)}, .azimuths = 9, .resolution = 8, .normals_resolution = 16})
          .value();
  REQUIRE(turned.own_incidences().size() == 1 + 8);
}

TEST_CASE("A list has the incidences of its valid samples, each once") {
  ScatteredSamples samples;
  samples.channels = 1;
  const double light[][2] = {{40, 0}, {0, 0}, {0, 90}, {40, 0}, {40, 180}, {60, 0}};
  for (const auto& [theta, phi] : light) {
    samples.omega_i.push_back(from_spherical(radians(theta), radians(phi)));
    samples.omega_o.push_back({0, 0, 1});
    samples.f_per_sr.push_back(-0.1F);
    samples.origin.push_back(theta == 60 ? Origin::kInvalid : Origin::kMeasured);
  }
  const auto own = incidences_of(samples);
  REQUIRE(own.size() == 3);
  REQUIRE(own[0].z == 1);
  REQUIRE(degrees(phi_of(own[1])) == Approx(0).margin(1e-9));
  REQUIRE(degrees(phi_of(own[2])) == Approx(180));
  const NegativeValues negative = negative_values(samples);
  REQUIRE(negative.count == 5);
  REQUIRE(negative.of == 5);
  REQUIRE(negative.least == Approx(-0.1));
}

TEST_CASE("Negative values of grids are counted, invalid ones aside") {
  GridBrdf::Content content = sample_on_grid(*make_model("lambertian:0.5").value(), {}).value().content();
  content.parts[1].f_per_sr[2][400] = -0.25F;
  content.parts[1].f_per_sr[0][401] = -9;
  content.parts[1].origin[401] = Origin::kInvalid;
  const NegativeValues found = negative_values(GridBrdf::make(content).value());
  REQUIRE(found.count == 1);
  REQUIRE(found.of == 3 * (4 * 91 * 360 - 1));
  REQUIRE(found.least == Approx(-0.25));
  REQUIRE_FALSE(found.count_as_0);
}

TEST_CASE("Negative values of adaptive tables are counted where the table is valid") {
  const auto model = make_model("ggx:alpha=0.3,f0=0.04,albedo=0.2").value();
  const AdaptiveBrdf brdf = adapt(*model, {.theta_i = {0, radians(50)}, .resolution = 8}).value();
  // Nodes below the horizon go on beyond 0, but are marked.
  REQUIRE(negative_values(brdf).count == 0);
  REQUIRE(negative_values(brdf).of > 0);
}

TEST_CASE("Thinning keeps the ends") {
  std::vector<Direction> all;
  for (int k = 0; k <= 80; ++k) {
    all.push_back(from_spherical(radians(k), 0));
  }
  const auto some = thinned(all, 5);
  REQUIRE(some.size() == 5);
  REQUIRE(degrees(theta_of(some[2])) == Approx(40));
  REQUIRE(degrees(theta_of(some.back())) == Approx(80));
  REQUIRE(thinned(all, 81).size() == 81);
}

TEST_CASE("Stated totals are shown beside the recomputed ones with their ratio") {
  SpecularGridBrdf::Content content;
  content.plane_symmetric = true;
  content.rotation = {0};
  content.theta_i = {0};
  for (int k = 0; k <= 180; k += 10) {
    content.azimuth.push_back(radians(k));
  }
  for (int k = 0; k <= 80; k += 10) {
    content.radial.push_back(radians(k));
  }
  content.f_per_sr.assign(1, std::vector<float>(19 * 9, 0.25F));
  const double s = std::sin(radians(80));
  const double cut = 0.25 * kPi * s * s;
  const double plain = 0.25 * 2 * kPi * (1 - std::cos(radians(80)));
  content.stated_total = {{cut * 1.04}};
  Inspection found = inspect(SpecularGridBrdf::make(content).value());
  REQUIRE(found.incidences[0].totals.size() == 1);
  StatedTotal total = found.incidences[0].totals[0];
  REQUIRE(total.recomputed == Approx(cut).epsilon(2e-4));
  REQUIRE(total.held == Approx(0.25 * kPi).epsilon(2e-4));
  REQUIRE(total.unweighted == Approx(plain).epsilon(2e-4));
  REQUIRE(total.ratio == Approx(1 / 1.04).epsilon(2e-4));
  REQUIRE_FALSE(total.differs);
  REQUIRE_FALSE(found.looks_cosine_weighted);
  content.stated_total = {{plain}};
  found = inspect(SpecularGridBrdf::make(content).value());
  REQUIRE(found.incidences[0].totals[0].differs);
  REQUIRE(found.looks_cosine_weighted);
}

TEST_CASE("Reciprocity of a transmitting sample is not told from one side") {
  REQUIRE_FALSE(inspect(*make_model("film:transmittance=0.6,haze=0.3").value()).reciprocity.has_value());
}
