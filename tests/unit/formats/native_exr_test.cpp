#include "host_sdk/formats/native_exr.h"

#include <catch2/catch.hpp>
#include <cstring>

#include "tests/unit/formats/sample_grid.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

void require_same(const GridBrdf& a, const GridBrdf& b) {
  REQUIRE(a.content().type == b.content().type);
  REQUIRE(a.content().channels == b.content().channels);
  REQUIRE(a.content().wavelengths_nm == b.content().wavelengths_nm);
  REQUIRE(a.content().metadata == b.content().metadata);
  REQUIRE(a.content().theta_count == b.content().theta_count);
  REQUIRE(a.content().phi_count == b.content().phi_count);
  REQUIRE(a.content().theta_step == Approx(b.content().theta_step).epsilon(1e-15));
  REQUIRE(a.content().phi_step == Approx(b.content().phi_step).epsilon(1e-15));
  REQUIRE(a.content().parts.size() == b.content().parts.size());
  for (std::size_t p = 0; p < a.content().parts.size(); ++p) {
    const GridPart& x = a.content().parts[p];
    const GridPart& y = b.content().parts[p];
    REQUIRE(x.theta_i == Approx(y.theta_i).epsilon(1e-15));
    REQUIRE(x.phi_i == Approx(y.phi_i).epsilon(1e-15));
    REQUIRE(x.rotation_rad == Approx(y.rotation_rad).epsilon(1e-15));
    REQUIRE(x.origin == y.origin);
    REQUIRE(same_bits(x.pixels, y.pixels));
    REQUIRE(x.random_per_sr.size() == y.random_per_sr.size());
    REQUIRE(x.systematic_per_sr.size() == y.systematic_per_sr.size());
    for (std::size_t c = 0; c < a.content().channels; ++c) {
      REQUIRE(same_bits(x.f_per_sr[c], y.f_per_sr[c]));
      if (!x.random_per_sr.empty()) {
        REQUIRE(same_bits(x.random_per_sr[c], y.random_per_sr[c]));
      }
      if (!x.systematic_per_sr.empty()) {
        REQUIRE(same_bits(x.systematic_per_sr[c], y.systematic_per_sr[c]));
      }
    }
  }
}

}  // namespace

TEST_CASE("Native EXR keeps every bit of values, uncertainties, pixels and origins") {
  // PROVES: formats.md 6.
  for (const std::size_t channels : {1, 3, 5}) {
    const GridBrdf grid = test::sample_grid(16, 24, channels);
    const std::string bytes = encode_native_exr(grid).value();
    require_same(grid, decode_native_exr(bytes, "memory").value());
  }
}

TEST_CASE("Native EXR keeps BTDF, rotations and absent uncertainties") {
  GridBrdf::Content content = test::sample_grid().content();
  content.type = ScatterType::kBtdf;
  content.wavelengths_nm.clear();
  content.parts[1].rotation_rad = radians(90);
  for (GridPart& part : content.parts) {
    part.random_per_sr.clear();
    part.systematic_per_sr.clear();
    part.pixels.clear();
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  require_same(grid, decode_native_exr(encode_native_exr(grid).value(), "memory").value());
}

TEST_CASE("The same grid gives the same bytes") {
  REQUIRE(encode_native_exr(test::sample_grid()).value() == encode_native_exr(test::sample_grid()).value());
}

TEST_CASE("Two parts of the same incidence get different names") {
  GridBrdf::Content content = test::sample_grid().content();
  content.parts.push_back(content.parts[0]);
  content.parts.push_back(content.parts[0]);
  const GridBrdf grid = GridBrdf::make(content).value();
  require_same(grid, decode_native_exr(encode_native_exr(grid).value(), "memory").value());
}

TEST_CASE("A native EXR cut anywhere is refused with its name") {
  const std::string bytes = encode_native_exr(test::sample_grid()).value();
  for (std::size_t percent = 0; percent < 100; ++percent) {
    const auto grid =
        decode_native_exr(std::string_view(bytes).substr(0, bytes.size() * percent / 100), "cut.exr");
    CAPTURE(percent);
    REQUIRE_FALSE(grid.has_value());
    REQUIRE(grid.error().what.starts_with("cut.exr"));
    CHECK(grid.error().what.find("byte ") != std::string::npos);
    REQUIRE_FALSE(grid.error().remedy.empty());
  }
}

TEST_CASE("A native EXR with a damaged byte never gives an inconsistent grid") {
  const std::string good = encode_native_exr(test::sample_grid(4, 6)).value();
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string bytes = good;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (at % 8)));
    if (const auto grid = decode_native_exr(bytes, "flip.exr"); grid) {
      REQUIRE(GridBrdf::make(grid->content()).has_value());
    }
  }
}

TEST_CASE("A header that claims a giant image is refused before memory is taken") {
  std::string bytes = encode_native_exr(test::sample_grid(16, 24)).value();
  const std::size_t at = bytes.find("dataWindow");
  REQUIRE(at != std::string::npos);
  // name\0 box2i\0 size(4) xMin yMin xMax yMax
  const std::size_t x_max = at + 11 + 6 + 4 + 8;
  const std::int32_t huge = 200'000'000;
  std::memcpy(bytes.data() + x_max, &huge, sizeof huge);
  const auto grid = decode_native_exr(bytes, "huge.exr");
  REQUIRE_FALSE(grid.has_value());
}

TEST_CASE("Reading a missing file or a folder says so") {
  REQUIRE(read_native_exr("/nonexistent/a.exr").error().code == ErrorCode::kNotFound);
  REQUIRE(read_native_exr("/").error().code == ErrorCode::kInvalidArgument);
  REQUIRE_FALSE(write_native_exr(test::sample_grid(), "/nonexistent/a.exr").has_value());
}
