// A whole update against a device that is honest, away, damaged, or runs bad firmware.
#include "host_sdk/device/updater.h"

#include <catch2/catch.hpp>
#include <functional>

#include "host_sdk/device/update_check.h"
#include "tests/unit/device/updatable_device.h"
#include "tests/unit/firmware_files/made_release.h"

namespace scatter::device::test {
namespace {

using firmware_files::test::kRfcPublic;
using firmware_files::test::made_package;
using firmware_files::test::made_release;
using protocol::MessageId;
using protocol::SlotVerdict;

constexpr std::size_t kBodyBytes = 5000;
const std::vector<protocol::PublicKey> kTrusted = {kRfcPublic};

firmware_files::Package new_firmware() {
  return made_package(made_release("2.0.0", 3, kBodyBytes));
}

/// Runs 1.0.0 from slot 0, confirmed.
UpdatableDevice old_device() {
  UpdatableDevice device;
  device.slots[0] = {.version = "1.0.0",
                     .counter = 2,
                     .verdict = SlotVerdict::kConfirmed,
                     .header = {},
                     .body = {},
                     .body_bytes = 0};
  return device;
}

UpdateOptions options() {
  UpdateOptions how;
  how.trusted = kTrusted;
  how.restart = std::chrono::milliseconds(200);
  return how;
}

}  // namespace

TEST_CASE("An update puts the right linking into the slot that does not run, and keeps it after the checks") {
  UpdatableDevice device = old_device();
  device.running = GENERATE(as<std::uint8_t>(), 0, 1);
  std::swap(device.slots[0], device.slots[device.running]);
  const auto package = new_firmware();
  int announced = 0;
  UpdateOptions how = options();
  std::vector<UpdateProgress> seen;
  how.progress = [&](const UpdateProgress& progress) { seen.push_back(progress); };
  how.about_to_begin = [&](const protocol::UpdateState& state, std::uint8_t slot) {
    ++announced;
    CHECK(state.running_version.str() == "1.0.0");
    CHECK(slot == 1 - device.running);
    CHECK(device.carried_out[MessageId::kUpdateBegin] == 0);
  };
  const std::uint8_t target = 1 - device.running;
  const auto report = update_firmware(device.opener(), package, how);
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(report->slot == target);
  CHECK(report->sent_bytes == package.image(target).body.size());
  CHECK(report->reconnections == 0);
  CHECK(announced == 1);
  CHECK(device.running == target);
  CHECK(device.slots[target].body == package.image(target).body);
  CHECK(device.slots[target].verdict == SlotVerdict::kConfirmed);
  CHECK(device.carried_out[MessageId::kUpdateConfirm] == 1);
  // Progress never goes back, and ends with all of it.
  CHECK(std::ranges::is_sorted(seen, {}, &UpdateProgress::stage));
  const auto last = std::ranges::find_if(seen.rbegin(), seen.rend(), [](const UpdateProgress& progress) {
    return progress.stage == UpdateStage::kSending;
  });
  REQUIRE(last != seen.rend());
  CHECK(last->done == last->total);
}

TEST_CASE("Nothing is changed on a device that a release may not go onto") {
  struct Case {
    const char* what;
    std::function<void(UpdatableDevice&, firmware_files::Release&, UpdateOptions&)> make;
    ErrorCode code;
    const char* says;
  };
  const std::vector<protocol::PublicKey> only_test = {firmware_files::kTestPublicKey};
  const Case one = GENERATE_REF(values<Case>({
      {"wrong product", [](auto& d, auto&, auto&) { d.product = "HS-2"; }, ErrorCode::kInvalidArgument,
       "for product \"HS-1\", the instrument is a \"HS-2\""},
      {"unknown key", [&](auto&, auto&, auto& how) { how.trusted = only_test; }, ErrorCode::kPermissionDenied,
       "trusted are"},
      {"downgrade", [](auto& d, auto&, auto&) { d.lowest_counter = 4; }, ErrorCode::kPermissionDenied,
       "counter is 3, the instrument takes 4 or higher"},
      {"too large", [](auto& d, auto&, auto&) { d.slot_bytes = 4999; }, ErrorCode::kInvalidArgument,
       "the slot takes 4999"},
      {"no updates", [](auto& d, auto&, auto&) { d.capabilities = 0; }, ErrorCode::kUnimplemented,
       "takes no updates"},
      {"same version",
       [](auto&, auto& release, auto&) {
         release.version = "1.0.0";
         release.security_counter = 2;
       },
       ErrorCode::kFailedPrecondition, "version 1.0.0 runs already"},
  }));
  CAPTURE(one.what);
  UpdatableDevice device = old_device();
  auto release = made_release("2.0.0", 3, kBodyBytes);
  UpdateOptions how = options();
  one.make(device, release, how);
  const auto report = update_firmware(device.opener(), made_package(release), how);
  REQUIRE_FALSE(report);
  CHECK(report.error().code == one.code);
  CHECK_THAT(report.error().what, Catch::Contains(one.says));
  CHECK_FALSE(report.error().remedy.empty());
  CHECK(device.carried_out[MessageId::kUpdateBegin] == 0);
  CHECK(device.carried_out[MessageId::kReboot] == 0);
}

TEST_CASE("A version that runs already is sent again when that is wanted") {
  UpdatableDevice device = old_device();
  device.slots[0].version = "2.0.0";
  device.slots[0].counter = 3;
  UpdateOptions how = options();
  how.same_version_too = true;
  const auto report = update_firmware(device.opener(), new_firmware(), how);
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(device.running == 1);
}

TEST_CASE("An update that loses its link goes on from what the device has") {
  UpdatableDevice device = old_device();
  device.unplug_at = GENERATE(64U, 640U, 2560U, 4992U);
  const auto package = new_firmware();
  const std::uint32_t there = *device.unplug_at;
  const auto report = update_firmware(device.opener(), package, options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(report->reconnections == 1);
  CHECK(device.slots[1].body == package.image(1).body);
  // Every piece once, and those that were under way when the link went a second time at most.
  const auto pieces = static_cast<int>((package.image(1).body.size() + 63) / 64);
  CHECK(device.carried_out[MessageId::kUpdateWrite] <= pieces + 4);
  CHECK(there <= package.image(1).body.size());
}

TEST_CASE("A piece that is lost on the way is sent again, and the body is whole") {
  UpdatableDevice device = old_device();
  device.lose_write = GENERATE(0, 1, 30, 78);
  const auto package = new_firmware();
  const auto report = update_firmware(device.opener(), package, options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(device.slots[1].body == package.image(1).body);
}

TEST_CASE("On a link that keeps losing pieces the link is opened again once, not for every loss") {
  UpdatableDevice device = old_device();
  device.lose_every = 10;
  const auto package = new_firmware();
  const auto report = update_firmware(device.opener(), package, options());
  REQUIRE(report);
  CHECK(report->reconnections == 1);
  CHECK(device.slots[1].body == package.image(1).body);
}

TEST_CASE("A stopped update is resumed by the same call, and sends only what is missing") {
  UpdatableDevice device = old_device();
  const auto package = new_firmware();
  std::stop_source stop;
  UpdateOptions how = options();
  how.stop = stop.get_token();
  how.progress = [&](const UpdateProgress& progress) {
    if (progress.stage == UpdateStage::kSending && progress.done >= 2500) {
      stop.request_stop();
    }
  };
  const auto stopped = update_firmware(device.opener(), package, how);
  REQUIRE_FALSE(stopped);
  CHECK(stopped.error().code == ErrorCode::kAborted);
  CHECK(device.carried_out[MessageId::kReboot] == 0);
  const auto resumed = update_firmware(device.opener(), package, options());
  REQUIRE(resumed);
  CHECK(resumed->outcome == UpdateOutcome::kConfirmed);
  CHECK(resumed->sent_bytes <= 2501);
  CHECK(device.slots[1].body == package.image(1).body);
}

TEST_CASE("Several pieces are under way at once, so that a slow answer costs little") {
  UpdatableDevice device = old_device();
  device.reply_delay = std::chrono::milliseconds(10);
  UpdateOptions how = options();
  how.depth = GENERATE(1U, 4U);
  const auto package = new_firmware();
  REQUIRE(update_firmware(device.opener(), package, how));
  const auto pieces = static_cast<std::int64_t>((package.image(1).body.size() + 63) / 64);
  const auto rounds =
      (pieces + static_cast<std::int64_t>(how.depth) - 1) / static_cast<std::int64_t>(how.depth);
  CHECK(device.sending_time >= rounds * device.reply_delay);
  CHECK(device.sending_time <= (rounds + 1) * device.reply_delay);
}

TEST_CASE("Firmware that crashes at its start is reported as reverted, with the crash") {
  UpdatableDevice device = old_device();
  device.new_firmware_crashes = true;
  const auto report = update_firmware(device.opener(), new_firmware(), options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kReverted);
  CHECK_THAT(report->why, Catch::Contains("version 1.0.0 runs in slot 0") &&
                              Catch::Contains("slot 1 is reverted") && Catch::Contains("crashed"));
  REQUIRE(report->fault);
  CHECK(report->fault->pc == 0x6088'1234);
  CHECK(device.carried_out[MessageId::kUpdateConfirm] == 0);
}

TEST_CASE("Firmware that fails its checks is not kept: the device goes back") {
  UpdatableDevice device = old_device();
  std::string says;
  SECTION("wrong self-test pattern") {
    device.pattern_error = 1;
    says = "32 wrong pixels";
  }
  SECTION("a new fault in its status") {
    device.fault = protocol::FaultCode::kSensorTimeout;
    says = "the sensor did not answer";
  }
  const auto report = update_firmware(device.opener(), new_firmware(), options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kReverted);
  CHECK_THAT(report->why, Catch::Contains("version 2.0.0 started, but") && Catch::Contains(says));
  CHECK(device.running == 0);
  CHECK(device.slots[1].verdict == SlotVerdict::kReverted);
  CHECK(report->after.running_version.str() == "1.0.0");
  CHECK(device.carried_out[MessageId::kUpdateConfirm] == 0);
}

TEST_CASE("A device that does not come back is an error in time, and says what to do") {
  UpdatableDevice device = old_device();
  device.stays_away = true;
  UpdateOptions how = options();
  how.restart = std::chrono::milliseconds(50);
  const auto report = update_firmware(device.opener(), new_firmware(), how);
  REQUIRE_FALSE(report);
  CHECK(report.error().code == ErrorCode::kDeadlineExceeded);
  CHECK_THAT(report.error().what, Catch::Contains("did not come back"));
  CHECK_THAT(report.error().remedy, Catch::Contains("run the same command again"));
}

TEST_CASE("A relay that still holds the connection of before the restart is waited for") {
  UpdatableDevice device = old_device();
  device.busy_openings = 1;
  const auto report = update_firmware(device.opener(), new_firmware(), options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
}

TEST_CASE("Links that break after the restart do not speak against the firmware") {
  UpdatableDevice device = old_device();
  device.broken_links = 2;
  const auto report = update_firmware(device.opener(), new_firmware(), options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
}

TEST_CASE("A restart that was asked for in vain is asked for again") {
  UpdatableDevice device = old_device();
  device.reboot_is_lost = true;
  UpdateOptions how = options();
  how.restart = std::chrono::seconds(20);
  const auto report = update_firmware(device.opener(), new_firmware(), how);
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(device.carried_out[MessageId::kReboot] == 2);
}

TEST_CASE("An update left on trial is confirmed by the same call without sending it again") {
  UpdatableDevice device = old_device();
  const auto package = new_firmware();
  UpdateOptions how = options();
  how.confirm = false;
  const auto trial = update_firmware(device.opener(), package, how);
  REQUIRE(trial);
  CHECK(trial->outcome == UpdateOutcome::kOnTrial);
  CHECK(device.slots[1].verdict == SlotVerdict::kTrial);
  const int writes = device.carried_out[MessageId::kUpdateWrite];
  const auto kept = update_firmware(device.opener(), package, options());
  REQUIRE(kept);
  CHECK(kept->outcome == UpdateOutcome::kConfirmed);
  CHECK(device.carried_out[MessageId::kUpdateWrite] == writes);
  CHECK(device.running == 1);
  CHECK(device.slots[1].verdict == SlotVerdict::kConfirmed);
}

TEST_CASE("Another firmware on trial gives way before its fallback is touched") {
  UpdatableDevice device = old_device();
  device.slots[1] = device.slots[0];
  device.slots[1].version = "1.5.0";
  device.slots[1].verdict = SlotVerdict::kTrial;
  device.running = 1;
  const auto report = update_firmware(device.opener(), new_firmware(), options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(device.running == 1);
  CHECK(device.slots[0].version == "1.0.0");
  CHECK(device.slots[0].verdict == SlotVerdict::kConfirmed);
  CHECK(device.slots[1].version == "2.0.0");
}

TEST_CASE("A body that the device finds damaged each time ends in an error, not in a restart") {
  UpdatableDevice device = old_device();
  device.finds_damage = true;
  const auto report = update_firmware(device.opener(), new_firmware(), options());
  REQUIRE_FALSE(report);
  CHECK(report.error().code == ErrorCode::kDataLoss);
  CHECK(device.carried_out[MessageId::kReboot] == 0);
  CHECK(device.carried_out[MessageId::kUpdateFinish] <= 6);
}

TEST_CASE("A device in rescue mode opens without a descriptor, and takes firmware") {
  UpdatableDevice device;
  device.capabilities |= protocol::kCapabilityRescue;
  device.running = 1;
  device.slots[1].verdict = SlotVerdict::kBadBody;
  const auto opened = device.opener()({});
  REQUIRE(opened);
  CHECK(opened->descriptor().product.str() == "HS-1");
  CHECK(device.carried_out[MessageId::kObjectRead] == 0);
  const auto report = update_firmware(device.opener(), new_firmware(), options());
  REQUIRE(report);
  CHECK(report->outcome == UpdateOutcome::kConfirmed);
  CHECK(device.running == 0);
}

}  // namespace scatter::device::test
