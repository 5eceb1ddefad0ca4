#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/unit/tools/command.h"

using nlohmann::json;

namespace {

/// One clear error with a remedy, nothing else said, no crash, no hang.
void check_refused(const Finished& run, int status) {
  INFO(run.out.substr(0, 2000));
  INFO(run.err);
  CHECK(run.status == status);
  CHECK(run.err.rfind("error: ", 0) == 0);
  const auto remedy = run.err.find("\nremedy: ");
  REQUIRE(remedy != std::string::npos);
  CHECK(run.err.size() > remedy + 12);
  CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 2);
}

const std::vector<std::string> kVerbs = {"list",    "info",    "calibrate", "measure", "record",
                                         "process", "inspect", "convert",   "merge",   "atlas",
                                         "compare", "corrode", "fit",       "plot",    "simulate"};

}  // namespace

TEST_CASE("Every verb explains itself") {
  for (const auto& verb : kVerbs) {
    const auto run = scatter({verb, "--help"});
    CHECK(run.status == 0);
    CHECK(run.out.find("--json") != std::string::npos);
  }
  CHECK(scatter({"--help"}).status == 0);
  CHECK(scatter({"--version"}).out.find("scatter ") == 0);
}

TEST_CASE("Wrong usage ends with status 2 and says what would be right") {
  check_refused(scatter({}), 2);
  check_refused(scatter({"measure"}), 2);
  check_refused(scatter({"measure", "sim:", "-o", "x", "--no-such-option"}), 2);
  check_refused(scatter({"plot", "lambertian:0.5", "-o", "x.png", "--kind", "pie"}), 2);
  const auto typo = scatter({"mesure", "sim:"});
  check_refused(typo, 2);
  CHECK(typo.err.find("'measure'") != std::string::npos);
  const auto strange = scatter({"--json", "frobnicate"});
  CHECK(strange.status == 2);
  CHECK(json::parse(strange.out)["error"]["remedy"].get<std::string>().find("measure") != std::string::npos);
}

TEST_CASE("A URI that leads nowhere ends with status 1 and a remedy") {
  const Scratch folder;
  const std::string out = folder / "out";
  for (const char* uri :
       {"nonsense", "foo:bar", "usb:serial=SC42", "serial:/dev/ttyACM0", "tcp:127.0.0.1", "tcp:127.0.0.1:1",
        "unix:/no/such/socket", "replay:/no/such/file.scat", "sim:?sample=velvet:1",
        "sim:?sample=lambertian:7", "sim:?colour=red", "sim:?seed=minus", "sim:?fault=gremlin:1",
        "sim:?sample=file:/no/such/file", "", ":"}) {
    INFO(uri);
    check_refused(scatter({"measure", uri, "-o", out}), 1);
    check_refused(scatter({"calibrate", uri, "-o", out + ".scat"}), 1);
  }
}

TEST_CASE("With --json an error is on standard output for machines as well") {
  const auto run = scatter({"measure", "foo:bar", "-o", "nowhere", "--json"});
  check_refused(run, 1);
  const auto error = json::parse(run.out)["error"];
  CHECK(error["code"] == "INVALID_ARGUMENT");
  CHECK_FALSE(error["what"].get<std::string>().empty());
  CHECK_FALSE(error["remedy"].get<std::string>().empty());
}

TEST_CASE("A file of another format, an empty one, a folder and a missing one are refused with a remedy") {
  const Scratch folder;
  const std::string text = folder / "letter.txt";
  std::ofstream(text) << "Dear Sir or Madam\n";
  const std::string empty = folder / "empty.exr";
  std::ofstream{empty};
  const std::string picture = folder / "x.png";
  const std::string directory = folder / "directory.bsdf";
  std::filesystem::create_directory(directory);
  for (const std::string& file : {text, empty, directory, std::string(folder / "missing.bsdf")}) {
    INFO(file);
    check_refused(scatter({"inspect", file}), 1);
    check_refused(scatter({"info", file}), 1);
    check_refused(scatter({"compare", file, "lambertian:0.5"}), 1);
    check_refused(scatter({"plot", file, "-o", picture}), 1);
    check_refused(scatter({"convert", file, folder / "x.exr"}), 1);
    check_refused(scatter({"process", file, "-o", folder / "out"}), 1);
    check_refused(scatter({"measure", file, "-o", folder / "out"}), 1);
    check_refused(scatter({"measure", "sim:", "--calibration", file, "-o", folder / "out"}), 1);
  }
  CHECK_FALSE(std::filesystem::exists(picture));
}

TEST_CASE("A place that cannot be written to is named, and nothing half-written stays") {
  const Scratch folder;
  const std::string blocked = folder / "file";
  std::ofstream(blocked) << "in the way";
  check_refused(scatter({"measure", "sim:", "-o", blocked + "/out"}), 1);
  check_refused(scatter({"measure", "sim:", "-o", blocked}), 1);
  check_refused(scatter({"record", "sim:", "-o", blocked + "/x.scat"}), 1);
  check_refused(scatter({"plot", "lambertian:0.5", "-o", blocked + "/x.png"}), 1);
  check_refused(scatter({"convert", "lambertian:0.5", folder / "missing/x.exr"}), 1);
  check_refused(scatter({"plot", "lambertian:0.5", "-o", folder / "x.pdf"}), 1);
  CHECK(contents(blocked) == "in the way");
}

TEST_CASE("A full disk ends with status 1 and a remedy") {
  // By way of links, so that a fault here could replace a link and never the device.
  const Scratch folder;
  for (const char* name : {"full.png", "full.bsdf", "full.exr", "full.scat"}) {
    std::filesystem::create_symlink("/dev/full", folder / name);
  }
  check_refused(scatter({"plot", "lambertian:0.5", "-o", folder / "full.png"}), 1);
  check_refused(scatter({"convert", "lambertian:0.5", folder / "full.bsdf"}), 1);
  check_refused(scatter({"convert", "lambertian:0.5", folder / "full.exr"}), 1);
  check_refused(scatter({"record", "sim:", "-o", folder / "full.scat"}), 1);
  check_refused(scatter({"calibrate", "sim:", "-o", folder / "full.scat"}), 1);
  for (const char* name : {"full.png", "full.bsdf", "full.exr", "full.scat"}) {
    CHECK(std::filesystem::is_symlink(folder / name));
  }
  CHECK(std::filesystem::is_character_file("/dev/full"));
}

TEST_CASE("An answer that standard output does not take is a failure") {
  check_refused(Command({"list"}, "/dev/full").wait(), 1);
}

TEST_CASE("A format that cannot be written is answered with those that can") {
  const Scratch folder;
  for (const auto& arguments : std::vector<std::vector<std::string>>{
           {"convert", "lambertian:0.5", folder / "x.bsdf", "--format", "utia"},
           {"convert", "lambertian:0.5", folder / "x.doc"}}) {
    const auto run = scatter(arguments);
    check_refused(run, 1);
    CHECK(run.err.find("minidiff") != std::string::npos);
    CHECK(run.err.find("tiles") != std::string::npos);
  }
}

TEST_CASE("Contradictory rotations are refused before anything is computed") {
  check_refused(scatter({"process", "a.scat", "b.scat", "-o", "x", "--merge", "rotations"}), 1);
  check_refused(scatter({"process", "a.scat", "b.scat", "-o", "x", "--rotation", "0"}), 1);
}
