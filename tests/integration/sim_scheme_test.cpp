// The `sim:` scheme through the registry, as every tool opens it.
#include "tests/integration/rig.h"

using namespace scatter;
using namespace scatter::integration;

namespace {

const device::TransportRegistry& registry() {
  static const device::TransportRegistry kRegistry = [] {
    device::TransportRegistry made;
    tools::register_sim_scheme(made);
    return made;
  }();
  return kRegistry;
}

}  // namespace

TEST_CASE("sim: opens a fresh instrument whose descriptor is the board's") {
  auto device = open_uri("sim:?seed=7&module=transmission", &registry());
  REQUIRE(device.has_value());
  CHECK(device->hello().serial.str() == "SIM-00000007");
  CHECK(device->descriptor().transmission_module == 1);
  CHECK(device->descriptor().reference_stage == 1);
  CHECK(device->descriptor().illuminations.size() == 24);
  // Simulated time begins with the year 2026.
  CHECK(device->system_time_unix_ns() / 1'000'000'000 == 1'767'225'600);
}

TEST_CASE("A wrong sim: URI is refused with what is wrong and what to write") {
  struct Row {
    std::string_view uri;
    std::string_view named;
  };
  for (const Row& row :
       {Row{"sim:lambertian:0.5", "no place"}, Row{"sim:?smaple=x", "smaple"},
        Row{"sim:?sample=unobtainium:1", "unobtainium"}, Row{"sim:?seed=abc", "abc"},
        Row{"sim:?fault=led:99", "99"}, Row{"sim:?sample=file:/no/such/file", "/no/such/file"}}) {
    INFO(row.uri);
    const auto device = open_uri(row.uri, &registry());
    REQUIRE_FALSE(device.has_value());
    CHECK(device.error().what.find(row.named) != std::string::npos);
    CHECK_FALSE(device.error().remedy.empty());
  }
}

TEST_CASE("The whole sensor test pattern comes through bit for bit") {
  auto device = open_uri("sim:", &registry());
  REQUIRE(device.has_value());
  const auto report = device->self_test(4);
  REQUIRE(report.has_value());
  CHECK(report->frames == 4);
  CHECK(report->pixels == 4 * 480 * 480);
  CHECK(report->wrong_pixels == 0);
  CHECK(report->run.ledger.balances());
}

TEST_CASE("The stage brings white and black, and brings the sample back") {
  const auto instrument = instrument_of("sample=lambertian:0.05");
  auto device = open_on(instrument);
  REQUIRE(device.has_value());
  const auto begun = device->calibration_begin();
  REQUIRE(begun.has_value());
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1000);
  recipe.region_x = recipe.region_y = 300;
  recipe.region_width = recipe.region_height = 16;
  const auto mean = [&](protocol::Target target) {
    recipe.target = target;
    const Outcome outcome = run(*device, recipe);
    REQUIRE_FALSE(outcome.error.has_value());
    REQUIRE(outcome.complete == 1);
    CHECK(outcome.frames[0].begin.target == target);
    std::vector<std::uint16_t> pixels(256);
    REQUIRE(device::unpack(outcome.frames[0], pixels).has_value());
    double sum = 0;
    for (const std::uint16_t pixel : pixels) {
      sum += pixel;
    }
    return sum / 256;
  };
  const auto placed = device->calibration_step(begun->session, protocol::Target::kWhiteReference);
  REQUIRE(placed.has_value());
  CHECK(placed->placed == 1);
  const double white = mean(protocol::Target::kWhiteReference);
  const double black = mean(protocol::Target::kBlackReference);
  REQUIRE(device->calibration_end(begun->session).has_value());
  const double sample = mean(protocol::Target::kSample);
  CHECK(white > 2 * sample);
  CHECK(sample > black);
}

TEST_CASE("A stop request ends a wait at once, and the device is still there") {
  auto device = open_uri("sim:", &registry());
  REQUIRE(device.has_value());
  std::stop_source stop;
  stop.request_stop();
  const auto status = device->status({.stop = stop.get_token()});
  REQUIRE_FALSE(status.has_value());
  CHECK(status.error().code == ErrorCode::kAborted);
  CHECK(device->status().has_value());
}
