// The device side of USB under any sequence of bus events, control requests, reports, bytes, halts and time,
// with parts of real DFU files among the data. After every event:
// - each SETUP was answered once: by a stall, by acceptance, or by at most as many bytes as asked for, which
// stay
//   untouched until the next event; an OUT data stage is asked for only where there is one;
// - the endpoints that are open are those of the configuration and setting that the device itself tells;
// - what is open in DFU mode is nothing.
// At the end: the slot that runs was not touched, and a host that enumerates the device finds it alive.
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "tests/fuzz/input.h"
#include "tests/fuzz/require.h"
#include "tests/unit/firmware_usb/usb_board.h"

namespace {

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using scatter::fuzz::Input;
using scatter::fuzz::require;

const std::vector<Bytes>& files() {
  static const std::vector<Bytes> made{
      make_package({.body_bytes = {3000, 5001}}).bytes(),
      make_package({.version = "6.6.6", .body_bytes = {3000, 5001}, .signer = Signer::kStranger}).bytes()};
  return made;
}

Bytes cells(UsbBoard& board, std::uint8_t slot) {
  Bytes bytes(board.slots.slot_bytes());
  (void)board.slots.parts[slot].read(0, bytes);
  return bytes;
}

class Run {
 public:
  explicit Run(bool rescue_mode) : board_(rescue_mode) { (void)board_.settle(); }

  UsbBoard& board() { return board_; }

  ControlResult control(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                        std::uint16_t length, const Bytes& data = {}) {
    const ControlResult result = board_.control(type, request, value, index, length, data);
    require(result.data.size() <= length);
    check();
    return result;
  }
  void check() {
    require(board_.bus.misuse.empty());
    std::set<std::uint8_t> open;
    for (const auto& [number, endpoint] : board_.bus.endpoints) {
      open.insert(number);
    }
    std::set<std::uint8_t> expected;
    const bool dfu = board_.usb->mode() == UsbMode::kDfu;
    if (board_.usb->configured() && !dfu) {
      expected = {0x83, 0x04};
      if (board_.bus.on_bus && board_.control(0x81, 10, 0, 0, 1).data == Bytes{std::byte{1}}) {
        expected.insert({0x81, 0x02});
      }
    }
    require(open == expected);
    require(board_.bus.misuse.empty());
  }

 private:
  UsbBoard board_;
};

/// Requests that mean something somewhere, so that the deep states are reached.
struct Known {
  std::uint8_t type, request;
  std::uint16_t value, index, length;
};
constexpr Known kKnown[] = {
    {0x80, 6, 0x0100, 0, 18},  {0x80, 6, 0x0200, 0, 255},
    {0x80, 6, 0x0300, 0, 255}, {0x80, 6, 0x0303, 0x409, 255},
    {0x80, 6, 0x0600, 0, 10},  {0x80, 6, 0x0700, 0, 255},
    {0x80, 6, 0x0F00, 0, 64},  {0xC0, 0x4D, 0, 7, 512},
    {0x00, 5, 7, 0, 0},        {0x00, 9, 1, 0, 0},
    {0x00, 9, 0, 0, 0},        {0x01, 11, 1, 0, 0},
    {0x01, 11, 0, 0, 0},       {0x01, 11, 0, 1, 0},
    {0x02, 3, 0, 0x81, 0},     {0x02, 1, 0, 0x81, 0},
    {0x02, 3, 0, 0x83, 0},     {0x02, 1, 0, 0x83, 0},
    {0x82, 0, 0, 0x02, 2},     {0x81, 10, 0, 0, 1},
    {0x80, 8, 0, 0, 1},        {0xA1, 1, 0x0300, 1, 64},
    {0xA1, 1, 0x0100, 1, 64},  {0x21, 10, 0x0100, 1, 0},
    {0x21, 9, 0x0200, 1, 64},  {0x81, 6, 0x2200, 1, 64},
    {0x21, 0, 1000, 2, 0},     {0xA1, 3, 0, 2, 6},
    {0xA1, 3, 0, 0, 6},        {0x21, 4, 0, 0, 0},
    {0x21, 6, 0, 0, 0},        {0x21, 1, 0, 0, 0},
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 4096) {
    return 0;
  }
  Input input(data, size);
  const std::uint8_t start = input.byte();
  const bool rescue_mode = start % 4 == 0;
  Run run(rescue_mode);
  UsbBoard& board = run.board();
  board.bus.its_speed = start % 2 == 0 ? UsbSpeed::kHigh : UsbSpeed::kFull;
  board.bus.in_capacity = 64U << (start >> 4U & 7U);
  const Bytes running = rescue_mode ? Bytes() : cells(board, 0);
  std::size_t at = 0;
  std::uint16_t block = 0;
  for (int steps = 0; !input.empty() && steps < 300; ++steps) {
    switch (input.byte() % 16) {
      case 0: {  // Any request, with any data.
        const std::uint8_t type = input.byte();
        const std::uint8_t request = input.byte();
        const std::uint16_t value = input.word();
        const std::uint16_t index = input.word();
        const std::uint16_t length = input.word();
        (void)run.control(type, request, value, index, length, input.some(input.byte()));
        break;
      }
      case 1:
      case 2:
      case 3: {
        const Known& known = kKnown[input.byte() % std::size(kKnown)];
        (void)run.control(known.type, known.request, known.value, known.index, known.length,
                          input.some(known.length));
        break;
      }
      case 4: {  // A SETUP that another event cuts off before its data.
        const Known& known = kKnown[input.byte() % std::size(kKnown)];
        const auto low = [](std::uint16_t v) { return static_cast<std::uint8_t>(v & 0xFFU); };
        const auto high = [](std::uint16_t v) { return static_cast<std::uint8_t>(v >> 8U); };
        if (board.bus.on_bus) {
          board.bus.setup({known.type, known.request, low(known.value), high(known.value), low(known.index),
                           high(known.index), low(known.length), high(known.length)});
          (void)board.turn();
        }
        break;
      }
      case 5: {  // The next block of a file.
        const Bytes& file = files()[start / 4 % files().size()];
        const std::size_t count = std::min<std::size_t>(1 + input.word() % 4096, file.size() - at);
        if (count > 0 && board.bus.on_bus) {
          const Bytes piece(file.begin() + static_cast<std::ptrdiff_t>(at),
                            file.begin() + static_cast<std::ptrdiff_t>(at + count));
          if (!run.control(0x21, 1, block, 0, static_cast<std::uint16_t>(count), piece).stalled) {
            at += count;
            ++block;
          }
        }
        break;
      }
      case 6:
        at = 0;
        block = 0;
        break;
      case 7:
        if (board.bus.on_bus) {
          board.bus.reset();
        }
        break;
      case 8:
        if (board.bus.on_bus) {
          board.bus.happen({.kind = static_cast<UsbEvent::Kind>(input.byte() % 5)});
        }
        break;
      case 9:  // A rescue report, mostly a good one.
        (void)board.bus.out(0x04, [&] {
          Bytes report = input.some(input.byte() % 65U);
          if (report.size() > 1) {
            report[0] = std::byte{1};
            report[1] &= std::byte{7};
          }
          return report;
        }());
        break;
      case 10:
        (void)board.bus.out(0x02, input.some(input.byte()));
        break;
      case 11:
        (void)board.bus.in(0x81);
        (void)board.bus.in(0x83, 64);
        break;
      case 12:
        board.button.count += input.byte();
        break;
      case 13:
        board.pass(input.word() % 50'000U);
        break;
      case 14:
        (void)board.turn();
        break;
      case 15:
        if (board.bus.on_bus) {
          board.enumerate();
        }
        break;
    }
    if (!board.bus.unanswered() && board.bus.on_bus) {
      require(board.settle());
      run.check();
    }
  }
  if (!rescue_mode) {
    require(cells(board, 0) == running);
  }
  require(board.slots.violations() == 0);
  // Whatever happened, it enumerates now, or it is restarting because it was asked to.
  board.pass(2'000'000);
  if (board.usb->restarting() || board.board.keeper.reboots > 0) {
    board.boot();
    (void)board.settle();
  }
  board.enumerate();
  require(board.usb->configured());
  run.check();
  return 0;
}
