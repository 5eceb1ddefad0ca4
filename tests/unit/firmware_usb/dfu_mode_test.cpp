// From the run-time configuration to DFU mode, through a download of a signed .scfw, to the restart.
#include <catch2/catch.hpp>

#include "tests/unit/firmware_usb/usb_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

const scatter::firmware_files::Package& package() {
  static const auto made = make_package();
  return made;
}
const Bytes& file() {
  static const Bytes bytes = with_suffix(package().bytes());
  return bytes;
}

/// What dfu-util asks for on the bus.
class DfuBus {
 public:
  explicit DfuBus(UsbBoard& board) : board_(board) {}

  struct Status {
    bool stalled = false;
    DfuStatus status{};
    std::uint32_t poll_ms = 0;
    DfuState state{};
  };
  std::uint16_t interface = 0;

  bool download(std::uint16_t block, std::span<const std::byte> data) {
    return !board_.control(0x21, 1, block, interface, static_cast<std::uint16_t>(data.size()), data).stalled;
  }
  Status status() {
    const ControlResult got = board_.control(0xA1, 3, 0, interface, 6);
    if (got.stalled || got.data.size() != 6) {
      return {.stalled = true};
    }
    return {.stalled = false,
            .status = static_cast<DfuStatus>(u8(got.data, 0)),
            .poll_ms = u32(got.data, 1) & 0xFF'FFFFU,
            .state = static_cast<DfuState>(u8(got.data, 4))};
  }
  DfuState state() {
    const ControlResult got = board_.control(0xA1, 5, 0, interface, 1);
    REQUIRE(got.data.size() == 1);
    return static_cast<DfuState>(u8(got.data, 0));
  }
  bool detach(std::uint16_t timeout_ms = 1000) { return !board_.control(0x21, 0, timeout_ms, 2, 0).stalled; }
  bool clear() { return !board_.control(0x21, 4, 0, interface, 0).stalled; }
  /// GETSTATUS, and the wait that it asks for, until the device is at rest.
  Status settle() {
    for (int i = 0; i < 10'000; ++i) {
      const Status now = status();
      if (now.stalled || (now.state != DfuState::kDnbusy && now.state != DfuState::kDnloadSync &&
                          now.state != DfuState::kManifest && now.state != DfuState::kManifestSync)) {
        return now;
      }
      board_.pass(std::uint64_t{now.poll_ms} * 1000);
    }
    return {.stalled = true};
  }
  Status send(const Bytes& whole, std::size_t block = 4096) {
    std::uint16_t number = 0;
    for (std::size_t at = 0; at < whole.size(); at += block) {
      const Bytes piece = part(whole, at, std::min(block, whole.size() - at));
      if (!download(number++, piece)) {
        return status();
      }
      const Status now = settle();
      if (now.state != DfuState::kDnloadIdle) {
        return now;
      }
    }
    if (!download(number, {})) {
      return status();
    }
    return settle();
  }

 private:
  UsbBoard& board_;
};

bool in_dfu_mode(UsbBoard& board) {
  return u16(board.get_descriptor(1, 0, 18).data, 10) == 0x000E;
}
/// DETACH, the leave, the join, and the resets of an enumeration.
void enter(UsbBoard& board, DfuBus& dfu) {
  REQUIRE(dfu.detach());
  board.pass(1'000'000);
  REQUIRE(board.bus.joins == 2);
  board.enumerate();
  board.enumerate();  // Hosts reset more than once.
  REQUIRE(in_dfu_mode(board));
}

}  // namespace

// PROVES: SPEC 11.7
TEST_CASE("After DETACH the device leaves the bus by itself and comes back in DFU mode") {
  UsbBoard board;
  DfuBus dfu(board);
  board.enumerate();
  REQUIRE_FALSE(in_dfu_mode(board));
  dfu.interface = 2;
  CHECK(dfu.state() == DfuState::kAppIdle);
  const std::uint16_t timeout_ms = GENERATE(std::uint16_t{0}, std::uint16_t{1000}, std::uint16_t{65535});
  REQUIRE(dfu.detach(timeout_ms));
  CHECK(board.bus.on_bus);  // The status stage is the host's first.
  board.pass(UsbDevice::kStatusStageUs);
  CHECK_FALSE(board.bus.on_bus);
  CHECK_FALSE(board.usb->configured());
  board.pass(UsbDevice::kAwayUs - 2'000);
  CHECK_FALSE(board.bus.on_bus);
  board.pass(3'000);
  CHECK(board.bus.on_bus);
  CHECK(board.bus.joins == 2);
  CHECK(board.usb->mode() == UsbMode::kDfu);
  board.enumerate();
  CHECK(in_dfu_mode(board));
  dfu.interface = 0;
  CHECK(dfu.state() == DfuState::kIdle);
  CHECK(board.bus.endpoints.empty());
  CHECK(board.control(0xA1, 5, 0, 2, 1).stalled);        // The interface has number 0 now.
  CHECK(board.control(0xA1, 1, 0x0300, 1, 64).stalled);  // And is alone.
  CHECK_FALSE(board.set_interface(0, 1));
  CHECK(board.bus.misuse == std::vector<std::string>());
}

// PROVES: SPEC 11.7
TEST_CASE("A host that resets the bus after DETACH finds DFU mode, too") {
  UsbBoard board;
  DfuBus dfu(board);
  board.enumerate();
  REQUIRE(dfu.detach());
  board.enumerate();
  CHECK(in_dfu_mode(board));
  board.pass(1'000'000);
  CHECK(board.bus.joins == 1);
}

// PROVES: SPEC 11.7
TEST_CASE("DETACH ends run and session of the host on interface 0") {
  UsbBoard board;
  DfuBus dfu(board);
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  usb.host.start(usb.host.configure(fixed_recipe()));
  REQUIRE(dfu.detach());
  board.pass(100'000);
  CHECK(board.instrument->run_state() == RunState::kIdle);
  CHECK_FALSE(board.instrument->session_open());
}

// PROVES: SPEC 11.8
TEST_CASE("A signed file goes over the bus into the free slot, and a reset then restarts the device") {
  const std::size_t block = GENERATE(std::size_t{64}, std::size_t{1000}, std::size_t{4096});
  UsbBoard board;
  DfuBus dfu(board);
  board.enumerate();
  enter(board, dfu);
  const auto end = dfu.send(file(), block);
  CHECK(end.status == DfuStatus::kOk);
  CHECK(end.state == DfuState::kIdle);
  CHECK(read_marks(board.slots.parts[1]).last == MarkKind::kReady);
  Bytes cells(package().image(1).body.size());
  REQUIRE(board.slots.parts[1].read(kImageBodyOffset, cells));
  CHECK(cells == package().image(1).body);
  CHECK(board.board.keeper.reboots == 0);
  CHECK(board.bus.on_bus);  // bitManifestationTolerant
  board.bus.reset();
  board.settle();
  CHECK(board.board.keeper.reboots == 1);
  CHECK_FALSE(board.bus.on_bus);
  CHECK(board.usb->restarting());
  board.pass(5'000'000);
  CHECK(board.board.keeper.reboots == 1);
  CHECK_FALSE(board.bus.on_bus);
  CHECK(board.bus.misuse == std::vector<std::string>());
}

// PROVES: SPEC 11.8
TEST_CASE("Without a download a reset leads back to the instrument, once DFU mode was used") {
  UsbBoard board;
  DfuBus dfu(board);
  board.enumerate();
  enter(board, dfu);
  CHECK(dfu.state() == DfuState::kIdle);
  board.enumerate();
  CHECK_FALSE(in_dfu_mode(board));
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  CHECK(usb.host.measure(fixed_recipe()).reason == static_cast<std::uint8_t>(RunEnd::kCompleted));
}

TEST_CASE("A file signed by a stranger is refused before the slot is touched") {
  static const auto stranger = make_package({.signer = Signer::kStranger});
  UsbBoard board;
  DfuBus dfu(board);
  board.enumerate();
  enter(board, dfu);
  const auto end = dfu.send(stranger.bytes());
  CHECK(end.status == DfuStatus::kErrFile);
  CHECK(end.state == DfuState::kError);
  Bytes cells(256);
  REQUIRE(board.slots.parts[1].read(0, cells));
  CHECK(cells == Bytes(256, std::byte{0xFF}));
  CHECK(dfu.clear());
  CHECK(dfu.send(file()).status == DfuStatus::kOk);
}

TEST_CASE("Requests that DFU mode does not allow are stalled and lead to dfuERROR") {
  UsbBoard board;
  DfuBus dfu(board);
  board.enumerate();
  enter(board, dfu);
  struct Request {
    std::uint8_t type, request;
    std::uint16_t length;
  };
  const auto bad = GENERATE(values<Request>({
      {0xA1, 2, 64},    // UPLOAD: bitCanUpload is 0
      {0x21, 0, 0},     // DETACH in DFU mode
      {0xA1, 1, 64},    // DNLOAD the wrong way
      {0x21, 3, 0},     // GETSTATUS the wrong way
      {0x21, 1, 0},     // An empty DNLOAD before any block
      {0x21, 1, 4097},  // Longer than wTransferSize
      {0x21, 6, 1},     // ABORT with data
      {0x21, 9, 0},     // Unknown
  }));
  CAPTURE(int(bad.type), int(bad.request), bad.length);
  CHECK(board.control(bad.type, bad.request, 0, 0, bad.length, Bytes(bad.length)).stalled);
  const auto now = dfu.status();
  CHECK(now.state == DfuState::kError);
  CHECK(now.status == DfuStatus::kErrStalledPkt);
  CHECK(dfu.clear());
  CHECK(dfu.state() == DfuState::kIdle);
  CHECK(board.bus.misuse == std::vector<std::string>());
}

TEST_CASE("A block that the host cuts short is refused") {
  UsbBoard board;
  DfuBus dfu(board);
  board.enumerate();
  enter(board, dfu);
  // wLength says 4096, 100 bytes come.
  CHECK(board.control(0x21, 1, 0, 0, 4096, part(file(), 0, 100)).stalled);
  CHECK(dfu.status().state == DfuState::kError);
}

// PROVES: SPEC 11.7
TEST_CASE("An update over the normal protocol that DETACH breaks off is resumed by DFU") {
  UsbBoard board;
  DfuBus dfu(board);
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  // The header and a part of the body, then somebody runs dfu-util.
  const auto& image = package().image(1);
  UpdateBegin begin;
  const auto header = scatter::firmware_files::header_bytes(image.header);
  begin.header = header;
  REQUIRE(usb.host.status_of(begin) == StatusCode::kOk);
  REQUIRE(usb.host.status_of(UpdateWrite{.offset = 0, .data = std::span(image.body).first(4096)}) ==
          StatusCode::kOk);
  enter(board, dfu);
  CHECK(dfu.send(file()).status == DfuStatus::kOk);
  CHECK(read_marks(board.slots.parts[1]).last == MarkKind::kReady);
}

// PROVES: SPEC 11.9
TEST_CASE("A bootloader without an image joins the bus in DFU mode and can be given one") {
  UsbBoard board(true);
  board.slots.install(make_image({.slot = 0, .signer = Signer::kStranger}), {});
  board.boot();
  DfuBus dfu(board);
  board.enumerate();
  CHECK(in_dfu_mode(board));
  const auto now = dfu.status();
  CHECK(now.state == DfuState::kError);
  CHECK(now.status == DfuStatus::kErrFirmware);
  CHECK(dfu.clear());
  CHECK(dfu.send(file()).status == DfuStatus::kOk);
  board.bus.reset();
  board.settle();
  CHECK(board.board.keeper.reboots == 1);
}
