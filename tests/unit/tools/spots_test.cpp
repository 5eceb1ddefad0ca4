// measure --spots as a user runs it.
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/unit/tools/command.h"

using nlohmann::json;

namespace {

/// A sheet that is grown at once: 6 mm with 128 cells.
const std::string kSheet = "corroded:age=5,extent_mm=6,starting_points=4";

}  // namespace

TEST_CASE("Spots of a sample that is the same everywhere differ by no more than they are uncertain") {
  const Scratch folder;
  const auto run = scatter(
      {"measure", "sim:?sample=lambertian:0.5&seed=4", "--spots", "2", "-o", folder / "out", "--json"});
  INFO(run.err);
  REQUIRE(run.status == 0);
  const auto answer = json::parse(run.out);
  CHECK(answer["spots_measured"] == 2);
  REQUIRE(answer["spread"].size() == 4);
  for (const auto& incidence : answer["spread"]) {
    for (const auto& channel : incidence["channels"]) {
      CHECK(channel["albedo"]["deviation_over_uncertainty"].get<double>() < 1);
      // 0.5 of the light, less what leaves beyond 75.5 deg.
      CHECK(channel["albedo"]["mean"].get<double>() ==
            Approx(0.5 * std::pow(std::sin(75.5 * 3.14159265 / 180), 2)).epsilon(0.02));
      CHECK(channel["diffuse_per_sr"]["mean"].get<double>() == Approx(0.5 / 3.14159265).epsilon(0.01));
    }
  }
  for (const char* file : {"spot-01/brdf.exr", "spot-02/report.html", "brdf.exr", "report.html",
                           "deviation.exr", "deviation.png", "spots.json"}) {
    CHECK(std::filesystem::exists(folder / "out" / file));
  }
  CHECK(json::parse(contents(folder / "out" / "spots.json"))["spread"] == answer["spread"]);
}

TEST_CASE("Ctrl-C keeps the spots that are finished, combines them and says that it was stopped") {
  const Scratch folder;
  const std::string uri = "sim:?sample=" + kSheet + "&seed=4";
  Command measuring({"measure", uri, "--spots", "500", "-o", folder / "out", "--json"});
  for (int k = 0; k < 3000 && !std::filesystem::exists(folder / "out" / "spot-02"); ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  measuring.signal(SIGINT);
  const auto run = measuring.wait(std::chrono::seconds(30));
  CHECK(run.status == 1);
  const auto kept = json::parse(contents(folder / "out" / "spots.json"));
  CHECK(kept["spots_wanted"] == 500);
  const auto measured = kept["spots_measured"].get<std::size_t>();
  CHECK(measured >= 1);
  CHECK(measured < 500);
  CHECK(kept["spots"].size() == measured);
  CHECK(kept["error"]["code"] == "ABORTED");
  CHECK(kept["spots"][0]["sample"] == kSheet);
  CHECK(std::filesystem::exists(folder / "out" / "report.html"));
}

TEST_CASE("Where nobody can move an instrument, several spots are refused before it is opened") {
  const Scratch folder;
  const auto run =
      scatter({"measure", "unix:" + (folder / "no.sock").string(), "--spots", "3", "-o", folder / "out"});
  CHECK(run.status == 1);
  CHECK(run.err.find("nobody at a terminal") != std::string::npos);
  CHECK(run.err.find("remedy: ") != std::string::npos);
  CHECK(scatter({"measure", "sim:", "--spots", "0", "-o", folder / "out"}).status == 2);
}

TEST_CASE("A spot's text from spots.json is its truth for compare, whatever stands for a model") {
  const auto run =
      scatter({"compare", kSheet + ",spot=0.3/0.4", kSheet + ",spot=0.3/0.4", "--region", "all", "--json"});
  INFO(run.err);
  REQUIRE(run.status == 0);
  CHECK(json::parse(run.out)["p99_relative_error"].get<double>() < 1e-6);
  const auto other =
      scatter({"compare", kSheet + ",spot=0.3/0.4", kSheet + ",spot=0.8/0.1", "--region", "all", "--json"});
  CHECK(json::parse(other.out)["p99_relative_error"].get<double>() > 0.01);
  const auto wrong = scatter({"compare", "corroded:age=1000", "lambertian:0.5"});
  CHECK(wrong.status == 1);
  CHECK(wrong.err.find("age is '1000', expected 0..100") != std::string::npos);
}

TEST_CASE("Inspect, plot and convert take a sheet's text where a model's may stand") {
  const Scratch folder;
  const auto inspected = scatter({"inspect", kSheet + ",spot=0.3/0.4", "--json"});
  INFO(inspected.err);
  REQUIRE(inspected.status == 0);
  const auto copper = scatter({"inspect", "patina:age=5,extent_mm=6", "-o", folder / "copper.png"});
  INFO(copper.err);
  CHECK(copper.status == 0);
  CHECK(std::filesystem::exists(folder / "copper.png"));
  CHECK(scatter({"plot", kSheet, "-o", folder / "curves.svg"}).status == 0);
  CHECK(scatter({"convert", kSheet, folder / "sheet.exr"}).status == 0);
}
