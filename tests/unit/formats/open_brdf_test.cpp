#include "host_sdk/formats/open_brdf.h"

#include <array>
#include <catch2/catch.hpp>
#include <filesystem>

#include "host_sdk/formats/classify.h"
#include "host_sdk/formats/exr_atlas.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/native_exr.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/unit/formats/real_data.h"
#include "tests/unit/formats/sample_grid.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

TEST_CASE("Files are known by their content") {
  const GridBrdf grid = test::sample_grid();
  REQUIRE(classify(encode_native_exr(grid).value()) == Format::kNativeExr);
  REQUIRE(classify(encode_minidiff(grid).value()) == Format::kMiniDiff);
  const auto tiles =
      encode_exr_tiles(*make_model("lambertian:0.5").value(), {.width = 8, .height = 8}).value();
  REQUIRE(classify(tiles) == Format::kExrTiles);
  REQUIRE(classify("#x\nScatterAzimuth 2\nScatterRadial 2\nDataBegin\nAOI 20\nPOI 0\n") == Format::kMiniDiff);
  REQUIRE(classify("Source Measured\nsamplerotation 1\n") == Format::kZemax);
  REQUIRE(classify(std::string("tensor_file\0\1\0", 14)) == Format::kRgl);
  REQUIRE(classify("{\"metadata\": {}, \"data\": {}}") == Format::kBird);
  REQUIRE(classify("\x89SCAT\r\n\x1a ...") == Format::kRecording);
  // MERL: 2 x 3 x 4 counts and three planes of doubles.
  std::string merl("\2\0\0\0\3\0\0\0\4\0\0\0", 12);
  merl.append(2 * 3 * 4 * 3 * 8, '\1');
  REQUIRE(classify(merl) == Format::kMerl);
  merl.pop_back();
  REQUIRE(classify(merl) == Format::kUnknown);
  for (const std::string& nothing :
       {std::string(), std::string("hello"), std::string("\0\0\0\0", 4), std::string("\x76\x2f")}) {
    REQUIRE(classify(nothing) == Format::kUnknown);
  }
}

TEST_CASE("Real files are told apart although three of them end in .bsdf") {
  if (const auto path = test::real_data("zemax/brown_vinyl_measured_brdf.bsdf"); path) {
    REQUIRE(classify(read_file(*path).value()) == Format::kZemax);
    REQUIRE(open_brdf(path->string()).value()->channels() == 1);
    REQUIRE(open_brdf("file:" + path->string()).value()->type() == ScatterType::kBrdf);
  }
  if (const auto path = test::real_data("rgl/ilm_solo_m_68_rgb.bsdf"); path) {
    REQUIRE(classify(read_file(*path).value()) == Format::kRgl);
    REQUIRE(open_brdf(path->string()).value()->channels() == 3);
  }
  for (const char* name : {"bird/example_generation_a.brdf", "bird/generation_c.json"}) {
    if (const auto path = test::real_data(name); path) {
      REQUIRE(classify(read_file(*path).value()) == Format::kBird);
      REQUIRE(open_brdf(path->string()).value()->type() == ScatterType::kBrdf);
    }
  }
}

TEST_CASE("Written files open by path, whatever their name") {
  const auto folder = std::filesystem::temp_directory_path() / "scatter_open_brdf_test";
  std::filesystem::create_directories(folder);
  const GridBrdf grid = test::sample_grid();
  const auto path = folder / "grid.bsdf";
  REQUIRE(write_native_exr(grid, path).has_value());
  REQUIRE(open_brdf(path.string()).value()->channels() == 3);
  REQUIRE(write_minidiff(grid, path).has_value());
  REQUIRE(open_brdf(path.string()).value()->channels() == 3);
  REQUIRE_FALSE(std::filesystem::exists(folder / "grid.bsdf.partial"));
  REQUIRE(write_file(path, "").has_value());
  REQUIRE(open_brdf(path.string()).error().what.find("is empty") != std::string::npos);
  REQUIRE(open_brdf(folder.string()).error().code == ErrorCode::kInvalidArgument);
  std::filesystem::remove_all(folder);
}

TEST_CASE("Models open by spec, and what is neither says how to name one") {
  REQUIRE(open_brdf("ggx:alpha=0.2").value()->channels() == 3);
  REQUIRE(open_brdf("ggx:alpha=7").error().code == ErrorCode::kInvalidArgument);
  const auto missing = open_brdf("no/such/file.exr");
  REQUIRE(missing.error().code == ErrorCode::kNotFound);
  REQUIRE(missing.error().remedy.find("lambertian:0.5") != std::string::npos);
  REQUIRE(open_brdf("file:ggx:alpha=0.2").error().code == ErrorCode::kNotFound);
}

TEST_CASE("A material of an atlas opens by the name behind the file's") {
  const auto folder = std::filesystem::temp_directory_path() / "scatter_open_atlas_test";
  std::filesystem::create_directories(folder);
  const auto path = folder / "two.exr";
  const auto dark = make_model("lambertian:0.1").value();
  const auto bright = make_model("lambertian:0.8").value();
  const AtlasMaterial materials[] = {{"dark", dark.get()}, {"bright", bright.get()}};
  REQUIRE(write_exr_atlas(materials, path, {.tiles = {.width = 8, .height = 8}}).has_value());
  const auto opened = open_brdf(path.string() + "#bright");
  REQUIRE(opened.has_value());
  std::array<double, 3> f{};
  REQUIRE((*opened)->eval({0, 0, 1}, {0, 0, 1}, f) != Origin::kInvalid);
  REQUIRE(f[0] == Approx(0.8 / kPi).epsilon(1e-3));  // half floats
  const auto unnamed = open_brdf(path.string());
  REQUIRE(unnamed.error().remedy.find("#dark") != std::string::npos);
  const auto wrong = open_brdf(path.string() + "#grey");
  REQUIRE(wrong.error().code == ErrorCode::kNotFound);
  REQUIRE(wrong.error().remedy.find("dark, bright") != std::string::npos);
  std::filesystem::remove_all(folder);
}
