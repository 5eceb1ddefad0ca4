// The rescue channel: what the instrument says on its own, what it does when asked, above all while the bulk
// pipes are stuck.
#include <catch2/catch.hpp>

#include "protocol/codec.h"
#include "tests/unit/firmware_usb/usb_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

constexpr std::uint8_t kIn = 0x83;

/// A run whose pixels nobody takes: bulk IN is full, control replies behind it too.
void stick(UsbBoard& board, UsbHost& usb) {
  board.bus.in_capacity = 2048;
  usb.attach();
  usb.host.hello();
  (void)usb.statuses();
  usb.host.start(usb.host.configure(fixed_recipe()));
  usb.reading = false;
  board.pass(200'000);
  REQUIRE(board.bus.waiting(0x81) == 2048);
  REQUIRE(board.instrument->run_state() != RunState::kIdle);
}

}  // namespace

// PROVES: SPEC 12.4
TEST_CASE("Each change of run, session and button is told, and nothing else") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  CHECK(usb.statuses().empty());
  usb.host.hello();
  auto told = usb.statuses();
  REQUIRE(told.size() == 1);
  CHECK(told[0].session_open);
  CHECK(told[0].run_state == 0);
  board.button.count = 3;
  told = usb.statuses();
  REQUIRE(told.size() == 1);
  CHECK(told[0].button_presses == 3);
  usb.host.start(usb.host.configure(fixed_recipe()));
  told = usb.statuses();
  REQUIRE_FALSE(told.empty());
  CHECK(told.back().run_state == static_cast<std::uint8_t>(RunState::kRunning));
  CHECK(told.back().run_id == 1);
  board.pass(10'000);
  CHECK(usb.statuses().empty());
  REQUIRE(usb.host.run(60'000'000, [&] { return !usb.host.all<RunFinished>().empty(); }));
  told = usb.statuses();
  REQUIRE_FALSE(told.empty());
  CHECK(told.back().run_state == 0);
  CHECK(told.back().exposed == 10);
  CHECK(usb.answers.empty());
}

// PROVES: SPEC 12.4
TEST_CASE("A host that reads late gets the newest status last") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  for (std::uint32_t press = 1; press <= 20; ++press) {
    board.button.count = press;
    board.settle();
  }
  const auto told = usb.statuses();
  REQUIRE_FALSE(told.empty());
  CHECK(told.size() <= 2);
  CHECK(told.back().button_presses == 20);
}

// PROVES: SPEC 12.5
TEST_CASE("The feature report tells the state with every pipe stuck") {
  UsbBoard board;
  UsbHost usb(board);
  stick(board, usb);
  for (int i = 0; i < 10; ++i) {
    usb.ask({.command = RescueCommand::kStatus, .tag = static_cast<std::uint8_t>(i)});
  }
  board.settle();
  REQUIRE(board.bus.waiting(kIn) > 0);  // Nobody reads it.
  const RescueStatus now = usb.feature();
  CHECK(now.session_open);
  CHECK(now.run_state == static_cast<std::uint8_t>(board.instrument->run_state()));
  CHECK(now.run_id == 1);
  CHECK(now.exposed == board.instrument->run_report().ledger.exposed);
  CHECK(now.boot_count == board.instrument->boot_count());
  CHECK(now.uptime_us == board.board.clock.time_us);
  CHECK(now.sensor_mK == 298'150);
  // An input report by GET_REPORT is the same.
  const ControlResult input = board.control(0xA1, 1, 0x0100, 1, 64);
  CHECK(decode_rescue_status(input.data).has_value());
  CHECK(board.control(0xA1, 1, 0x0300, 1, 8).data == part(input.data, 0, 8));
}

// PROVES: SPEC 12.3
TEST_CASE("A rescue abort ends the run at once while bulk IN is full, and its host learns of it") {
  const bool by_control = GENERATE(false, true);
  UsbBoard board;
  UsbHost usb(board);
  stick(board, usb);
  if (by_control) {
    CHECK(usb.set_report({.command = RescueCommand::kAbort, .tag = 1}));
  } else {
    usb.ask({.command = RescueCommand::kAbort, .tag = 1});
  }
  board.settle();
  CHECK(board.instrument->run_state() == RunState::kIdle);
  CHECK(board.board.optics.lit == Illuminator::kNone);
  CHECK_FALSE(board.board.optics.busy);
  const auto told = usb.statuses();
  REQUIRE_FALSE(told.empty());
  CHECK(told.back().run_state == 0);
  REQUIRE(usb.answers.size() == 1);
  CHECK(usb.answers[0].status == StatusCode::kOk);
  CHECK(usb.answers[0].tag == 1);

  CHECK(usb.host.all<RunFinished>().empty());
  usb.reading = true;
  usb.host.settle();
  const auto ends = usb.host.all<RunFinished>();
  REQUIRE(ends.size() == 1);
  CHECK(ends[0].reason == static_cast<std::uint8_t>(RunEnd::kAborted));
  CHECK(ends[0].run_id == 1);
  // The instrument's half of the ledger balances (README of firmware/core).
  CHECK(ends[0].ledger.exposed ==
        ends[0].ledger.lost_sensor + ends[0].ledger.lost_firmware + ends[0].frames_sent);
  CHECK(usb.host.measure(fixed_recipe()).reason == static_cast<std::uint8_t>(RunEnd::kCompleted));
}

// PROVES: SPEC 12.3
TEST_CASE("A rescue abort answers the stop that waits, instead of an event") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  Recipe recipe = fixed_recipe();
  recipe.exposures_us.clear();
  recipe.exposures_us.push_back(200'000);
  usb.host.start(usb.host.configure(recipe));
  usb.host.run_for(10'000);
  const std::uint16_t stop = usb.host.send(Stop{});
  usb.host.run_for(1'000);
  REQUIRE_FALSE(usb.host.final_reply(stop).has_value());
  usb.ask({.command = RescueCommand::kAbort});
  usb.host.settle();
  const auto reply = usb.host.final_reply(stop);
  REQUIRE(reply.has_value());
  CHECK(reply->as<RunReport>().reason == static_cast<std::uint8_t>(RunEnd::kAborted));
  CHECK(usb.host.all<RunFinished>().empty());
}

// PROVES: SPEC 12.3
TEST_CASE("A rescue abort cancels a start that waits for the stage") {
  UsbBoard board;
  board.board.with_stage = true;
  board.boot();
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  const std::uint32_t epoch = usb.host.configure(fixed_recipe());
  const std::uint16_t start = usb.host.send(Start{.epoch = epoch, .may_send_until = 100});
  usb.host.run_for(1'000);
  REQUIRE(board.board.stage.moving());
  REQUIRE_FALSE(usb.host.final_reply(start).has_value());
  usb.ask({.command = RescueCommand::kAbort});
  usb.host.run_for(2'000'000);
  const auto reply = usb.host.final_reply(start);
  REQUIRE(reply.has_value());
  CHECK(reply->as<StatusReply>().status == StatusCode::kAborted);
  CHECK(board.board.optics.triggers == 0);
}

TEST_CASE("A rescue abort without a run does nothing and says OK") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  CHECK(usb.answer_to({.command = RescueCommand::kAbort, .tag = 5}).status == StatusCode::kOk);
  usb.host.hello();
  usb.host.settle();
  CHECK(usb.host.all<RunFinished>().empty());
}

TEST_CASE("A start that follows an abort at once leaves the end of the aborted run told") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  const std::uint32_t epoch = usb.host.configure(fixed_recipe());
  usb.host.start(epoch);
  usb.host.run_for(5'000);
  // Both wait when the main loop turns.
  usb.ask({.command = RescueCommand::kAbort});
  const std::uint16_t next = usb.host.send(Start{.epoch = epoch, .may_send_until = 100});
  usb.host.settle();
  REQUIRE(usb.host.all<RunFinished>().size() == 1);
  CHECK(usb.host.all<RunFinished>()[0].run_id == 1);
  REQUIRE(usb.host.final_reply(next).has_value());
  CHECK(usb.host.final_reply(next)->as<Started>().run_id == 2);
}

// PROVES: SPEC 12.3
TEST_CASE("The crash record comes in pieces that make the message fault_record") {
  UsbBoard board;
  FaultRecord crash;
  crash.present = 1;
  crash.reason = 3;
  crash.exception = 4;
  crash.boot_count = 17;
  crash.pc = 0x0802'1234;
  crash.build_id = "openscatter 0.1.0 abcdefghijklmn";
  board.board.keeper.crash = crash;
  board.boot();
  UsbHost usb(board);
  usb.attach();
  CHECK(usb.feature().fault_recorded);
  Bytes whole;
  std::size_t total = 1;
  while (whole.size() < total) {
    const RescueAnswer piece = usb.answer_to({.command = RescueCommand::kFaultRecord,
                                              .tag = static_cast<std::uint8_t>(whole.size()),
                                              .offset = static_cast<std::uint16_t>(whole.size())});
    REQUIRE(piece.status == StatusCode::kOk);
    REQUIRE(piece.offset == whole.size());
    REQUIRE(piece.size > 0);
    total = piece.total;
    whole.insert(whole.end(), piece.bytes.begin(), piece.bytes.begin() + piece.size);
  }
  const auto record = decode<FaultRecord>(whole);
  REQUIRE(record.has_value());
  CHECK(record->present == 1);
  CHECK(record->boot_count == 17);
  CHECK(record->pc == 0x0802'1234);
  CHECK(record->build_id.str() == "openscatter 0.1.0 abcdefghijklmn");
  const auto end = static_cast<std::uint16_t>(total);
  CHECK(usb.answer_to({.command = RescueCommand::kFaultRecord, .offset = end}).size == 0);
  CHECK(usb.answer_to({.command = RescueCommand::kFaultRecord, .offset = std::uint16_t(end + 1)}).status ==
        StatusCode::kOutOfRange);
}

TEST_CASE("Without a crash the crash record is empty") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  const RescueAnswer none = usb.answer_to({.command = RescueCommand::kFaultRecord, .tag = 2});
  CHECK(none.status == StatusCode::kOk);
  CHECK(none.total == 0);
  CHECK(none.size == 0);
  CHECK_FALSE(usb.feature().fault_recorded);
}

// PROVES: SPEC 12.3
TEST_CASE("A rescue reboot answers first, and restarts although nobody reads the answer") {
  const bool read = GENERATE(true, false);
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.ask({.command = RescueCommand::kReboot, .tag = 8});
  board.pass(190'000);
  CHECK(board.board.keeper.reboots == 0);
  if (read) {
    const auto answer = decode_rescue_answer(board.bus.in(kIn, 64));
    REQUIRE(answer.has_value());
    CHECK(answer->tag == 8);
    board.settle();
    CHECK(board.board.keeper.reboots == 1);
  }
  board.pass(20'000);
  CHECK(board.board.keeper.reboots == 1);
}

// PROVES: SPEC 12.3
TEST_CASE("A rescue reboot restarts an instrument whose bulk pipes are stuck in a run") {
  UsbBoard board;
  UsbHost usb(board);
  stick(board, usb);
  usb.ask({.command = RescueCommand::kReboot});
  board.pass(500'000);
  CHECK(board.board.keeper.reboots == 1);
  CHECK(board.board.optics.lit == Illuminator::kNone);
}

// PROVES: SPEC 12.2
TEST_CASE("Commands act although nobody reads answers; the last four answers wait") {
  UsbBoard board;
  UsbHost usb(board);
  stick(board, usb);
  for (std::uint8_t tag = 1; tag <= 20; ++tag) {
    usb.ask({.command = RescueCommand::kStatus, .tag = tag});
  }
  usb.ask({.command = RescueCommand::kAbort, .tag = 21});
  board.settle();
  CHECK(board.instrument->run_state() == RunState::kIdle);
  (void)usb.statuses();
  REQUIRE(usb.answers.size() >= 4);
  CHECK(usb.answers.size() <= 5);  // One lay in the endpoint.
  CHECK(usb.answers.back().tag == 21);
}

// PROVES: SPEC 12.1
TEST_CASE("Reports that are none are ignored, and the channel goes on") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  REQUIRE(board.bus.out(0x04, Bytes(64, std::byte{0xFF})));
  REQUIRE(board.bus.out(0x04, bytes({1})));
  REQUIRE(board.bus.out(0x04, bytes({1, 99, 1})));
  CHECK(usb.input().empty());
  CHECK(usb.answer_to({.command = RescueCommand::kStatus, .tag = 3}).status == StatusCode::kOk);
}

TEST_CASE("HID requests that this interface does not have are stalled") {
  UsbBoard board;
  board.enumerate();
  struct Request {
    std::uint8_t type, request;
    std::uint16_t value, length;
  };
  const auto bad = GENERATE(values<Request>({
      {0xA1, 1, 0x0200, 64},  // GET_REPORT of the output report
      {0xA1, 1, 0x0301, 64},  // of a report id
      {0x21, 9, 0x0100, 64},  // SET_REPORT of the input report
      {0x21, 9, 0x0300, 64},  // and of the feature report
      {0x21, 9, 0x0200, 65},  // too long
      {0x21, 9, 0x0200, 0},
      {0xA1, 9, 0x0200, 64},  // the wrong way
      {0x21, 1, 0x0300, 0},
      {0x21, 10, 0x0001, 0},  // SET_IDLE of a report id
      {0xA1, 3, 0, 1},        // GET_PROTOCOL, SET_PROTOCOL: boot devices only
      {0x21, 11, 0, 0},
  }));
  CAPTURE(int(bad.type), int(bad.request), bad.value, bad.length);
  CHECK(board.control(bad.type, bad.request, bad.value, 1, bad.length, Bytes(bad.length)).stalled);
  CHECK(board.bus.misuse == std::vector<std::string>());
}

// PROVES: SPEC 12.4
TEST_CASE("SET_IDLE repeats the status at its rate, 0 only on changes") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  CHECK_FALSE(board.control(0x21, 10, 25 << 8, 1, 0).stalled);  // 25 x 4 ms
  CHECK(board.control(0xA1, 2, 0, 1, 1).data == bytes({25}));
  std::size_t count = 0;
  for (int ms = 0; ms < 1000; ++ms) {
    board.pass(1000);
    count += usb.statuses().size();
  }
  CHECK(count == 10);
  CHECK_FALSE(board.control(0x21, 10, 0, 1, 0).stalled);
  board.pass(1'000'000);
  CHECK(usb.statuses().empty());
}

TEST_CASE("A halted interrupt endpoint holds the answer until the halt is cleared") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  (void)board.control(0x02, 3, 0, kIn, 0);
  usb.ask({.command = RescueCommand::kStatus, .tag = 77});
  board.settle();
  CHECK(usb.input().empty());
  (void)board.control(0x02, 1, 0, kIn, 0);
  (void)usb.statuses();
  REQUIRE(usb.answers.size() == 1);
  CHECK(usb.answers[0].tag == 77);
}
