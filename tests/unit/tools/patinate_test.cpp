// PROVES: docs/patina.md, what `scatter patinate` writes and refuses.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/unit/tools/command.h"
#include "tests/unit/tools/picture.h"

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

Finished patinate(std::vector<std::string> arguments, const fs::path& out) {
  arguments.insert(arguments.begin(), "patinate");
  arguments.insert(arguments.end(), {"--size", "64", "--extent-mm", "3.2", "-o", out.string()});
  return scatter(arguments);
}

double mean(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) {
    sum += static_cast<double>(value);
  }
  return sum / static_cast<double>(values.size());
}

}  // namespace

TEST_CASE("patinate writes every map and says the same in JSON as the maps do") {
  const Scratch folder;
  const fs::path out = folder / "piece";
  const auto run = patinate({"--atmosphere", "marine", "--age", "12", "--patch-sigma", "0", "--json"}, out);
  INFO(run.err);
  REQUIRE(run.status == 0);
  const auto answer = json::parse(run.out);
  for (const char* file : {"height.exr", "tarnish.exr", "patina.exr", "albedo.exr", "metalness.exr",
                           "roughness.exr", "normal.png", "preview.png", "patina.json"}) {
    CHECK(fs::exists(out / file));
    const auto& files = answer["files"];
    CHECK(std::count(files.begin(), files.end(), (out / file).string()) == 1);
  }
  // ISO 9224: 12^0.667 um at 1 um in the first year.
  CHECK(answer["copper_loss_um"].get<double>() == Approx(5.246).epsilon(1e-3));
  const double tarnish = mean(picture(out / "tarnish.exr").values);
  const double green = mean(picture(out / "patina.exr").values);
  CHECK(tarnish == Approx(answer["tarnish_um"].get<double>()).epsilon(1e-5));
  CHECK(green == Approx(answer["patina_um"].get<double>()).epsilon(1e-5));
  CHECK(mean(picture(out / "height.exr").values) == Approx(tarnish + green).epsilon(1e-5));
  CHECK(answer["bare_fraction"].get<double>() + answer["tarnish_fraction"].get<double>() +
            answer["patina_fraction"].get<double>() ==
        Approx(1));
  const Picture albedo = picture(out / "albedo.exr");
  REQUIRE(albedo.channels == 3);
  double red = 0;
  double greenness = 0;
  for (std::size_t n = 0; n < albedo.pixels(); ++n) {
    red += static_cast<double>(albedo.values[3 * n]);
    greenness += static_cast<double>(albedo.values[3 * n + 1]);
  }
  CHECK(greenness > 1.5 * red);
  CHECK(json::parse(contents(out / "patina.json"))["options"] == answer["options"]);
}

TEST_CASE("Ages of a series are the pieces that runs to that age alone give") {
  const Scratch folder;
  const auto series = patinate({"--series", "20,2", "--json"}, folder / "series");
  REQUIRE(series.status == 0);
  CHECK(fs::exists(folder / "series/strip.png"));
  REQUIRE(json::parse(series.out)["ages"].size() == 2);
  REQUIRE(patinate({"--age", "2"}, folder / "alone").status == 0);
  for (const char* file : {"patina.exr", "tarnish.exr", "preview.png"}) {
    CHECK(contents(folder / "series" / "age-2" / file) == contents(folder / "alone" / file));
  }
}

TEST_CASE("A script is done to the piece: what is polished has no more than its level") {
  const Scratch folder;
  REQUIRE(patinate({"--age", "30", "--script", "polish:level=9;coat:tarnish,rate=1,years=2"}, folder / "worn")
              .status == 0);
  const Picture height = picture(folder / "worn" / "height.exr");
  CHECK(*std::ranges::max_element(height.values) <= 11.0001F);
}

TEST_CASE("patinate refuses what it cannot do, by name, and writes nothing") {
  const Scratch folder;
  const auto refused = [&](std::vector<std::string> arguments, const std::string& word) {
    const auto run = patinate(std::move(arguments), folder / "none");
    INFO(run.err);
    CHECK(run.status != 0);
    CHECK(run.err.find(word) != std::string::npos);
    CHECK_FALSE(fs::exists(folder / "none"));
  };
  refused({"--atmosphere", "lunar"}, "lunar");
  refused({"--deposition", "heavy"}, "heavy");
  refused({"--exposure", "-1"}, "exposure");
  refused({"--wetness", "no-such-file.png"}, "no-such-file.png");
  refused({"--particle-um", "0"}, "particle_um");
  refused({"--script", "paint:red"}, "paint");
  refused({"--series", "1,nan"}, "nan");
}
