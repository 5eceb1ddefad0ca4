// USB DFU 1.1 (5 August 2004): the state tables of appendix A.2 cell by cell, block numbers and timers.
#include <catch2/catch.hpp>

#include "tests/unit/firmware/dfu_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using Code = DfuRequestCode;
using State = DfuState;

namespace {

const Bytes& file() {
  static const Bytes bytes = make_package().bytes();
  return bytes;
}

/// The situations of the tables; some states have two, told apart by what GETSTATUS does.
enum class Where {
  kAppIdle,
  kAppDetach,
  kIdle,
  kSyncBusy,
  kSyncDone,
  kBusy,
  kLoadIdle,
  kLoadWhole,
  kManifestFirst,
  kManifest,
  kManifestBusy,
  kManifestDone,
  kError
};

void bring(DfuHost& host, Where where) {
  if (where == Where::kAppIdle) {
    return;
  }
  if (where == Where::kAppDetach) {
    REQUIRE_FALSE(host.ask(Code::kDetach, 1000).stall);
    return;
  }
  host.enter_dfu_mode();
  if (where == Where::kIdle) {
    return;
  }
  if (where == Where::kError) {
    REQUIRE(host.ask(Code::kUpload, 0, {}, 64).stall);
    return;
  }
  if (where >= Where::kLoadWhole) {
    REQUIRE(host.send(file(), 4096).state == State::kDnloadIdle);
    if (where == Where::kLoadWhole) {
      return;
    }
    REQUIRE_FALSE(host.ask(Code::kDnload).stall);
    if (where == Where::kManifestFirst) {
      return;
    }
    REQUIRE(host.status()->state == State::kManifest);
    if (where == Where::kManifestBusy) {  // The main loop slept, the timer did not.
      host.clock.time_us += std::uint64_t{DfuDevice::kManifestPollMs} * 1000;
    } else if (where == Where::kManifestDone) {
      host.pass(DfuDevice::kManifestPollMs);
    }
    return;
  }
  REQUIRE_FALSE(host.ask(Code::kDnload, 0, std::span(file()).first(64)).stall);
  if (where == Where::kBusy) {
    REQUIRE(host.status()->state == State::kDnbusy);
  } else if (where != Where::kSyncBusy) {
    host.pass(5);
    if (where == Where::kLoadIdle) {
      REQUIRE(host.status()->state == State::kDnloadIdle);
    }
  }
}

struct Cell {
  bool stall;
  State next;
};

}  // namespace

TEST_CASE("Every request in every state leads where DFU 1.1 appendix A.2 says") {
  constexpr Cell kToError{true, State::kError};
  // DETACH, DNLOAD of bytes, empty DNLOAD, UPLOAD, GETSTATUS, CLRSTATUS, GETSTATE, ABORT, one that is no
  // request.
  struct Row {
    Where where;
    State state;
    std::array<Cell, 9> cells;
  };
  const auto only = [](State state, Cell status, Cell other) {
    return std::array<Cell, 9>{other, other, other, other, status, other, Cell{false, state}, other, other};
  };
  const Cell app_stall{true, State::kAppIdle};
  auto app_idle = only(State::kAppIdle, {false, State::kAppIdle}, app_stall);
  app_idle[0] = {false, State::kAppDetach};
  auto idle = only(State::kIdle, {false, State::kIdle}, kToError);
  idle[1] = {false, State::kDnloadSync};
  idle[7] = {false, State::kIdle};
  auto load_idle = only(State::kDnloadIdle, {false, State::kDnloadIdle}, kToError);
  load_idle[1] = {false, State::kDnloadSync};
  load_idle[7] = {false, State::kIdle};
  auto load_whole = load_idle;
  load_whole[2] = {false, State::kManifestSync};
  auto error = only(State::kError, {false, State::kError}, kToError);
  error[5] = {false, State::kIdle};
  std::array<Cell, 9> all_error{};
  all_error.fill(kToError);

  const std::vector<Row> table{
      {Where::kAppIdle, State::kAppIdle, app_idle},
      {Where::kAppDetach, State::kAppDetach, only(State::kAppDetach, {false, State::kAppDetach}, app_stall)},
      {Where::kIdle, State::kIdle, idle},
      {Where::kSyncBusy, State::kDnloadSync, only(State::kDnloadSync, {false, State::kDnbusy}, kToError)},
      {Where::kSyncDone, State::kDnloadSync, only(State::kDnloadSync, {false, State::kDnloadIdle}, kToError)},
      {Where::kBusy, State::kDnbusy, all_error},
      {Where::kLoadIdle, State::kDnloadIdle, load_idle},
      {Where::kLoadWhole, State::kDnloadIdle, load_whole},
      {Where::kManifestFirst, State::kManifestSync,
       only(State::kManifestSync, {false, State::kManifest}, kToError)},
      {Where::kManifest, State::kManifest, all_error},
      {Where::kManifestBusy, State::kManifest,
       only(State::kManifestSync, {false, State::kManifest}, kToError)},
      {Where::kManifestDone, State::kManifestSync,
       only(State::kManifestSync, {false, State::kIdle}, kToError)},
      {Where::kError, State::kError, error},
  };
  for (const Row& row : table) {
    for (std::size_t i = 0; i < row.cells.size(); ++i) {
      DfuHost host;
      bring(host, row.where);
      INFO("situation " << static_cast<int>(row.where) << ", request column " << i);
      REQUIRE(host.device->state() == row.state);
      constexpr std::array<std::uint8_t, 9> kCodes{0, 1, 1, 2, 3, 4, 5, 6, 7};
      // The whole file is there already where it is: the next block is one that the table allows.
      const auto number =
          static_cast<std::uint16_t>(row.where == Where::kLoadIdle    ? 1
                                     : row.where == Where::kLoadWhole ? (file().size() + 4095) / 4096
                                                                      : 0);
      const std::span<const std::byte> data =
          i == 1 ? std::span(file()).first(64) : std::span<const std::byte>();
      const DfuReply reply = host.ask(kCodes[i], i == 0 ? 1000 : number, data,
                                      static_cast<std::uint16_t>(i == 1   ? 64
                                                                 : i == 2 ? 0
                                                                          : 6));
      CHECK(reply.stall == row.cells[i].stall);
      CHECK(host.device->state() == row.cells[i].next);
      if (!reply.stall && (i == 4 || i == 6)) {  // What it says is where it then is.
        CHECK(reply.size == (i == 4 ? 6 : 1));
        CHECK(reply.bytes[i == 4 ? 4 : 0] == static_cast<std::byte>(row.cells[i].next));
      }
      if (row.cells[i].next == State::kError && row.where != Where::kError) {
        const bool early_end = row.where == Where::kLoadIdle && i == 2;
        CHECK(host.status()->status == (early_end ? DfuStatus::kErrNotDone : DfuStatus::kErrStalledPkt));
      }
      CHECK(host.slots.violations() == 0);
    }
  }
}

TEST_CASE("Numbers that a host sees are those of the specification") {
  // Table 4.2 and section 6.1.2.
  constexpr std::array<std::uint8_t, 9> kFunctional{0x09, 0x21, 0x0D, 0xE8, 0x03, 0x00, 0x10, 0x10, 0x01};
  CHECK(kDfuFunctionalDescriptor == kFunctional);
  CHECK(static_cast<int>(DfuStatus::kErrTarget) == 1);
  CHECK(static_cast<int>(DfuStatus::kErrFile) == 2);
  CHECK(static_cast<int>(DfuStatus::kErrProg) == 6);
  CHECK(static_cast<int>(DfuStatus::kErrNotDone) == 9);
  CHECK(static_cast<int>(DfuStatus::kErrVendor) == 11);
  CHECK(static_cast<int>(DfuStatus::kErrStalledPkt) == 15);
  CHECK(static_cast<int>(State::kError) == 10);
}

TEST_CASE("Block numbers rise by one from any first one, through 65535, and a gap is an error") {
  DfuHost host;
  host.enter_dfu_mode();
  CHECK(host.send(std::span(file()).first(640), 64, 65'530).state == State::kDnloadIdle);
  const std::uint16_t wrong = GENERATE(std::uint16_t{3}, std::uint16_t{5}, std::uint16_t{0});
  REQUIRE(host.ask(Code::kDnload, wrong, std::span(file()).subspan(640, 64)).stall);
  CHECK(host.status()->status == DfuStatus::kErrAddress);
  CHECK(host.status()->state == State::kError);
}

TEST_CASE("A block longer than wTransferSize, or shorter than it says, is refused") {
  DfuHost host;
  host.enter_dfu_mode();
  const Bytes block(4097, std::byte{0});
  SECTION("longer") {
    CHECK(host.ask(Code::kDnload, 0, block).stall);
  }
  SECTION("shorter") {
    CHECK(host.ask(Code::kDnload, 0, std::span(block).first(10), 11).stall);
  }
  CHECK(host.status()->status == DfuStatus::kErrStalledPkt);
}

TEST_CASE("A host that polls too early is told so; one whose clock is a little fast is served") {
  DfuHost host;
  host.enter_dfu_mode();
  REQUIRE_FALSE(host.ask(Code::kDnload, 0, std::span(file()).first(4096)).stall);
  auto now = host.status();
  REQUIRE(now->state == State::kDnbusy);
  CHECK(now->poll_ms == DfuDevice::kBlockPollMs);
  SECTION("at once") {
    CHECK_FALSE(host.status().has_value());
    CHECK(host.status()->status == DfuStatus::kErrStalledPkt);
    CHECK_FALSE(host.device->busy());
  }
  SECTION("after half the time, the main loop asleep") {
    host.clock.time_us += DfuDevice::kBlockPollMs * 500;
    now = host.status();
    REQUIRE(now);
    CHECK(now->state == State::kDnbusy);  // Nothing was done yet.
  }
  // Either way a download afterwards works.
  if (host.device->state() != State::kError) {
    host.pass(DfuDevice::kBlockPollMs);
    REQUIRE_FALSE(host.status()->state != State::kDnloadIdle);
    REQUIRE_FALSE(host.ask(Code::kAbort).stall);
  }
  CHECK(host.download(file(), 4096).status == DfuStatus::kOk);
}

TEST_CASE("A first block without bytes is an error, and nothing is touched") {
  DfuHost host;
  host.enter_dfu_mode();
  CHECK(host.ask(Code::kDnload).stall);
  CHECK(host.status()->state == State::kError);
  CHECK(host.slots.parts[1].erases(0) == 0);
}

TEST_CASE(
    "DETACH waits for the bus reset no longer than it was told, and DFU mode outlives the enumeration") {
  DfuHost host;
  const DfuReply reply = host.ask(Code::kDetach, 200);
  CHECK_FALSE(reply.stall);
  CHECK(reply.detach);
  SECTION("no reset in time") {
    host.clock.time_us += 199'000;
    host.device->poll();
    CHECK(host.device->state() == State::kAppDetach);
    host.clock.time_us += 1'000;
    CHECK(host.device->bus_reset() == DfuAfterReset::kRunTime);
    CHECK(host.device->state() == State::kAppIdle);
  }
  SECTION("a longer wait than wDetachTimeOut is not granted") {
    host.pass(300);
    REQUIRE_FALSE(host.ask(Code::kDetach, 60'000).stall);
    host.clock.time_us += 1'000'000;
    host.device->poll();
    CHECK(host.device->state() == State::kAppIdle);
  }
  SECTION("resets of an enumeration, then one after requests") {
    CHECK(host.device->bus_reset() == DfuAfterReset::kDfuMode);
    CHECK(host.device->bus_reset() == DfuAfterReset::kDfuMode);
    CHECK(host.status()->state == State::kIdle);
    CHECK(host.device->bus_reset() == DfuAfterReset::kRunTime);
    CHECK(host.device->state() == State::kAppIdle);
  }
}

TEST_CASE("A request to another interface is stalled and changes nothing") {
  DfuHost host;
  CHECK(host.device->request({.request = 0, .value = 1000, .index = 2}).stall);
  CHECK(host.device->state() == State::kAppIdle);
}
