// PROVES: docs/corrosion.md, what `scatter corrode` writes and refuses.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/unit/tools/command.h"
#include "tests/unit/tools/picture.h"

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

Finished corrode(std::vector<std::string> arguments, const fs::path& out) {
  arguments.insert(arguments.begin(), "corrode");
  arguments.insert(arguments.end(), {"-o", out.string()});
  return scatter(arguments);
}

double mean(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) {
    sum += static_cast<double>(value);
  }
  return sum / static_cast<double>(values.size());
}

/// Every file below a folder, by its path in it.
std::map<std::string, std::string> all_files(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), folder).string()] = contents(entry.path());
    }
  }
  return files;
}

/// Left half dark, right half white.
Picture halves(std::size_t channels) {
  Picture made{.width = 64, .height = 64, .channels = channels, .values = {}};
  for (std::size_t n = 0; n < 64 * 64; ++n) {
    made.values.insert(made.values.end(), channels, n % 64 < 32 ? 0.0F : 1.0F);
  }
  return made;
}

}  // namespace

TEST_CASE("corrode writes every map and says the same in JSON as the heights do, in both modes") {
  const Scratch folder;
  for (const std::string mode : {"physical", "thesis"}) {
    const fs::path out = folder / mode;
    const auto run = corrode({"--age", "10", "--corrosivity", "high", "--starting-points", "12", "--size",
                              "96", "--seed", "3", "--thickness-mm", "2", "--mode", mode, "--json"},
                             out);
    INFO(run.err);
    REQUIRE(run.status == 0);
    const auto answer = json::parse(run.out);
    for (const char* key :
         {"mass_loss_g_per_m2", "target_g_per_m2", "corroded_fraction", "state3_fraction", "hole_fraction",
          "events", "seconds", "exhausted", "hash", "options", "notes", "files"}) {
      CHECK(answer.contains(key));
    }
    for (const char* file : {"height.exr", "albedo.exr", "regime.png", "normal.png", "roughness.exr",
                             "opacity.png", "age.exr", "preview.png", "corrosion.json"}) {
      CHECK(fs::exists(out / file));
      const auto& files = answer["files"];
      CHECK(std::count(files.begin(), files.end(), (out / file).string()) == 1);
    }
    const Picture height = picture(out / "height.exr");
    CHECK(height.width == 96);
    CHECK(height.height == 96);
    CHECK(height.channels == 1);
    // 7.8 g/cm^3 and 2 mm: 15600 g/m^2. Table 2 of corrosion.md: high, 10 years, 2074.4.
    const double lost = 15600 * (1 - mean(height.values));
    CHECK(answer["target_g_per_m2"].get<double>() == Approx(2074.4).epsilon(1e-4));
    CHECK(lost == Approx(answer["mass_loss_g_per_m2"].get<double>()).epsilon(1e-6));
    CHECK(lost == Approx(2074.4).epsilon(1e-3));
    CHECK(picture(out / "albedo.exr").channels == 3);
    CHECK(picture(out / "normal.png").channels == 3);
    const double holes = 1 - mean(picture(out / "opacity.png").values);
    CHECK(holes == Approx(answer["hole_fraction"].get<double>()).margin(1e-9));
    const Picture regime = picture(out / "regime.png");
    double metal = 0;
    for (std::size_t n = 0; n < regime.pixels(); ++n) {
      metal += regime.values[3 * n + 2] == 192.0F / 255 ? 1 : 0;
    }
    CHECK(1 - metal / (96.0 * 96.0) == Approx(answer["corroded_fraction"].get<double>()).margin(1e-9));
    auto stored = json::parse(contents(out / "corrosion.json"));
    CHECK(stored["hash"] == answer["hash"]);
    CHECK(stored["options"] == answer["options"]);
  }
}

TEST_CASE("A series is one run: each age is the sheet that a run to that age alone gives") {
  const Scratch folder;
  const auto series = corrode({"--series", "20,1,5", "--size", "64", "--json"}, folder / "series");
  REQUIRE(series.status == 0);
  const auto sheets = json::parse(series.out)["sheets"];
  REQUIRE(sheets.size() == 3);
  CHECK(fs::exists(folder / "series/strip.png"));
  double before = -1;
  for (const auto& [n, age] : {std::pair{0U, "1"}, {1U, "5"}, {2U, "20"}}) {
    const fs::path alone = folder / age;
    const auto run = corrode({"--age", age, "--size", "64", "--json"}, alone);
    REQUIRE(run.status == 0);
    CHECK(sheets[n]["hash"] == json::parse(run.out)["hash"]);
    CHECK(sheets[n]["folder"] == "age-" + std::string(age));
    CHECK(contents(folder / ("series/age-" + std::string(age)) / "height.exr") ==
          contents(alone / "height.exr"));
    CHECK(sheets[n]["corroded_fraction"].get<double>() >= before);
    before = sheets[n]["corroded_fraction"].get<double>();
  }
}

TEST_CASE("A batch of seeds on all cores gives the same bytes as each seed alone") {
  const Scratch folder;
  const auto batch = corrode({"--seeds", "3..8", "--size", "64", "--json"}, folder / "batch");
  INFO(batch.err);
  REQUIRE(batch.status == 0);
  const auto sheets = json::parse(batch.out)["sheets"];
  REQUIRE(sheets.size() == 6);
  for (unsigned n = 0; n < 6; ++n) {
    const std::string seed = std::to_string(n + 3);
    REQUIRE(corrode({"--seed", seed, "--size", "64"}, folder / seed).status == 0);
    auto alone = all_files(folder / seed);
    alone.erase("corrosion.json");
    CHECK(all_files(folder / ("batch/seed-" + seed)) == alone);
    CHECK(sheets[n]["seed"] == n + 3);
  }
  CHECK(sheets[0]["hash"] != sheets[1]["hash"]);
}

TEST_CASE("White surface with no least susceptibility is never entered; a colour map means its luminance") {
  const Scratch folder;
  save_png(folder / "grey.png", halves(1));
  save_png(folder / "colour.png", halves(3));
  std::string hash;
  for (const char* name : {"grey.png", "colour.png"}) {
    const auto run = corrode({"--surface", folder / name, "--least-susceptibility", "0", "--size", "64",
                              "--border", "clamped", "--age", "5", "--json"},
                             folder / "out");
    INFO(run.err);
    REQUIRE(run.status == 0);
    const Picture height = picture(folder / "out/height.exr");
    for (std::size_t n = 0; n < height.pixels(); ++n) {
      if (n % 64 > 33) {
        REQUIRE(height.values[n] == 1);
      }
    }
    const auto found = json::parse(run.out)["hash"].get<std::string>();
    CHECK((hash.empty() || hash == found));
    hash = found;
  }
}

TEST_CASE(
    "Under a cover next to nothing rusts, and a nobler metal does not at all; both make their surroundings "
    "rust") {
  const Scratch folder;
  Picture mask{.width = 16, .height = 16, .channels = 1, .values = std::vector<float>(256, 0.0F)};
  for (std::size_t n = 0; n < 256; ++n) {
    mask.values[n] = n % 16 / 4 == 1 ? 1.0F : 0.0F;  // a stripe from 1/4 to 1/2
  }
  save_png(folder / "mask.png", mask);
  const auto lost = [&](const std::string& option) {
    std::vector<std::string> arguments = {"--size",        "64", "--age", "3", "--starting-points", "200",
                                          "--late-points", "0"};
    if (!option.empty()) {
      arguments.insert(arguments.end(), {option, folder / "mask.png"});
    }
    const auto run = corrode(arguments, folder / "out");
    INFO(run.err);
    REQUIRE(run.status == 0);
    const Picture height = picture(folder / "out/height.exr");
    std::array<double, 2> inside_and_beside{};
    for (std::size_t n = 0; n < height.pixels(); ++n) {
      const std::size_t x = n % 64;
      if (x >= 19 && x < 29) {  // between the middles of the mask's outer cells

        inside_and_beside[0] += 1 - static_cast<double>(height.values[n]);
      } else if ((x >= 12 && x < 16) || (x >= 32 && x < 36)) {
        inside_and_beside[1] += 1 - static_cast<double>(height.values[n]);
      }
    }
    return inside_and_beside;
  };
  const auto open = lost("");
  const auto cover = lost("--cover");
  const auto contact = lost("--contact");
  CHECK(cover[0] < 0.1 * open[0]);
  CHECK(contact[0] == 0);
  CHECK(cover[1] > open[1]);
  CHECK(contact[1] > open[1]);
}

TEST_CASE("An opening is a hole from the start and no lost metal") {
  const Scratch folder;
  Picture opening{.width = 8, .height = 8, .channels = 1, .values = std::vector<float>(64, 1.0F)};
  opening.values[27] = opening.values[28] = opening.values[35] = opening.values[36] = 0;
  save_png(folder / "opening.png", opening);
  const auto run =
      corrode({"--opening", folder / "opening.png", "--age", "0", "--size", "64", "--json"}, folder / "out");
  INFO(run.err);
  REQUIRE(run.status == 0);
  const auto answer = json::parse(run.out);
  CHECK(answer["mass_loss_g_per_m2"] == 0);
  CHECK(answer["hole_fraction"] == 0);
  const Picture opacity = picture(folder / "out/opacity.png");
  CHECK(opacity.values[32 * 64 + 32] == 0);
  CHECK(opacity.values[0] == 1);
}

TEST_CASE("The glTF material refers to files that are there, with a quad of the sheet's size") {
  const Scratch folder;
  const fs::path out = folder / "out";
  REQUIRE(corrode({"--size", "32", "--age", "60", "--map-set", "gltf", "--extent-mm", "80"}, out).status ==
          0);
  const auto gltf = json::parse(contents(out / "corroded.gltf"));
  CHECK(gltf["asset"]["version"] == "2.0");
  for (const auto& entry : gltf["images"]) {
    CHECK(fs::exists(out / entry["uri"].get<std::string>()));
  }
  CHECK(gltf["accessors"][0]["max"] == json::array({0.04F, 0.04F, 0.0F}));
  std::size_t end = 0;
  for (const auto& view : gltf["bufferViews"]) {
    CHECK(view["byteOffset"] == end);
    end += view["byteLength"].get<std::size_t>();
  }
  CHECK(gltf["buffers"][0]["byteLength"] == end);
  const std::string uri = gltf["buffers"][0]["uri"];
  const auto comma = uri.find(',');
  CHECK((uri.size() - comma - 1) / 4 == (end + 2) / 3);
  const Picture base = picture(out / "base_color.png", Numbers::kSrgb);
  const Picture opacity = picture(out / "opacity.png");
  const Picture albedo = picture(out / "albedo.exr");
  const Picture packed = picture(out / "metallic_roughness.png");
  const Picture roughness = picture(out / "roughness.exr");
  REQUIRE(base.channels == 4);
  for (std::size_t n = 0; n < base.pixels(); ++n) {
    REQUIRE(base.values[4 * n + 3] == opacity.values[n]);
    REQUIRE(base.values[4 * n] == Approx(albedo.values[3 * n]).margin(0.006));  // 8 bits in sRGB
    REQUIRE(packed.values[3 * n + 1] == Approx(std::sqrt(roughness.values[n])).margin(0.003));
  }
}

TEST_CASE(
    "A pristine sheet is drawn grey and sees the whole sky; a rusty one is drawn redder where it is rusty") {
  const Scratch folder;
  REQUIRE(corrode({"--size", "64", "--age", "0", "--map-set", "gltf"}, folder / "new").status == 0);
  const Picture fresh = picture(folder / "new/preview.png", Numbers::kSrgb);
  for (std::size_t n = 0; n < fresh.pixels(); ++n) {
    // Iron at normal incidence: 0.529, 0.511, 0.500, in one light; 8 bits in sRGB.
    REQUIRE(fresh.values[3 * n + 1] == Approx(fresh.values[3 * n] * 0.511 / 0.529).margin(0.008));
    REQUIRE(fresh.values[3 * n] > 0.3F);
  }
  for (const float share : picture(folder / "new/occlusion.png").values) {
    REQUIRE(share == 1);
  }
  REQUIRE(corrode({"--size", "64", "--age", "10"}, folder / "old").status == 0);
  const Picture old = picture(folder / "old/preview.png", Numbers::kSrgb);
  const Picture regime = picture(folder / "old/regime.png");
  for (std::size_t n = 0; n < old.pixels(); ++n) {
    const bool metal = regime.values[3 * n + 2] == 192.0F / 255;
    if (metal) {
      REQUIRE(old.values[3 * n + 2] > 0.8F * old.values[3 * n]);
    } else {
      REQUIRE(old.values[3 * n + 2] < old.values[3 * n] + 0.01F);
    }
  }
}

TEST_CASE("The pbrt scene refers to files that are there") {
  const Scratch folder;
  const fs::path out = folder / "out";
  REQUIRE(corrode({"--size", "32", "--map-set", "pbrt"}, out).status == 0);
  const std::string scene = contents(out / "corroded.pbrt");
  int found = 0;
  for (auto at = scene.find("[ \""); at != std::string::npos; at = scene.find("[ \"", at + 1)) {
    const std::string word = scene.substr(at + 3, scene.find('"', at + 3) - at - 3);
    if (word.ends_with(".png") || (word.ends_with(".exr") && word != "corroded_render.exr")) {
      CHECK(fs::exists(out / word));
      ++found;
    }
  }
  CHECK(found == 6);
}

TEST_CASE("Bad input of corrode names the parameter, leaves no folder and ends with the right status") {
  const Scratch folder;
  const fs::path out = folder / "out";
  save_png(folder / "small.png", Picture{.width = 2, .height = 2, .channels = 1, .values = {0, 0, 0, 0}});
  save_png(folder / "large.png", halves(1));
  Picture holed = halves(1);
  holed.values[64 * 5 + 7] = std::numeric_limits<float>::quiet_NaN();
  save_exr(folder / "nan.exr", holed);
  std::ofstream(folder / "cut.png", std::ios::binary) << contents(folder / "large.png").substr(0, 60);
  struct Case {
    std::vector<std::string> arguments;
    int status;
    std::string words;
  };
  for (const Case& bad : {
           Case{{"--surface", folder / "small.png", "--material", folder / "large.png"},
                1,
                "material: the image has 64 x 64"},
           Case{{"--surface", folder / "nan.exr"}, 1, "column 7, row 5 is nan"},
           Case{{"--surface", folder / "cut.png"}, 1, "surface: "},
           Case{{"--surface", folder / "none.png"}, 1, "no such file"},
           Case{{"--exposure", "-1"}, 1, "exposure"},
           Case{{"--surface", folder / "large.png", "--cover", folder / "small.png"},
                1,
                "cover: the image has 2 x 2"},
           Case{{"--cover", "1", "--covered-exposure", "2"}, 1, "covered"},
           Case{{"--contact", "1"}, 1, "contact"},
           Case{{"--layer2", "0.1/0.2"}, 1, "layer2"},
           Case{{"--layer2", "7/0/0"}, 1, "layer 2"},
           Case{{"--thickness-mm", "0"}, 1, "thickness_mm"},
           Case{{"--extent-mm", "-5"}, 1, "extent_mm"},
           Case{{"--size", "16", "--starting-points", "257"}, 1, "starting_points: 257"},
           Case{{"--size", "7"}, 2, "--size"},
           Case{{"--starting-points", "0"}, 2, "--starting-points"},
           Case{{"--corrosivity", "spicy"}, 2, "very low, low, medium, high or very high"},
           Case{{"--law", "murphy"}, 2, "--law"},
           Case{{"--age", "old"}, 2, "--age"},
           Case{{"--age", "nan"}, 1, "age: is nan"},
           Case{{"--series", "1,inf"}, 1, "series: is inf"},
           Case{{"--seeds", "5..1"}, 2, "--seeds"},
           Case{{"--seeds", "1,1"}, 2, "--seeds"},
           Case{{"--seeds", "1..2", "--seed", "4"}, 2, "excludes"},
       }) {
    auto arguments = bad.arguments;
    if (std::ranges::find(arguments, "--size") == arguments.end()) {
      arguments.insert(arguments.end(), {"--size", "32"});
    }
    const auto run = corrode(arguments, out);
    INFO(run.err);
    CHECK(run.status == bad.status);
    CHECK(run.err.rfind("error: ", 0) == 0);
    CHECK(run.err.find("\nremedy: ") != std::string::npos);
    CHECK(run.err.find(bad.words) != std::string::npos);
    CHECK_FALSE(fs::exists(out));
  }
  // A size that no machine of today holds is refused before anything is taken.
  const auto huge = corrode(
      {"--size", "16384", "--mode", "thesis", "--bite", "0.00001", "--corrosivity", "very-high"}, out);
  INFO(huge.err);
  CHECK(huge.status == 1);
  CHECK(huge.err.find("size: 16384 x 16384 cells need about") != std::string::npos);
  CHECK_FALSE(fs::exists(out));
}

TEST_CASE("Ages out of range are clamped with a note, and a used-up sheet says so") {
  const Scratch folder;
  const auto old = corrode({"--age", "150", "--size", "32", "--json"}, folder / "old");
  REQUIRE(old.status == 0);
  CHECK(json::parse(old.out)["age_years"] == 100);
  CHECK(json::parse(old.out)["notes"][0] == "age 150 is taken as 100 years");
  const auto gone =
      corrode({"--corrosivity", "very-high", "--age", "15", "--size", "32", "--json"}, folder / "gone");
  REQUIRE(gone.status == 0);
  const auto answer = json::parse(gone.out);
  CHECK(answer["exhausted"] == true);
  CHECK(answer["mass_loss_g_per_m2"].get<double>() == Approx(7800).epsilon(1e-6));
  CHECK(answer["target_g_per_m2"].get<double>() == Approx(8088.1).epsilon(1e-4));
}

TEST_CASE("An output folder keeps what others put there; one that cannot be is refused") {
  const Scratch folder;
  const fs::path out = folder / "out";
  fs::create_directories(out);
  std::ofstream(out / "letter.txt") << "Dear Sir or Madam\n";
  std::ofstream(out / "height.exr") << "old";
  REQUIRE(corrode({"--size", "32"}, out).status == 0);
  CHECK(contents(out / "letter.txt") == "Dear Sir or Madam\n");
  CHECK(picture(out / "height.exr").width == 32);
  for (const auto& entry : fs::directory_iterator(out)) {
    CHECK_FALSE(entry.path().filename().string().starts_with('.'));
  }
  const auto under_file = corrode({"--size", "32"}, out / "letter.txt/deeper");
  CHECK(under_file.status == 1);
  CHECK(under_file.err.find("remedy: ") != std::string::npos);
}

TEST_CASE("Ctrl-C ends corrode in order and leaves nothing behind") {
  const Scratch folder;
  const fs::path out = folder / "out";
  Command command({"corrode", "--size", "1024", "--seeds", "1..500", "-o", out.string()});
  const auto begun = [&folder] { return !fs::is_empty(folder / ""); };
  for (int k = 0; k < 1000 && !begun(); ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  command.signal(SIGINT);
  const auto run = command.wait();
  INFO(run.err);
  CHECK(run.status == 1);
  CHECK(run.err.find("stopped before") != std::string::npos);
  CHECK(fs::is_empty(folder / ""));
}
