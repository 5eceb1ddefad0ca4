// A DFU device under any sequence of requests, bytes, time, bus resets and power cycles, with good files,
// those of strangers and damaged ones among the bytes. After every request:
// - it was answered once, by a stall or by as many bytes as the request can have;
// - the state is one that this device has, the step to it one that the tables of DFU 1.1 have, and a stall
// leads
//   to dfuERROR (appIDLE in the application);
// - dfuERROR has a reason, and every other state none.
// At the end: the slot that runs was not touched, flash was never misused, and the other slot is marked ready
// only with an image that a trusted key signed.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tests/fuzz/require.h"
#include "tests/unit/firmware/dfu_host.h"

namespace {

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using scatter::fuzz::require;
using State = DfuState;
using Code = DfuRequestCode;

class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : bytes_(data, size) {}
  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  std::uint8_t byte() {
    const std::uint8_t value = bytes_.empty() ? std::uint8_t{0} : bytes_[0];
    bytes_ = bytes_.subspan(bytes_.empty() ? 0 : 1);
    return value;
  }
  std::uint16_t word() { return static_cast<std::uint16_t>(byte() | byte() << 8); }
  Bytes some(std::size_t count) {
    Bytes out;
    while (out.size() < count && !bytes_.empty()) {
      out.push_back(static_cast<std::byte>(byte()));
    }
    return out;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

constexpr std::size_t kGoodFiles = 2;
const std::vector<scatter::firmware_files::Package>& packages() {
  static const std::vector<scatter::firmware_files::Package> made{
      make_package({.body_bytes = {3000, 5001}}),
      make_package({.version = "2.1.0", .body_bytes = {700, 4096}}),
      make_package({.version = "6.6.6", .body_bytes = {3000, 5001}, .signer = Signer::kStranger}),
      make_package({.product = "HS-2", .body_bytes = {3000, 5001}})};
  return made;
}

/// Where a request may lead that was not stalled; `from` after the timers.
bool allowed(State from, Code code, State to) {
  switch (code) {
    case Code::kDetach:
      return from == State::kAppIdle && to == State::kAppDetach;
    case Code::kDnload:
      return (to == State::kDnloadSync && (from == State::kIdle || from == State::kDnloadIdle)) ||
             (to == State::kManifestSync && from == State::kDnloadIdle);
    case Code::kGetStatus:
      return to == from ? from != State::kDnloadSync && from != State::kManifestSync
             : from == State::kDnloadSync
                 ? to == State::kDnbusy || to == State::kDnloadIdle
                 : from == State::kManifestSync && (to == State::kManifest || to == State::kIdle);
    case Code::kClrStatus:
      return from == State::kError && to == State::kIdle;
    case Code::kGetState:
      return to == from;
    case Code::kAbort:
      return (from == State::kIdle || from == State::kDnloadIdle) && to == State::kIdle;
    default:
      return false;
  }
}

class Run {
 public:
  explicit Run(std::uint8_t running) : host_(running) {}

  DfuReply ask(std::uint8_t code, std::uint16_t value, std::span<const std::byte> data,
               std::uint16_t length) {
    // One to another interface, in between, is nothing to this one.
    const DfuReply probe = host_.device->request({.request = 5, .index = DfuHost::kInterface + 1});
    require(probe.stall);
    const State before = host_.device->state();
    const DfuReply reply = host_.ask(code, value, data, length);
    const State after = host_.device->state();
    require(reply.size <= reply.bytes.size() && reply.size <= length);
    require(after <= State::kError && after != State::kManifestWaitReset && after != State::kUploadIdle);
    if (reply.stall) {
      require(after == State::kError || (after == State::kAppIdle && before <= State::kAppDetach));
    } else {
      const State after_timers = before == State::kDnbusy      ? State::kDnloadSync
                                 : before == State::kManifest  ? State::kManifestSync
                                 : before == State::kAppDetach ? State::kAppIdle
                                                               : before;
      const auto named = static_cast<Code>(code);
      // Work in the background may have failed since: GETSTATUS and GETSTATE then tell, CLRSTATUS clears.
      require(allowed(before, named, after) || allowed(after_timers, named, after) ||
              (before >= State::kDnloadSync && before <= State::kManifest &&
               allowed(State::kError, named, after)));
      require(reply.detach == (named == Code::kDetach));
      const std::size_t bytes = named == Code::kGetStatus ? 6 : named == Code::kGetState ? 1 : 0;
      require(reply.size == std::min<std::size_t>(bytes, length));
    }
    require((host_.device->status() != DfuStatus::kOk) == (after == State::kError));
    return reply;
  }
  void check_slots(const Bytes& running_before) {
    require(host_.slots.violations() == 0);
    const std::uint8_t running = host_.slots.runs;
    if (running < ImageSlots::kCount) {
      require(host_.cells(running) == running_before);
    }
    for (std::uint8_t slot = 0; slot < ImageSlots::kCount; ++slot) {
      if (slot != running && read_marks(host_.slots.parts[slot]).last == MarkKind::kReady) {
        bool signed_one = false;
        for (std::size_t i = 0; i < kGoodFiles; ++i) {
          signed_one = signed_one || host_.ready_with(packages()[i], slot);
        }
        require(signed_one);
      }
    }
  }
  DfuHost& host() { return host_; }

 private:
  DfuHost host_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 4096) {
    return 0;
  }
  Input input(data, size);
  const auto running = static_cast<std::uint8_t>(input.byte() % 3);
  Run run(running);
  DfuHost& host = run.host();
  const Bytes running_before = running < ImageSlots::kCount ? host.cells(running) : Bytes();
  Bytes file = packages()[0].bytes();
  std::size_t at = 0;
  std::uint16_t block = 0;
  for (int steps = 0; !input.empty() && steps < 400; ++steps) {
    switch (input.byte() % 16) {
      case 0: {  // Any request.
        const std::uint8_t code = input.byte();
        const std::uint16_t value = input.word();
        const std::uint16_t length = input.word() % 5000;
        (void)run.ask(code, value, input.some(input.byte()), length);
        break;
      }
      case 1:  // Any class request without bytes.
        (void)run.ask(input.byte() % 8, block, {}, 6);
        break;
      case 2: {  // Any bytes.
        const Bytes bytes = input.some(1 + input.byte());
        (void)run.ask(1, block++, bytes, static_cast<std::uint16_t>(bytes.size()));
        break;
      }
      case 3:
      case 4:
      case 5: {  // The next piece of the file.
        const std::size_t count = std::min<std::size_t>(1 + input.word() % 4200, file.size() - at);
        if (count > 0 &&
            !run.ask(1, block, std::span(file).subspan(at, count), static_cast<std::uint16_t>(count)).stall) {
          ++block;
          at += count;
        }
        break;
      }
      case 6: {  // Another file, or from its start.
        file = packages()[input.byte() % packages().size()].bytes();
        at = 0;
        break;
      }
      case 7:  // Damage.
        file[input.word() % file.size()] ^= static_cast<std::byte>(1U << input.byte() % 8);
        break;
      case 8:
        (void)run.ask(1, block, {}, 0);
        break;
      case 9:
      case 10:
        (void)run.ask(3, 0, {}, 6);
        break;
      case 11:
        host.pass(input.byte(), 1 + input.byte() % 4);
        break;
      case 12:
        (void)host.device->bus_reset();
        break;
      case 13:
        host.enter_dfu_mode();
        break;
      case 14:  // Power gone and back.
        host.boot();
        break;
      case 15: {  // What a host does with a whole file: damaged or not.
        at = 0;
        const auto end = host.download(file, 16 + input.word() % 4081);
        // It finds the application when it came while the device waited for the reset.
        require(end.state == State::kIdle || end.state == State::kError || end.state == State::kAppIdle);
        break;
      }
    }
  }
  run.check_slots(running_before);
  // Whatever happened, a good file can be loaded now.
  host.boot();
  require(host.download(packages()[0].bytes(), 4096).status == DfuStatus::kOk);
  run.check_slots(running_before);
  return 0;
}
