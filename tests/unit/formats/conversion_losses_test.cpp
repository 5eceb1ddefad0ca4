// PROVES: docs/materials.md, "What a format cannot keep is said with the answer", with the figures of the
// data.
#include <algorithm>
#include <catch2/catch.hpp>
#include <memory>
#include <string>
#include <vector>

#include "host_sdk/formats/conversion_losses.h"
#include "host_sdk/formats/exr_atlas.h"
#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/formats/rgl.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/reflectance/adapted_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tests/unit/formats/real_data.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

std::shared_ptr<const Brdf> model(const char* spec) {
  return make_model(spec).value();
}

/// All clauses in one line.
std::string lost(const Brdf& brdf, std::string_view word, const EncodeOptions& options = {}) {
  const Writer& writer = *writer_named(word).value();
  const std::string bytes = encode_brdf(brdf, writer, options).value();
  std::string out;
  const auto clauses = conversion_losses(brdf, brdf, writer, options, bytes).value();
  for (const std::string& clause : clauses) {
    out += clause + "\n";
  }
  return out;
}

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// A Lambertian of 0.3 on a grid of 3 deg, 0 and 40 deg incidence, to be spoilt.
GridBrdf::Content grid_content() {
  GridLayout layout;
  layout.theta_step = radians(3);
  layout.theta_count = 31;
  layout.phi_count = 120;
  layout.incidences = {{0, 0, 0}, {0, radians(40), 0}};
  return sample_on_grid(*model("lambertian:0.3"), layout).value().content();
}

GridBrdf grid(GridBrdf::Content content) {
  return GridBrdf::make(std::move(content)).value();
}

}  // namespace

TEST_CASE("A mirror's share is said with its albedo, by every format") {
  const auto both = model("sum:mirror:0.25,lambertian:0.3");
  for (const formats::Writer& writer : writers()) {
    CAPTURE(writer.word);
    REQUIRE(has(lost(*both, writer.word), "(Dirac, albedo 0.2500)"));
    REQUIRE_FALSE(has(lost(*model("lambertian:0.3"), writer.word), "Dirac"));
  }
}

TEST_CASE("A mirror and nothing beside it is refused by every format") {
  for (const formats::Writer& writer : writers()) {
    CAPTURE(writer.word);
    const auto refused = encode_brdf(*model("mirror:0.9"), writer);
    REQUIRE_FALSE(refused);
    REQUIRE(refused.error().code == ErrorCode::kFailedPrecondition);
    REQUIRE(has(refused.error().what, "0.9000"));
    REQUIRE(has(refused.error().remedy, "narrow lobe"));
    REQUIRE(encode_brdf(*model("ggx:alpha=0.02,albedo=0"), writer));
  }
}

TEST_CASE("A mirror and nothing beside it is refused in an atlas too, by its name") {
  const auto grey = model("lambertian:0.3");
  const auto mirror = model("mirror:0.9");
  const std::vector<AtlasMaterial> materials{{"grey", grey.get()}, {"glass", mirror.get()}};
  const auto refused = encode_exr_atlas(materials);
  REQUIRE_FALSE(refused);
  REQUIRE(refused.error().code == ErrorCode::kFailedPrecondition);
  REQUIRE(has(refused.error().what, "'glass'"));
}

TEST_CASE("A format that keeps the nodes loses nothing, or digits alone") {
  const GridBrdf data = grid(grid_content());
  for (const char* word : {"exr", "bird"}) {
    CAPTURE(word);
    REQUIRE(lost(data, word).empty());
  }
  REQUIRE(lost(data, "minidiff") == "digits beyond number 7\n");
  REQUIRE(lost(data, "minidiff", {.digits = 5}) == "digits beyond number 5\n");
  // Colours are tristimulus values of seven digits, one channel has four.
  REQUIRE(has(lost(data, "zemax"), "digits beyond number 7\n"));
  REQUIRE(has(lost(data, "zemax", {.channel = 0}), "digits beyond number 4\n"));
}

TEST_CASE("Channels that a format drops are named by their wavelengths") {
  GridBrdf::Content content = grid_content();
  content.channels = 4;
  content.wavelengths_nm = {450, 550, 650, 850};
  for (auto& part : content.parts) {
    part.f_per_sr.resize(4, part.f_per_sr.front());
  }
  const GridBrdf data = grid(content);
  REQUIRE(has(lost(data, "merl"), "1 of 4 channels: 850 nm dropped, 650, 550, 450 nm kept\n"));
  REQUIRE(has(lost(data, "merl"), "wavelengths (650, 550, 450 nm)"));
  REQUIRE_FALSE(has(lost(data, "bird"), "channels"));
  content.wavelengths_nm = {550, 650, 750, 850};
  REQUIRE(
      has(lost(grid(content), "tiles"),
          "2 of 4 channels: 750, 850 nm dropped, 650, 550, 550 nm kept (one of them for several colours)"));
}

TEST_CASE("Negative values that a format sets to 0 are counted") {
  GridBrdf::Content content = grid_content();
  for (auto& part : content.parts) {
    for (std::size_t n = 0; n < part.f_per_sr[0].size(); ++n) {
      for (auto& plane : part.f_per_sr) {
        plane[n] = n / 120 < 10 ? -0.25F : plane[n];
      }
    }
  }
  const GridBrdf data = grid(content);
  // Rows 0 to 9 are 0..27 deg, 1 - cos(27 deg) = 10.9 % of the hemisphere; between rows 9 and 10 part is.
  for (const char* word : {"merl", "rgl"}) {
    CAPTURE(word, lost(data, word));
    REQUIRE(has(lost(data, word), "negative values (1"));
    REQUIRE(has(lost(data, word), "% of all, down to -0.25 1/sr), which become 0"));
  }
  REQUIRE_FALSE(has(lost(data, "exr"), "negative"));
  REQUIRE_FALSE(has(lost(data, "tiles"), "negative"));
}

TEST_CASE("Halves are said to lose what lies below their normal numbers, floats not") {
  const auto dark = model("lambertian:0.0001");
  REQUIRE(
      has(lost(*dark, "tiles"), "values below 6.1e-5 1/sr (100.0 % of all) keep fewer, --float keeps them"));
  REQUIRE_FALSE(has(lost(*dark, "tiles", {.half_precision = false}), "half"));
  REQUIRE_FALSE(has(lost(*model("lambertian:0.5"), "tiles"), "below 6.1e-5"));
}

TEST_CASE("Origins that a format cannot flag are said, with their share") {
  GridBrdf::Content content = grid_content();
  for (auto& part : content.parts) {
    std::ranges::fill(part.origin, Origin::kExtrapolated);
  }
  const GridBrdf data = grid(content);
  CAPTURE(lost(data, "merl"));
  // All but cells at the horizon, which have no value.
  REQUIRE(has(lost(data, "merl"), "origins: 98.8 % of the directions"));
  for (const char* word : {"exr", "bird", "minidiff", "zemax", "tiles"}) {
    CAPTURE(word, lost(data, word));
    REQUIRE_FALSE(has(lost(data, word), "origins"));
  }
  for (auto& part : content.parts) {
    std::ranges::fill(part.origin, Origin::kInterpolated);
  }
  REQUIRE(has(lost(grid(content), "rgl"), "origins: "));
}

TEST_CASE("Reciprocity and isotropy are said where a format forces them on data without") {
  const std::string reciprocal = lost(*model("ggx:alpha=0.3,f0=0.04,albedo=0.2"), "merl");
  CAPTURE(reciprocal);
  REQUIRE_FALSE(has(reciprocal, "reciprocity"));
  GridBrdf::Content content = grid_content();
  for (auto& plane : content.parts[1].f_per_sr) {
    for (float& f : plane) {
      f *= 1.5F;
    }
  }
  REQUIRE(has(lost(grid(content), "merl"), "(reciprocity)"));
  const auto brushed = model("ggx:alpha=0.1,alpha_y=0.4,albedo=0.2");
  REQUIRE(has(lost(*brushed, "merl"), "anisotropy: turned by 60 deg"));
  REQUIRE_FALSE(has(lost(*model("ggx:alpha=0.3"), "merl"), "anisotropy"));
}

TEST_CASE("Metadata reach every format that has a place for them; MERL says which it drops") {
  AdaptOptions options;
  options.metadata = {{"description", "brushed steel"}, {"operator", "A. B."}};
  const auto tables = adapt(*model("ggx:alpha=0.3"), options).value();
  for (const formats::Writer& writer : writers()) {
    CAPTURE(writer.word);
    const auto bytes = encode_brdf(tables, writer);
    CAPTURE(bytes ? "" : bytes.error().what);
    REQUIRE(bytes);
    const std::string text = lost(tables, writer.word);
    CAPTURE(text);
    REQUIRE(has(text, "metadata") == (writer.word == "merl"));
  }
  REQUIRE(has(lost(tables, "merl"), "metadata: 3 of 3 keys (adaptive_ndf, description, operator)"));
  const auto tiles =
      decode_brdf(encode_brdf(tables, *writer_named("tiles").value()).value(), "tiles").value();
  REQUIRE(dynamic_cast<const SpecularGridBrdf&>(*tiles).content().metadata.at("description") ==
          "brushed steel");
  const auto again = decode_rgl(
      encode_brdf(tables, *writer_named("rgl").value(), {.metadata = {{"operator", "C."}}}).value(), "rgl");
  REQUIRE(again.value().content().metadata.at("operator") == "C.");
}

TEST_CASE("The error between nodes is that of these data") {
  const auto path = test::real_data("zemax/fdtd_4aoi_361x181_brdf.bsdf");
  if (!path) {
    return;
  }
  const auto brdf = open_brdf(path->string()).value();
  const auto median_percent = [](const std::string& text) {
    const std::string_view clause = "detail between the nodes: error ";
    const auto at = text.find(clause);
    return at == std::string::npos ? 0 : std::stod(text.substr(at + clause.size()));
  };
  // 'compare' finds a median of 3.1 % of RGL where both are measured, 0.4 % of tiles.
  REQUIRE(median_percent(lost(*brdf, "rgl")) > 2);
  REQUIRE(median_percent(lost(*brdf, "tiles")) == Approx(0.4).margin(0.2));
  REQUIRE(median_percent(lost(*model("ggx:alpha=0.2,f0=0.04,albedo=0.3"), "rgl")) < 0.5);
  REQUIRE(has(lost(*brdf, "tiles"), "below 6.1e-5"));
}
