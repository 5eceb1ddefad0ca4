// scatter measure --on-button, whole: the program, the press on the instrument, the files.
// PROVES: docs/usb.md "Rescue": asks, begins at the press, measures once; ctrl-C and unplugging end the wait.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/usb/person.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;

namespace {

namespace fs = std::filesystem;

const std::string kAsks = "press the measure button";

/// A home of its own, so that no calibration of somebody's is used or left behind; gone with the object.
class Home {
 public:
  Home() {
    std::string name = (fs::temp_directory_path() / "scatter-button-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    ::setenv("HOME", folder_.c_str(), 1);
    ::unsetenv("XDG_DATA_HOME");
  }
  ~Home() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Home(const Home&) = delete;
  Home& operator=(const Home&) = delete;
  [[nodiscard]] fs::path results() const { return folder_ / "out"; }

 private:
  fs::path folder_;
};

std::vector<std::string> on_button(const Home& home, const std::string& uri = "usb:") {
  return {SCATTER_BINARY, "measure", uri, "--on-button", "-o", home.results().string(), "--json"};
}

std::string start_of(const fs::path& file, std::size_t size) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes(size, '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  return bytes;
}

/// Each figure once, whole: the program itself reads them back.
void check_results(const fs::path& folder, const nlohmann::json& answer) {
  const std::vector<std::string> files = answer["files"];
  CHECK(files.size() == 6);
  for (const char* name :
       {"recording.scat", "brdf.exr", "brdf.bsdf", "quality.json", "lobe.png", "report.html"}) {
    INFO(name);
    REQUIRE(fs::is_regular_file(folder / name));
    CHECK(std::ranges::count(files, (folder / name).string()) == 1);
  }
  // Nothing beside them: no temporary names are left.
  CHECK(std::distance(fs::directory_iterator(folder), {}) == 6);
  for (const char* name : {"recording.scat", "brdf.exr"}) {
    INFO(name);
    const Ended read = Person({SCATTER_BINARY, "inspect", (folder / name).string(), "--json"}, true).ends();
    INFO(read.said);
    CHECK(read.status == 0);
  }
  CHECK(start_of(folder / "lobe.png", 8) == "\x89PNG\r\n\x1a\n");
  CHECK_NOTHROW(nlohmann::json::parse(std::ifstream(folder / "quality.json")));
  const auto& ledger = answer["ledger"];
  CHECK(ledger["exposed"] == ledger["delivered"]);
  CHECK(ledger["exposed"] > 0);
}

/// The measurement begins; its rest is not worth the time.
void check_begins(BusControl& bus, Person& person, std::uint64_t bytes_before) {
  CHECK(soon([&] { return bus.statistics()["bytes_in"] > bytes_before + 100'000; }, std::chrono::seconds(5)));
  ::kill(person.process(), SIGINT);
  CHECK(person.ends().status == 1);
}

void check_error(const Ended& ended, const char* code, const char* text) {
  INFO(ended.said);
  CHECK(ended.status == 1);
  CHECK(ended.said.find("remedy: ") != std::string::npos);
  const auto error = nlohmann::json::parse(ended.out)["error"];
  CHECK(error["code"] == code);
  CHECK(error["what"].get<std::string>().find(text) != std::string::npos);
}

}  // namespace

TEST_CASE(
    "A press begins the measurement, at once after the question; another one meanwhile changes nothing") {
  const Home home;
  BusControl bus;
  bus.press_button();  // Before it asks: this one does not count.
  Person person(on_button(home), true);
  REQUIRE(person.sees(kAsks));
  const std::uint64_t before = bus.statistics()["bytes_in"];
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  CHECK(bus.statistics()["bytes_in"] == before);  // It waits: no frame has come.
  CHECK_FALSE(fs::exists(home.results() / "recording.scat"));
  bus.press_button();
  REQUIRE(soon([&] { return fs::exists(home.results() / "recording.scat"); }, std::chrono::seconds(5)));
  bus.press_button();
  const Ended ended = person.ends();
  INFO(ended.said);
  REQUIRE(ended.status == 0);
  check_results(home.results(), nlohmann::json::parse(ended.out));
}

TEST_CASE("Who presses the very moment that the program asks need not press again") {
  BusControl bus;
  for (int k = 0; k < 5; ++k) {
    const Home home;
    Person person(on_button(home), true);
    const std::uint64_t before = bus.statistics()["bytes_in"];
    REQUIRE(person.sees(kAsks));
    bus.press_button();
    check_begins(bus, person, before);
  }
}

TEST_CASE("ctrl-C and SIGTERM end the wait within a second, with status 1 and no file") {
  BusControl bus;
  for (const int signal : {SIGINT, SIGTERM}) {
    INFO("signal " << signal);
    const Home home;
    Person person(on_button(home), true);
    REQUIRE(person.sees(kAsks));
    const Clock::time_point begin = Clock::now();
    ::kill(person.process(), signal);
    check_error(person.ends(), "ABORTED", "stopped");
    CHECK(ms_since(begin) < 1000);
    CHECK((!fs::exists(home.results()) || fs::is_empty(home.results())));
  }
}

TEST_CASE("Typed ctrl-C ends it, too") {
  const Home home;
  Person person(on_button(home));
  REQUIRE(person.sees(kAsks));
  person.types("\x03");
  check_error(person.ends(std::chrono::seconds(1)), "ABORTED", "stopped");
}

TEST_CASE("Unplugged while it waits: disconnected within a second, and the next call works") {
  const Home home;
  BusControl bus;
  Person person(on_button(home), true);
  REQUIRE(person.sees(kAsks));
  const Clock::time_point begin = Clock::now();
  bus.unplug();
  check_error(person.ends(), "DISCONNECTED", "SIM-00000001");
  CHECK(ms_since(begin) < 1000);
  check_error(Person(on_button(home), true).ends(), "NOT_FOUND", "plugged in");
  bus.plug();
  Person again(on_button(home), true);
  REQUIRE(again.sees(kAsks));
  const std::uint64_t before = bus.statistics()["bytes_in"];
  bus.press_button();
  check_begins(bus, again, before);
}

TEST_CASE("The button of another instrument is not waited for") {
  const Home home;
  BusControl bus;
  const int other = bus.add_instrument("seed=9&profile=binned");
  bus.plug(other);
  check_error(Person(on_button(home), true).ends(), "INVALID_ARGUMENT", "several instruments");
  Person person(on_button(home, "usb:serial=SIM-00000009"), true);
  REQUIRE(person.sees(kAsks));
  const std::uint64_t before = bus.statistics()["bytes_in"];
  bus.press_button(0);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  CHECK(bus.statistics()["bytes_in"] == before);
  bus.press_button(other);
  check_begins(bus, person, before);
  bus.unplug(other);
}
