#include "host_sdk/formats/exr_tiles.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/unit/formats/sample_grid.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

ExrTilesOptions small(bool half_precision) {
  ExrTilesOptions options;
  options.width = 36;
  options.height = 20;
  options.columns = 3;
  options.half_precision = half_precision;
  options.method = "model";
  return options;
}

}  // namespace

TEST_CASE("A texel's centre gives the model's value, bit by bit in float, to 11 bits in half") {
  // PROVES: formats.md 6b.
  const auto model = make_model("ggx:alpha=0.3/0.4/0.5,f0=0.04,albedo=0.2").value();
  for (const bool half_precision : {false, true}) {
    const SpecularGridBrdf tiles =
        decode_exr_tiles(encode_exr_tiles(*model, small(half_precision)).value(), "tiles.exr").value();
    REQUIRE(tiles.content().theta_i.size() == 4);
    REQUIRE(tiles.content().metadata.at("method") == "model");
    REQUIRE(tiles.wavelengths_nm().size() == 3);
    std::size_t seen = 0;
    for (std::size_t t = 0; t < 4; ++t) {
      const double a = tiles.content().theta_i[t];
      for (std::size_t i = 0; i < 36; ++i) {
        for (std::size_t j = 0; j < 20; ++j) {
          const double psi = 2 * kPi * (static_cast<double>(i) + 0.5) / 36;
          const double rho = kPi * (static_cast<double>(j) + 0.5) / 20;
          const Direction d = from_spherical(rho, psi);
          const Direction o{d.x * std::cos(a) - d.z * std::sin(a), d.y,
                            d.x * std::sin(a) + d.z * std::cos(a)};
          std::array<double, 3> expected{};
          std::array<double, 3> found{};
          const Origin origin = model->eval(from_spherical(a, 0), o, expected);
          REQUIRE(tiles.content().origin[(t * 36 + i) * 20 + j] == origin);
          REQUIRE(tiles.eval(from_spherical(a, 0), o, found) == origin);
          for (std::size_t c = 0; c < 3; ++c) {
            REQUIRE(found[c] == Approx(expected[c]).epsilon(half_precision ? 5e-4 : 1.3e-7));
          }
          seen += origin == Origin::kMeasured;
        }
      }
    }
    REQUIRE(seen > 4 * 36 * 20 / 3);
  }
}

TEST_CASE("Tiles carry origin, uncertainty, metadata and transmission of a grid") {
  GridBrdf::Content content = test::sample_grid(40, 60).content();
  content.type = ScatterType::kBtdf;
  for (GridPart& part : content.parts) {
    part.origin.assign(part.origin.size(), Origin::kMeasured);
    for (float& f : part.f_per_sr[0]) {
      f = std::isnan(f) ? 0 : f;
    }
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  const SpecularGridBrdf tiles = decode_exr_tiles(encode_exr_tiles(grid, small(false)).value(), "t").value();
  REQUIRE(tiles.type() == ScatterType::kBtdf);
  REQUIRE(tiles.content().metadata.at("calibration_id") == "0011");
  REQUIRE(tiles.content().theta_i.size() == 3);
  const Direction i = from_spherical(tiles.content().theta_i[2], 0);
  const Direction d = from_spherical(kPi * 2.5 / 20, 2 * kPi * 7.5 / 36);
  const Direction o{d.x * i.z - d.z * i.x, d.y, -(d.x * i.x + d.z * i.z)};
  std::array<double, 3> random{};
  std::array<double, 3> systematic{};
  std::array<double, 3> none{};
  std::array<double, 3> total{};
  REQUIRE(grid.uncertainty(from_spherical(content.parts[2].theta_i, 0), o, random, systematic));
  REQUIRE(tiles.uncertainty(i, o, none, total));
  REQUIRE(total[1] == Approx(std::hypot(random[1], systematic[1])).epsilon(1e-4));
}

TEST_CASE("Equal tiles are equal files") {
  const auto model = make_model("lambertian:0.5").value();
  REQUIRE(encode_exr_tiles(*model, small(true)).value() == encode_exr_tiles(*model, small(true)).value());
}

TEST_CASE("Tiles cut anywhere are refused, and damaged ones never crash the reader") {
  const auto model = make_model("lambertian:0.5").value();
  const std::string good = encode_exr_tiles(*model, small(true)).value();
  for (std::size_t percent = 0; percent < 100; ++percent) {
    const auto cut = decode_exr_tiles(std::string_view(good).substr(0, good.size() * percent / 100), "cut");
    REQUIRE_FALSE(cut.has_value());
    CAPTURE(percent, cut.error().what);
    CHECK(cut.error().what.find("byte ") != std::string::npos);
  }
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string bytes = good;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (at % 8)));
    if (const auto tiles = decode_exr_tiles(bytes, "flip"); tiles) {
      REQUIRE(SpecularGridBrdf::make(tiles->content()).has_value());
    }
  }
}

TEST_CASE("Tiles of several sample rotations keep the azimuth of the light") {
  GridBrdf::Content content = test::sample_grid(80, 36).content();
  for (GridPart& part : content.parts) {
    part.origin.assign(part.origin.size(), Origin::kMeasured);
    part.f_per_sr[0][4] = 0.5F;
    part.phi_i = 0;
  }
  const std::vector<GridPart> unturned = content.parts;
  for (GridPart part : unturned) {
    part.rotation_rad = radians(90);
    part.phi_i = radians(90);
    for (auto& plane : part.f_per_sr) {
      for (float& f : plane) {
        f *= 3;
      }
    }
    content.parts.push_back(part);
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  const SpecularGridBrdf tiles = decode_exr_tiles(encode_exr_tiles(grid, small(false)).value(), "t").value();
  REQUIRE(tiles.content().rotation.size() == 2);
  REQUIRE(tiles.content().rotation[1] == Approx(radians(90)));
  std::array<double, 3> expected{};
  std::array<double, 3> found{};
  for (const double rotation : {0.0, radians(90)}) {
    const double a = tiles.content().theta_i[1];
    const Direction d = from_spherical(kPi * 3.5 / 20, 2 * kPi * 5.5 / 36);
    const Direction o{d.x * std::cos(a) - d.z * std::sin(a), d.y, d.x * std::sin(a) + d.z * std::cos(a)};
    const Direction turned{std::cos(rotation) * o.x - std::sin(rotation) * o.y,
                           std::sin(rotation) * o.x + std::cos(rotation) * o.y, o.z};
    const Direction i = from_spherical(a, rotation);
    REQUIRE(grid.eval(i, turned, expected) != Origin::kInvalid);
    REQUIRE(tiles.eval(i, turned, found) != Origin::kInvalid);
    REQUIRE(found[1] == Approx(expected[1]).epsilon(1e-4));
  }
}

TEST_CASE("A 3-D texture starts at 0, has equal steps, and says that it was resampled") {
  // PROVES: formats.md 6b, thesis eq. 41.
  REQUIRE(texture_incidences({0, 0.2, 0.4}).size() == 3);
  const auto even = texture_incidences({radians(20), radians(30), radians(60)});
  REQUIRE(even.size() == 7);
  for (std::size_t k = 0; k < 7; ++k) {
    REQUIRE(even[k] == Approx(radians(10.0 * static_cast<double>(k))).margin(1e-12));
  }
  REQUIRE(texture_incidences({0}).size() == 1);
  REQUIRE(texture_incidences({}).size() == 1);
  REQUIRE(texture_incidences({1e-3, 1}).size() == 64);
  const auto model = make_model("ggx:alpha=0.3,albedo=0.2").value();
  ExrTilesOptions options = small(true);
  options.texture_3d = true;
  options.theta_i = {radians(20), radians(30), radians(60)};
  const SpecularGridBrdf tiles = decode_exr_tiles(encode_exr_tiles(*model, options).value(), "3d").value();
  REQUIRE(tiles.content().theta_i.size() == 7);
  REQUIRE(tiles.content().metadata.at("resampled") == "theta_i 0 10 20 30 40 50 60 from 20 30 60 deg");
  options.theta_i = {0, radians(20), radians(40)};
  const SpecularGridBrdf as_it_was =
      decode_exr_tiles(encode_exr_tiles(*model, options).value(), "3d").value();
  REQUIRE(as_it_was.content().theta_i.size() == 3);
  REQUIRE_FALSE(as_it_was.content().metadata.contains("resampled"));
}

TEST_CASE("Tiles of any number of columns hold the same values") {
  const auto model = make_model("ggx:alpha=0.3,albedo=0.2").value();
  ExrTilesOptions options = small(false);
  const auto expected = decode_exr_tiles(encode_exr_tiles(*model, options).value(), "3").value();
  for (const std::size_t columns : {0, 1, 2, 4, 7}) {
    options.columns = columns;
    const auto found = decode_exr_tiles(encode_exr_tiles(*model, options).value(), "n").value();
    REQUIRE((found.content().f_per_sr == expected.content().f_per_sr));
    REQUIRE((found.content().origin == expected.content().origin));
  }
}

TEST_CASE("Tiles refuse what they cannot hold") {
  REQUIRE(encode_exr_tiles(test::sample_grid(16, 24, 5)).error().code == ErrorCode::kInvalidArgument);
  const auto model = make_model("lambertian:0.5").value();
  ExrTilesOptions options;
  options.width = 0;
  REQUIRE(encode_exr_tiles(*model, options).error().code == ErrorCode::kInvalidArgument);
  options.width = 4096;
  options.height = 4096;
  options.theta_i.resize(4096);
  REQUIRE(encode_exr_tiles(*model, options).error().code == ErrorCode::kInvalidArgument);
}
