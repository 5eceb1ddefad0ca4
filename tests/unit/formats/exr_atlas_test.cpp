#include "host_sdk/formats/exr_atlas.h"

#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <memory>

#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/unit/formats/sample_grid.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

using Models = std::vector<std::shared_ptr<const Brdf>>;

Models five_models() {
  Models models;
  for (const char* spec : {"lambertian:0.1", "lambertian:0.2", "ggx:alpha=0.3,albedo=0.2", "lambertian:0.4",
                           "ggx:alpha=0.5,f0=0.9"}) {
    models.push_back(make_model(spec).value());
  }
  return models;
}

std::vector<AtlasMaterial> materials_of(const Models& models) {
  std::vector<AtlasMaterial> materials;
  for (std::size_t k = 0; k < models.size(); ++k) {
    materials.push_back({"material " + std::string(1, static_cast<char>('a' + k)), models[k].get()});
  }
  return materials;
}

AtlasOptions small() {
  AtlasOptions options;
  options.tiles.width = 24;
  options.tiles.height = 12;
  options.tiles.half_precision = false;
  options.tiles.method = "model";
  return options;
}

ExrTilesOptions small_tiles() {
  return small().tiles;
}

}  // namespace

TEST_CASE("Every material of an atlas comes back under its name as from tiles of its own") {
  // PROVES: formats.md 7.
  const Models models = five_models();
  for (const std::size_t columns : {0, 1, 2, 3, 5, 6}) {
    AtlasOptions options = small();
    options.columns = columns;
    const auto entries =
        decode_exr_atlas(encode_exr_atlas(materials_of(models), options).value(), "atlas").value();
    REQUIRE(entries.size() == 5);
    for (std::size_t k = 0; k < 5; ++k) {
      REQUIRE(entries[k].name == std::string("material ") + static_cast<char>('a' + k));
      const auto alone =
          decode_exr_tiles(encode_exr_tiles(*models[k], small_tiles()).value(), "alone").value();
      REQUIRE((entries[k].brdf.content().f_per_sr == alone.content().f_per_sr));
      REQUIRE((entries[k].brdf.content().origin == alone.content().origin));
      REQUIRE((entries[k].brdf.content().theta_i == alone.content().theta_i));
    }
  }
}

TEST_CASE("An atlas of tile files keeps their texels") {
  const auto a = decode_exr_tiles(encode_exr_tiles(*five_models()[2], small_tiles()).value(), "a").value();
  const auto b = decode_exr_tiles(encode_exr_tiles(*five_models()[4], small_tiles()).value(), "b").value();
  const std::array<AtlasMaterial, 2> materials{AtlasMaterial{"a", &a}, AtlasMaterial{"b", &b}};
  AtlasOptions options;
  options.tiles.half_precision = false;
  const auto entries = decode_exr_atlas(encode_exr_atlas(materials, options).value(), "atlas").value();
  REQUIRE(entries[1].brdf.content().azimuth.size() == 24);
  for (std::size_t n = 0; n < b.content().f_per_sr[0].size(); ++n) {
    REQUIRE(entries[1].brdf.content().f_per_sr[0][n] == Approx(b.content().f_per_sr[0][n]).epsilon(1e-5));
  }
}

TEST_CASE("Materials that differ are refused by name unless resampling is asked for") {
  ExrTilesOptions other = small_tiles();
  other.theta_i = {0, 0.5};
  ExrTilesOptions larger = small_tiles();
  larger.width = 36;
  const Models models = five_models();
  const auto a = decode_exr_tiles(encode_exr_tiles(*models[0], small_tiles()).value(), "a").value();
  const auto b = decode_exr_tiles(encode_exr_tiles(*models[1], other).value(), "b").value();
  const auto c = decode_exr_tiles(encode_exr_tiles(*models[2], larger).value(), "c").value();
  for (const Brdf* second : {static_cast<const Brdf*>(&b), static_cast<const Brdf*>(&c)}) {
    const std::array<AtlasMaterial, 2> materials{AtlasMaterial{"a", &a}, AtlasMaterial{"second", second}};
    AtlasOptions options = small();
    const auto refused = encode_exr_atlas(materials, options);
    REQUIRE(refused.error().code == ErrorCode::kInvalidArgument);
    REQUIRE(refused.error().what.find("'second'") != std::string::npos);
    options.resample = true;
    const auto entries = decode_exr_atlas(encode_exr_atlas(materials, options).value(), "atlas").value();
    REQUIRE(entries.size() == 2);
    REQUIRE(entries[1].brdf.content().theta_i.size() == 4);
  }
  const auto film = make_model("film:transmittance=0.6,haze=0.3").value();
  const auto mono = test::sample_grid(40, 36, 1);
  for (const Brdf* second : {film.get(), static_cast<const Brdf*>(&mono)}) {
    const std::array<AtlasMaterial, 2> materials{AtlasMaterial{"a", &a}, AtlasMaterial{"second", second}};
    REQUIRE(encode_exr_atlas(materials, small()).error().what.find("'second'") != std::string::npos);
  }
  const std::array<AtlasMaterial, 2> twice{AtlasMaterial{"a", &a}, AtlasMaterial{"a", &a}};
  REQUIRE(encode_exr_atlas(twice, small()).error().what.find("twice") != std::string::npos);
  REQUIRE_FALSE(encode_exr_atlas({}, small()).has_value());
}

TEST_CASE("An atlas is not taken for one material, and tiles are an atlas of one") {
  const Models models = five_models();
  const std::string atlas = encode_exr_atlas(materials_of(models), small()).value();
  const auto refused = decode_exr_tiles(atlas, "atlas.exr");
  REQUIRE(refused.error().code == ErrorCode::kInvalidArgument);
  REQUIRE(refused.error().what.find("material c") != std::string::npos);
  const auto one = decode_exr_atlas(encode_exr_tiles(*models[0], small_tiles()).value(), "tiles").value();
  REQUIRE(one.size() == 1);
  REQUIRE(one[0].name.empty());
}

TEST_CASE("An atlas cut anywhere is refused, and damaged ones never crash the reader") {
  AtlasOptions options = small();
  options.tiles.width = 8;
  options.tiles.height = 4;
  const std::string good = encode_exr_atlas(materials_of(five_models()), options).value();
  for (std::size_t percent = 0; percent < 100; ++percent) {
    REQUIRE_FALSE(
        decode_exr_atlas(std::string_view(good).substr(0, good.size() * percent / 100), "cut").has_value());
  }
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string bytes = good;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (at % 8)));
    if (const auto entries = decode_exr_atlas(bytes, "flip"); entries) {
      for (const AtlasEntry& entry : *entries) {
        REQUIRE(SpecularGridBrdf::make(entry.brdf.content()).has_value());
      }
    }
  }
}
