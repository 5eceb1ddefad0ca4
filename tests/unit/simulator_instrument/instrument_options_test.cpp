#include <catch2/catch.hpp>

#include "simulator/instrument/instrument_options.h"

using namespace scatter;
using namespace scatter::simulator;

TEST_CASE("Without a query the options are the defaults") {
  for (const std::string_view query : {"", "?"}) {
    const auto options = parse_instrument_options(query);
    REQUIRE(options.has_value());
    CHECK(options->sample == "lambertian:0.5");
    CHECK(options->seed == 1);
    CHECK(options->profile == Profile::kHs1);
    CHECK(options->calibration == CalibrationHeld::kSession);
    CHECK(options->references == References::kExact);
    CHECK(options->clock == ClockMode::kVirtual);
    CHECK_FALSE(options->transmission_module);
  }
}

TEST_CASE("Every key is understood") {
  const auto options = parse_instrument_options(
      "?sample=film:transmittance=0.6,haze=0.3&seed=18446744073709551615&fault=drop:1e-3&fault=led:2&"
      "profile=fine&calibration=stale&references=drawn&clock=real&module=transmission&flash=a%20b");
  REQUIRE(options.has_value());
  CHECK(options->sample == "film:transmittance=0.6,haze=0.3");
  CHECK(options->seed == UINT64_MAX);
  CHECK(options->faults.rates(Direction::kToHost).drop == 1e-3);
  CHECK(options->faults.dead_leds == std::vector<std::uint8_t>{2});
  CHECK(options->profile == Profile::kFine);
  CHECK(options->calibration == CalibrationHeld::kStale);
  CHECK(options->references == References::kDrawn);
  CHECK(options->clock == ClockMode::kReal);
  CHECK(options->transmission_module);
  CHECK(options->flash_file == "a b");
}

TEST_CASE("A sample's plus, equals, at, comma and colon need no quoting; percent codes are decoded") {
  const auto plain = parse_instrument_options("sample=ggx:alpha=0.2,f0=0.04+tilt=1.0@30+soft=0.2&seed=7");
  REQUIRE(plain.has_value());
  CHECK(plain->sample == "ggx:alpha=0.2,f0=0.04+tilt=1.0@30+soft=0.2");
  CHECK(plain->seed == 7);
  const auto coded = parse_instrument_options("sample=file:A%26B%2Fc%25.bsdf");
  REQUIRE(coded.has_value());
  CHECK(coded->sample == "file:A&B/c%.bsdf");
}

TEST_CASE("A wrong query is refused with key, value and remedy") {
  struct Row {
    std::string_view query;
    std::string_view named;
  };
  for (const Row& row :
       {Row{"smaple=x", "smaple"}, Row{"seed=-1", "seed"}, Row{"seed=", "seed"},
        Row{"seed=18446744073709551616", "seed"}, Row{"profile=rough", "rough"},
        Row{"calibration=maybe", "maybe"}, Row{"references=fuzzy", "fuzzy"}, Row{"clock=stopped", "stopped"},
        Row{"module=warp", "warp"}, Row{"fault=dorp:1", "dorp:1"}, Row{"seed", "seed"},
        Row{"sample=%4", "%4"}, Row{"sample=%zz", "%zz"}}) {
    INFO(row.query);
    const auto options = parse_instrument_options(row.query);
    REQUIRE_FALSE(options.has_value());
    CHECK(options.error().code == ErrorCode::kInvalidArgument);
    CHECK(options.error().what.find(row.named) != std::string::npos);
    CHECK_FALSE(options.error().remedy.empty());
  }
}
