#include "host_sdk/formats/open_brdf.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <thread>

#include "host_sdk/formats/classify.h"
#include "host_sdk/formats/exr_atlas.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/merl.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/native_exr.h"
#include "host_sdk/formats/rgl.h"
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
  merl.pop_back();  // The reader says what does not fit.
  REQUIRE(classify(merl) == Format::kMerl);
  REQUIRE(classify(merl.substr(0, 12)) == Format::kMerl);
  REQUIRE(classify(std::string("\0\0\0\2\0\0\0\3\0\0\0\4", 12)) == Format::kMerl);
  REQUIRE(classify(std::string("\2\0\0\0\3\0\0\0\xFF\xFF\xFF\x7F", 12)) == Format::kMerl);
  REQUIRE(classify("hello", "x.binary") == Format::kMerl);
  REQUIRE(classify("", "x.binary") == Format::kUnknown);
  REQUIRE(classify("{}") == Format::kBird);
  REQUIRE(classify(" [") == Format::kBird);
  REQUIRE(classify("# a\n" + std::string(100'000, '\n') + "# b\nSampleRotation 1\n") == Format::kZemax);
  REQUIRE(classify(std::string("Source Meas\0red\nSampleRotation 1\n", 34)) == Format::kZemax);
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

TEST_CASE("What no reader takes is answered with what is there and every format that is read") {
  const auto text = decode_brdf("hello, world and more", "a.txt").error();
  CHECK(text.what.find("byte 0: found 'hello, world'") != std::string::npos);
  CHECK(text.remedy.find("BiRD") != std::string::npos);
  const auto binary = decode_brdf(std::string("\0\xFF\1", 3), "a").error();
  CHECK(binary.what.find("byte 0: found bytes 00 FF 01") != std::string::npos);
  CHECK(decode_brdf("\xFF\xFES", "a").error().what.find("byte 0: is UTF-16") != std::string::npos);
  CHECK(decode_brdf("", "a").error().remedy.find("BiRD") != std::string::npos);
  // The reader of the format names the place.
  CHECK(decode_brdf("{\"data\": {\"a\": ]", "a").error().what.find("byte ") != std::string::npos);
  CHECK(decode_brdf(std::string("\5\0\0\0\3\0\0\0\6\0\0\0", 12), "a").error().what ==
        "a: byte 12: the file has 12 bytes, 5 x 3 x 6 cells need 2172");
}

TEST_CASE("A pipe is refused at once by everything that reads files") {
  const auto path = std::filesystem::temp_directory_path() / fmt::format("scatter_pipe_{}", ::getpid());
  REQUIRE(::mkfifo(path.c_str(), 0600) == 0);
  // Somebody who writes comes late, so that an error of ours is no hang of the test.
  std::atomic<bool> done = false;
  std::thread late([&] {
    for (int k = 0; k < 50 && !done; ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    if (!done) {
      ::close(::open(path.c_str(), O_RDWR | O_NONBLOCK));
    }
  });
  const auto start = std::chrono::steady_clock::now();
  CHECK(open_brdf(path.string()).error().what.find("is a pipe or a device") != std::string::npos);
  CHECK(read_merl(path).error().what.find("is a pipe or a device") != std::string::npos);
  CHECK(read_rgl(path).error().what.find("is a pipe or a device") != std::string::npos);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(2));
  done = true;
  late.join();
  std::filesystem::remove(path);
}
