#include <catch2/catch.hpp>

#include "tests/unit/firmware/fake_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

CalibrationManifest manifest(Target kind, std::uint8_t number) {
  CalibrationManifest m;
  m.kind = kind;
  m.id.fill(number);
  return m;
}

void calibrate(FakeHost& host, std::uint8_t number) {
  const std::uint32_t session = host.ask(CalibrationBegin{}).as<CalibrationBegun>().session;
  for (const Target kind : {Target::kDarkCap, Target::kWhiteReference, Target::kBlackReference}) {
    CalibrationCommit commit{.session = session, .manifest = manifest(kind, number)};
    REQUIRE(host.status_of(commit) == StatusCode::kOk);
  }
  REQUIRE(host.status_of(CalibrationEnd{.session = session}) == StatusCode::kOk);
}

CalibrationKindState state_of(FakeHost& host, Target kind) {
  for (const CalibrationKindState& state : host.ask(CalibrationQuery{}).as<CalibrationState>().states) {
    if (state.kind == kind) {
      return state;
    }
  }
  FAIL("no state of this kind");
  return {};
}

}  // namespace

TEST_CASE("A fresh device needs every calibration and says what to do") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const auto states = host.ask(CalibrationQuery{}).as<CalibrationState>().states;
  REQUIRE(states.size() == 3);  // The translucent standard belongs to the transmission module.
  for (const CalibrationKindState& state : states) {
    CHECK(state.verdict == CalibrationVerdict::kNeeded);
    CHECK(!state.action.empty());
  }
  CHECK(states[1].action.str() == "place the white reference, then run a white calibration");
}

TEST_CASE("Without a stage a step tells the user what to place") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const auto begun = host.ask(CalibrationBegin{}).as<CalibrationBegun>();
  CHECK(begun.reference_stage == 0);
  const CalibrationStep step{.session = begun.session, .target = Target::kWhiteReference};
  const auto placed = host.ask(step).as<CalibrationPlaced>();
  CHECK(placed.placed == 0);
  CHECK(placed.instruction.str() == "place the white reference, then continue");
}

TEST_CASE("A reference without certificate is NOT_FOUND; so is a target that the stage lacks") {
  FakeBoard board;
  board.factory.data.certificates.clear();
  FakeHost host(board);
  host.hello();
  const std::uint32_t session = host.ask(CalibrationBegin{}).as<CalibrationBegun>().session;
  CHECK(host.status_of(CalibrationStep{.session = session, .target = Target::kWhiteReference}) ==
        StatusCode::kNotFound);
  CHECK(host.ask(CalibrationStep{.session = session, .target = Target::kDarkCap}).header.id() ==
        MessageId::kCalibrationPlaced);
}

TEST_CASE("With a stage a step is PENDING until the reference stands still, and End brings the sample back") {
  FakeBoard board;
  board.with_stage = true;
  FakeHost host(board);
  host.hello();
  const std::uint32_t session = host.ask(CalibrationBegin{}).as<CalibrationBegun>().session;
  const std::uint64_t began = board.clock.time_us;
  const std::uint16_t step =
      host.send(CalibrationStep{.session = session, .target = Target::kWhiteReference});
  host.settle();
  REQUIRE(host.replies(step).size() == 1);
  CHECK(FakeHost::is_pending(host.replies(step)[0]));
  CHECK(host.replies(step)[0].as<StatusReply>().pending_ms >= 300);
  CHECK(host.status_of(CalibrationStep{.session = session, .target = Target::kDarkCap}) ==
        StatusCode::kUnavailable);
  host.run_for(400'000);
  REQUIRE(host.final_reply(step));
  CHECK(host.final_reply(step)->as<CalibrationPlaced>().placed == 1);
  CHECK(host.final_reply(step)->at_us == began + 300'000);
  CHECK(host.status_of(CalibrationEnd{.session = session}) == StatusCode::kOk);
  CHECK(board.stage.at == Target::kSample);
  CHECK(!board.stage.moving());
}

TEST_CASE("A repeated step while the stage moves moves it once and is answered") {
  FakeBoard board;
  board.with_stage = true;
  FakeHost host(board);
  host.hello();
  const std::uint32_t session = host.ask(CalibrationBegin{}).as<CalibrationBegun>().session;
  const CalibrationStep message{.session = session, .target = Target::kWhiteReference};
  const std::uint16_t step = host.send(message);
  host.run_for(100'000);
  host.send_as(message, step);
  host.run_for(1'000'000);
  host.send_as(message, step);
  host.settle();
  CHECK(board.stage.moves == 1);
  const auto replies = host.replies(step);
  REQUIRE(replies.size() == 4);  // PENDING, PENDING again, placed, placed again.
  CHECK(FakeHost::is_pending(replies[1]));
  CHECK(replies[3].payload == replies[2].payload);
}

TEST_CASE("A committed calibration is valid, travels with every frame, and survives a restart") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  calibrate(host, 7);
  CHECK(state_of(host, Target::kWhiteReference).verdict == CalibrationVerdict::kValid);
  CHECK(state_of(host, Target::kWhiteReference).action.empty());
  host.measure(fixed_recipe());
  for (const HostFrame& frame : host.frames) {
    CHECK(frame.begin.calibration_id[0] == 7);
  }
  const auto listed = host.ask(CalibrationList{}).as<CalibrationListed>();
  REQUIRE(listed.manifests.size() == 3);
  CHECK(listed.manifests[0].boot_count == 1);
  CHECK(listed.manifests[0].sensor_temperature_mK == 298'150);

  host.reboot();
  host.session = 0x5555;
  CHECK(host.hello().boot_count == 2);
  CHECK(host.ask(CalibrationList{}).as<CalibrationListed>().manifests == listed.manifests);
}

TEST_CASE(
    "Dark expires after 30 min, references after 1 h, both when the temperature moved by more than 3 K") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  calibrate(host, 1);
  const std::uint64_t made = board.clock.time_us;
  const auto verdicts_at = [&](std::uint64_t seconds) {
    board.clock.time_us = made + seconds * 1'000'000;
    return std::pair(state_of(host, Target::kDarkCap).verdict,
                     state_of(host, Target::kWhiteReference).verdict);
  };
  using enum CalibrationVerdict;
  CHECK(verdicts_at(1800) == std::pair(kValid, kValid));
  CHECK(verdicts_at(1801) == std::pair(kExpiredAge, kValid));
  CHECK(verdicts_at(3600) == std::pair(kExpiredAge, kValid));
  CHECK(verdicts_at(3601) == std::pair(kExpiredAge, kExpiredAge));
  CHECK(state_of(host, Target::kWhiteReference).age_s == 3601);
  calibrate(host, 2);
  board.optics.temperature_mK += 3'000;
  CHECK(state_of(host, Target::kDarkCap).verdict == kValid);
  board.optics.temperature_mK += 1;
  CHECK(state_of(host, Target::kDarkCap).verdict == kExpiredTemperature);
  CHECK(state_of(host, Target::kWhiteReference).temperature_change_mK == 3'001);
}

TEST_CASE(
    "After a restart the age comes from the host's clock; without one the calibration counts as too old") {
  constexpr std::uint64_t kNoon = 1'700'000'000'000'000;
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  host.ask(ClockSync{.host_time_us = kNoon});
  calibrate(host, 1);
  host.reboot();
  board.clock.time_us = 1;
  host.session = 0x5555;
  host.hello();
  CHECK(state_of(host, Target::kWhiteReference).verdict == CalibrationVerdict::kExpiredAge);
  host.ask(ClockSync{.host_time_us = kNoon + 600'000'000});
  CHECK(state_of(host, Target::kWhiteReference).verdict == CalibrationVerdict::kValid);
  CHECK(state_of(host, Target::kWhiteReference).age_s == 600);
}

TEST_CASE("Undo returns to the calibration before; restore forgets all but never the factory data") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  calibrate(host, 1);
  calibrate(host, 2);
  CHECK(host.status_of(CalibrationUndo{.kind = Target::kWhiteReference}) == StatusCode::kOk);
  CHECK(state_of(host, Target::kWhiteReference).id[0] == 1);
  CHECK(state_of(host, Target::kBlackReference).id[0] == 2);
  CHECK(host.status_of(CalibrationUndo{.kind = Target::kWhiteReference}) == StatusCode::kNotFound);
  CHECK(host.status_of(CalibrationRestoreFactory{}) == StatusCode::kOk);
  CHECK(state_of(host, Target::kBlackReference).verdict == CalibrationVerdict::kNeeded);
  CHECK(host.ask(ObjectRead{.object = 1, .offset = 0, .length = 100}).header.id() == MessageId::kObjectChunk);
}

TEST_CASE("A commit needs an open session, a kind and an id") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const CalibrationManifest good = manifest(Target::kWhiteReference, 1);
  CHECK(host.status_of(CalibrationCommit{.session = 1, .manifest = good}) == StatusCode::kFailedPrecondition);
  const std::uint32_t session = host.ask(CalibrationBegin{}).as<CalibrationBegun>().session;
  CHECK(host.status_of(CalibrationCommit{.session = session, .manifest = manifest(Target::kSample, 1)}) ==
        StatusCode::kInvalidArgument);
  CHECK(host.status_of(CalibrationCommit{.session = session, .manifest = manifest(Target::kDarkCap, 0)}) ==
        StatusCode::kInvalidArgument);
  const std::uint32_t newer = host.ask(CalibrationBegin{}).as<CalibrationBegun>().session;
  CHECK(newer != session);
  CHECK(host.status_of(CalibrationCommit{.session = session, .manifest = good}) ==
        StatusCode::kFailedPrecondition);
}

TEST_CASE("Frames of the transmission module carry the translucent standard's calibration") {
  FakeBoard board;
  board.factory.data.transmission_module = 1;
  Illumination below;
  below.theta_rad = 3.0F;
  board.factory.data.illuminations.push_back(below);
  FakeHost host(board);
  host.hello();
  const std::uint32_t session = host.ask(CalibrationBegin{}).as<CalibrationBegun>().session;
  for (const Target kind : {Target::kWhiteReference, Target::kTranslucentReference}) {
    CalibrationCommit commit{.session = session,
                             .manifest = manifest(kind, kind == Target::kWhiteReference ? 3 : 4)};
    REQUIRE(host.status_of(commit) == StatusCode::kOk);
  }
  Recipe recipe = fixed_recipe();
  recipe.illuminations.push_back(12);
  host.measure(recipe);
  for (const HostFrame& frame : host.frames) {
    CHECK(frame.begin.calibration_id[0] == (frame.begin.illumination == 12 ? 4 : 3));
  }
}
