// The simulated instrument passes the suite, and what it holds is the same afterwards.
#include <algorithm>
#include <chrono>
#include <set>

#include "host_sdk/device/device.h"
#include "tests/conformance/suite.h"

using namespace scatter;
using namespace scatter::conformance_test;

TEST_CASE("Check names are unique, and every check says what it promises, where and what to look at") {
  std::set<std::string_view> names;
  for (const conformance::CheckInfo& check : conformance::checks()) {
    CHECK(names.insert(check.name).second);
    CHECK_FALSE(check.promise.empty());
    CHECK_FALSE(check.rule.empty());
    CHECK_FALSE(check.look_at.empty());
  }
  CHECK(names.size() >= 25);
}

TEST_CASE("The simulated instrument passes every check") {
  conformance::Options options = options_for(instrument_of("sample=lambertian:0.5&seed=3"));
  options.write = true;
  std::size_t told = 0;
  options.progress = [&](double fraction, std::string_view) {
    CHECK(fraction < 1);
    ++told;
  };
  const auto report = conformance::run(options);
  REQUIRE(report.has_value());
  CHECK(failures(*report) == "");
  CHECK(report->findings.size() == conformance::checks().size());
  CHECK(told == conformance::checks().size());
  CHECK(report->count(conformance::Verdict::kMeasured) == 2);  // Round trip and throughput have no limit.
}

TEST_CASE("Instruments of other make-up pass: transmission, no stage, stale calibrations, the fine profile") {
  for (const char* query : {"sample=film:transmittance=0.6,haze=0.3", "calibration=none", "calibration=stale",
                            "profile=fine&references=drawn&seed=9"}) {
    INFO(query);
    conformance::Options options = options_for(instrument_of(query));
    const auto report = conformance::run(options);
    REQUIRE(report.has_value());
    CHECK(failures(*report) == "");
  }
}

TEST_CASE("Without leave to write the suite changes nothing that outlives a restart") {
  const auto instrument = instrument_of("calibration=stale&seed=5");
  const auto remembered = [&] {
    auto device = device::Device::open(tools::make_sim_transport(instrument));
    REQUIRE(device.has_value());
    const auto listed = device->calibration_list();
    const auto name = device->key_value("name");
    const auto location = device->key_value("location");
    REQUIRE((listed && name && location));
    return std::tuple(*listed, std::string(name->value.str()), std::string(location->value.str()),
                      device->hello().boot_count);
  };
  const auto before = remembered();
  const auto report = conformance::run(options_for(instrument));
  REQUIRE(report.has_value());
  for (const conformance::Finding& finding : report->findings) {
    CHECK((finding.verdict == conformance::Verdict::kSkipped) >= finding.check.writes);
  }
  CHECK(remembered() == before);
}

TEST_CASE("With leave to write, settings and calibrations are afterwards what they were") {
  for (const char* query : {"seed=5", "calibration=stale&seed=5"}) {
    const auto instrument = instrument_of(query);
    const auto remembered = [&] {
      auto device = device::Device::open(tools::make_sim_transport(instrument));
      REQUIRE(device.has_value());
      const auto listed = device->calibration_list();
      const auto location = device->key_value("location");
      REQUIRE((listed && location));
      return std::tuple(*listed, std::string(location->value.str()));
    };
    const auto before = remembered();
    conformance::Options options = options_for(instrument);
    options.write = true;
    options.only = {"settings-persist", "calibration-persists"};
    const auto report = conformance::run(options);
    REQUIRE(report.has_value());
    CHECK(failures(*report) == "");
    CHECK(remembered() == before);
  }
}

TEST_CASE("An unknown check is refused by name before anything is sent") {
  conformance::Options options = options_for(instrument_of(""));
  options.only = {"hello", "no-such-check"};
  const auto report = conformance::run(options);
  REQUIRE_FALSE(report.has_value());
  CHECK(report.error().code == ErrorCode::kInvalidArgument);
  CHECK(report.error().what.find("no-such-check") != std::string::npos);
}

TEST_CASE("A stop request ends the suite") {
  std::stop_source source;
  conformance::Options options = options_for(instrument_of(""));
  options.stop = source.get_token();
  options.progress = [&](double, std::string_view check) {
    if (check == "descriptor") {
      source.request_stop();
    }
  };
  const auto report = conformance::run(options);
  REQUIRE_FALSE(report.has_value());
  CHECK(report.error().code == ErrorCode::kAborted);
}

TEST_CASE("A device that cannot be reached is an error, not a failed device") {
  conformance::Options options;
  options.open = [](const device::Wait&) -> Result<std::unique_ptr<device::Transport>> {
    return fail(ErrorCode::kPermissionDenied, "no access", "use an account that is allowed");
  };
  const auto report = conformance::run(options);
  REQUIRE_FALSE(report.has_value());
  CHECK(report.error().code == ErrorCode::kPermissionDenied);
}
