#include <catch2/catch.hpp>

#include <unistd.h>

#include <filesystem>

#include "simulator/instrument/virtual_board.h"
#include "tests/unit/simulator_instrument/raw_host.h"

using namespace scatter;
using namespace scatter::simulator;
using namespace scatter::protocol;

namespace {

Recipe small_recipe() {
  Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.illuminations.push_back(4);
  recipe.exposures_us.push_back(1000);
  recipe.exposures_us.push_back(4000);
  recipe.off_frames = 1;
  recipe.region_x = recipe.region_y = 200;
  recipe.region_width = recipe.region_height = 80;
  return recipe;
}

/// Configures and runs to the end; the frame ends that came.
int run(RawHost& host, const Recipe& recipe) {
  const auto accepted = host.ask<ConfigurationAccepted>(SetConfiguration{.recipe = recipe});
  REQUIRE(accepted.has_value());
  host.send(Start{.epoch = accepted->epoch, .may_send_until = 1000});
  int ends = 0;
  host.listen([&](const Frame& frame) {
    ends += frame.as<FrameEnd>().has_value() ? 1 : 0;
    return frame.as<RunFinished>().has_value();
  });
  return ends;
}

void check_no_violations(VirtualInstrument& instrument) {
  const Violations& violations = instrument.board().camera().violations();
  CHECK(violations.light_changed_in_exposure == 0);
  CHECK(violations.stage_moved_in_exposure == 0);
  CHECK(violations.rows_out_of_order == 0);
  CHECK(violations.trigger_refused == 0);
  CHECK(instrument.board().flash().violations() == 0);
}

}  // namespace

TEST_CASE("The firmware core answers HELLO over the virtual link") {
  const auto instrument = instrument_of("seed=7");
  RawHost host(*instrument);
  const auto hello = host.ask<HelloReply>(Hello{});
  REQUIRE(hello.has_value());
  CHECK(hello->serial.str() == "SIM-00000007");
  CHECK(hello->reset_reason == static_cast<std::uint8_t>(ResetReason::kPowerOn));
}

TEST_CASE("The firmware runs a recipe without doing anything that a board would punish") {
  const auto instrument = instrument_of("sample=ggx:alpha=0.2,f0=0.04,albedo=0.3");
  RawHost host(*instrument);
  REQUIRE(host.ask<HelloReply>(Hello{}).has_value());
  CHECK(run(host, small_recipe()) == 5);
  check_no_violations(*instrument);
}

TEST_CASE("The same seed gives the same bytes from HELLO to the end of a run; another seed gives others") {
  const auto transcript = [](std::string_view query) {
    const auto instrument = instrument_of(query);
    RawHost host(*instrument);
    REQUIRE(host.ask<HelloReply>(Hello{}).has_value());
    REQUIRE(run(host, small_recipe()) == 5);
    return host.transcript;
  };
  const auto first = transcript("seed=3");
  CHECK(first.size() > 5 * 80 * 80 * 2);
  CHECK((transcript("seed=3") == first));
  CHECK((transcript("seed=4") != first));
}

TEST_CASE("Virtual time stands still while the host is busy and reaches a deadline exactly") {
  const auto instrument = instrument_of("");
  CHECK(instrument->now_us() == 0);
  instrument->attach();
  CHECK(instrument->writable() > 0);
  CHECK(instrument->now_us() == 0);
  instrument->run_until(12'345);
  CHECK(instrument->now_us() == 12'345);
  CHECK(instrument->unix_time_us() == kPowerOnUnixUs + 12'345);
}

TEST_CASE("An idle hour in virtual time takes a moment and never wakes the watchdog") {
  const auto instrument = instrument_of("");
  instrument->attach();
  instrument->run_until(3'600'000'000);
  CHECK(instrument->now_us() == 3'600'000'000);
  CHECK(instrument->attached());
  RawHost host(*instrument);
  const auto hello = host.ask<HelloReply>(Hello{});
  REQUIRE(hello.has_value());
  CHECK(hello->reset_reason == static_cast<std::uint8_t>(ResetReason::kPowerOn));
}

TEST_CASE("A reboot is answered first, then the link drops, and the next HELLO tells the reason") {
  const auto instrument = instrument_of("");
  std::uint32_t boots = 0;
  {
    RawHost host(*instrument);
    boots = host.ask<HelloReply>(Hello{})->boot_count;
    const auto reply = host.ask<StatusReply>(Reboot{});
    REQUIRE(reply.has_value());
    CHECK(reply->status == StatusCode::kOk);
    instrument->run_until(instrument->now_us() + 2'000'000);
    CHECK_FALSE(instrument->attached());
    CHECK(instrument->host_write(std::vector<std::byte>(4)) == 0);
  }
  RawHost again(*instrument);
  const auto hello = again.ask<HelloReply>(Hello{});
  REQUIRE(hello.has_value());
  CHECK(hello->reset_reason == static_cast<std::uint8_t>(ResetReason::kRequested));
  CHECK(hello->boot_count == boots + 1);
  CHECK(hello->device_time_us < 3'000'000);
}

TEST_CASE("A reset in an exposure drops the link once; afterwards the run can be repeated whole") {
  const auto instrument = instrument_of("fault=reset:3");
  {
    RawHost host(*instrument);
    REQUIRE(host.ask<HelloReply>(Hello{}).has_value());
    CHECK(run(host, small_recipe()) == 2);
    CHECK_FALSE(instrument->attached());
  }
  RawHost again(*instrument);
  const auto hello = again.ask<HelloReply>(Hello{});
  REQUIRE(hello.has_value());
  CHECK(hello->reset_reason == static_cast<std::uint8_t>(ResetReason::kFault));
  CHECK(run(again, small_recipe()) == 5);
  check_no_violations(*instrument);
}

TEST_CASE("A stale instrument holds manifests past their life; a fresh one needs them") {
  const auto states = [](std::string_view query) {
    const auto instrument = instrument_of(query);
    RawHost host(*instrument);
    REQUIRE(host.ask<HelloReply>(Hello{}).has_value());
    const auto state = host.ask<CalibrationState>(CalibrationQuery{});
    REQUIRE(state.has_value());
    check_no_violations(*instrument);
    return *state;
  };
  const CalibrationState stale = states("calibration=stale");
  CHECK(stale.states.size() == 3);
  for (const CalibrationKindState& state : stale.states) {
    CHECK(state.verdict == CalibrationVerdict::kExpiredAge);
    CHECK(state.id != CalibrationId{});
  }
  CHECK(states("calibration=stale&module=transmission").states.size() == 4);
  for (const CalibrationKindState& state : states("").states) {
    CHECK(state.verdict == CalibrationVerdict::kNeeded);
  }
}

TEST_CASE("Without references a calibration step says what is missing") {
  const auto instrument = instrument_of("calibration=none");
  RawHost host(*instrument);
  REQUIRE(host.ask<HelloReply>(Hello{}).has_value());
  const auto begun = host.ask<CalibrationBegun>(CalibrationBegin{});
  REQUIRE(begun.has_value());
  const auto reply =
      host.ask<StatusReply>(CalibrationStep{.session = begun->session, .target = Target::kWhiteReference});
  REQUIRE(reply.has_value());
  CHECK(reply->status == StatusCode::kNotFound);
  CHECK(reply->text.str().find("white") != std::string_view::npos);
}

TEST_CASE("A flash file makes the next instrument the same device again") {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("scatter_device_" + std::to_string(::getpid()));
  std::filesystem::remove(file);
  const std::string query = "flash=" + file.string();
  {
    const auto instrument = instrument_of(query);
    RawHost host(*instrument);
    REQUIRE(host.ask<HelloReply>(Hello{})->boot_count == 1);
    const auto reply = host.ask<StatusReply>(KeyValueSet{.key = "name", .value = "bench 3"});
    REQUIRE(reply.has_value());
    REQUIRE(reply->status == StatusCode::kOk);
  }
  const auto instrument = instrument_of(query);
  RawHost host(*instrument);
  CHECK(host.ask<HelloReply>(Hello{})->boot_count == 2);
  const auto name = host.ask<KeyValue>(KeyValueGet{.key = "name"});
  REQUIRE(name.has_value());
  CHECK(name->value.str() == "bench 3");
  std::filesystem::remove(file);
}

TEST_CASE("The host's slowness changes no pixel") {
  // A host that takes a hundred bytes at a time, against one that takes all there is.
  const auto pixels = [](std::size_t piece) {
    const auto instrument = instrument_of("");
    RawHost host(*instrument);
    REQUIRE(host.ask<HelloReply>(Hello{}).has_value());
    const auto accepted = host.ask<ConfigurationAccepted>(SetConfiguration{.recipe = small_recipe()});
    REQUIRE(accepted.has_value());
    host.send(Start{.epoch = accepted->epoch, .may_send_until = 1000});
    std::vector<std::byte> all;
    std::vector<std::byte> some(piece);
    for (int silent = 0; silent < 3;) {
      instrument->run_until(instrument->now_us() + 50'000);
      const std::size_t count = instrument->host_read(some);
      silent = count > 0 ? 0 : silent + 1;
      all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
    }
    return all;
  };
  const auto quick = pixels(1'000'000);
  CHECK(quick.size() > 5 * 80 * 80 * 2);
  CHECK((pixels(100) == quick));
}
