// After a crash, and when no image can be started: what the device still says and does.
#include <catch2/catch.hpp>

#include "tests/unit/firmware/update_device.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

TEST_CASE("The first HELLO after a crash tells where it was, and the record can be read") {
  Device device;
  CHECK(device.host->ask(FaultRecordRead{}).as<FaultRecord>().present == 0);
  device.board.keeper.crash = {.present = 1,
                               .reason = static_cast<std::uint8_t>(ResetReason::kFault),
                               .exception = 3,
                               .boot_count = 41,
                               .pc = 0x6080'1234,
                               .fault_status = 0x82};
  device.boot(ResetReason::kFault);
  std::vector<FaultEvent> events = device.host->all<FaultEvent>();
  REQUIRE(events.size() == 1);
  CHECK(events[0].fault == static_cast<std::uint16_t>(FaultCode::kFirmwareCrashed));
  CHECK(events[0].text.str() ==
        "the firmware crashed, exception 3 at pc 0x60801234, fault status 0x00000082, boot 41");
  const auto record = device.host->ask(FaultRecordRead{}).as<FaultRecord>();
  CHECK(record.present == 1);
  CHECK(record.pc == 0x6080'1234);
  CHECK(record.boot_count == 41);
  device.host->session = 0x4321;
  device.host->hello();
  CHECK(device.host->all<FaultEvent>().size() == 1);  // Told once.
  device.boot(ResetReason::kRequested);
  CHECK(device.host->all<FaultEvent>().empty());  // An older crash is no news.
  CHECK(device.host->ask(FaultRecordRead{}).as<FaultRecord>().present == 1);
}

TEST_CASE("Rescue mode answers HELLO, refuses to measure, and takes an update that runs afterwards") {
  Device device;
  device.slots.parts[0].rot(3000, 1);
  device.boot();
  REQUIRE(device.decision.action == BootDecision::Action::kRescue);
  CHECK((device.hello.capabilities & kCapabilityRescue) != 0);
  CHECK((device.hello.capabilities & kCapabilityUpdate) != 0);
  CHECK(device.hello.build_id.str() == "bootloader test");
  CHECK(device.hello.serial.str() == "T0001");
  const StatusReply refused = device.host->ask(Start{.epoch = 1, .may_send_until = 1}).as<StatusReply>();
  CHECK(refused.status == StatusCode::kFailedPrecondition);
  CHECK(refused.text.str().find("flash a firmware image") != std::string_view::npos);
  CHECK(device.host->ask(FaultRecordRead{}).as<FaultRecord>().present == 0);
  CHECK(device.host->ask(GetStatus{}).as<DeviceStatus>().frames_good > 0);
  CHECK(device.host->status_of(UpdateConfirm{}) == StatusCode::kFailedPrecondition);

  const UpdateState state = device.state();
  const auto slot = static_cast<std::uint8_t>(1 - state.running_slot);
  device.send(Device::image("2.0.0", slot));
  CHECK(device.host->status_of(Reboot{}) == StatusCode::kOk);
  device.host->run_for(1'000'000);
  CHECK(device.board.keeper.reboots == 1);
  device.boot(ResetReason::kRequested);
  CHECK(device.decision.slot == slot);
  CHECK(device.host->status_of(UpdateConfirm{}) == StatusCode::kOk);
}

TEST_CASE("Rescue mode repeats replies instead of doing things twice and drops stale sessions") {
  Device device;
  device.slots.parts[0].rot(3000, 1);
  device.boot();
  const Image b = Device::image("2.0.0", 0);
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  UpdateWrite chunk;
  chunk.offset = 0;
  chunk.data = std::span(b.body).first(1024);
  device.host->send_as(chunk, 0x700);
  device.host->send_as(chunk, 0x700);
  device.host->run_for(1'000);
  CHECK(device.host->replies(0x700).size() == 2);
  const std::uint16_t session = device.host->session;
  device.host->session = 0x2222;
  const std::uint16_t stale = device.host->send(GetStatus{});
  device.host->run_for(1'000);
  CHECK(device.host->replies(stale).empty());
  device.host->session = session;
  const auto status = device.host->ask(GetStatus{}).as<DeviceStatus>();
  CHECK(status.duplicates == 1);
  CHECK(status.stale_session == 1);
}
