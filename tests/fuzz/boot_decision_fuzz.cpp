// The bootloader over slots that hold anything: good images, images of strangers and for other products, torn
// and rotten ones, arbitrary bytes, marks in any order, cells that cannot be read. For every such device:
// - what is chosen is, byte for byte, an image that a trusted key signed for this product and this slot;
// - rescue mode only when there is no such image (or none confirmed, right after a crash);
// - deciding again, nothing else having happened, never prefers an image that was not confirmed in time;
// - flash is never misused.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "firmware/boot/boot_decision.h"
#include "tests/fuzz/require.h"
#include "tests/unit/firmware/test_images.h"

namespace {

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using scatter::fuzz::require;
using scatter::protocol::kImageBodyOffset;
using scatter::protocol::ResetReason;

constexpr std::string_view kProduct = "HS-1 test";

/// Two for each slot; the second half must never start.
const std::vector<Image>& images() {
  static const std::vector<Image> made = [] {
    std::vector<Image> list;
    for (std::uint8_t slot = 0; slot < ImageSlots::kCount; ++slot) {
      for (const char* version : {"1.0.0", "2.0.0"}) {
        list.push_back(make_image({.version = version, .slot = slot, .body_bytes = 3000}));
      }
    }
    for (std::uint8_t slot = 0; slot < ImageSlots::kCount; ++slot) {
      list.push_back(
          make_image({.version = "6.6.6", .slot = slot, .body_bytes = 3000, .signer = Signer::kStranger}));
      list.push_back(make_image({.product = "HS-2", .slot = slot, .body_bytes = 3000}));
    }
    return list;
  }();
  return made;
}
constexpr std::size_t kGoodImages = 4;

/// The good image that a slot holds now, or -1.
int held(TestSlots& slots, std::uint8_t slot) {
  for (std::size_t i = 0; i < kGoodImages; ++i) {
    const Image& image = images()[i];
    std::vector<std::byte> header(image.header_bytes.size());
    std::vector<std::byte> body(image.body.size());
    if (image.header.slot == slot && slots.slot(slot).read(0, header) && header == image.header_bytes &&
        slots.slot(slot).read(kImageBodyOffset, body) && body == image.body) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : bytes_(data, size) {}
  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  std::uint8_t byte() {
    const std::uint8_t value = bytes_.empty() ? std::uint8_t{0} : bytes_[0];
    bytes_ = bytes_.subspan(bytes_.empty() ? 0 : 1);
    return value;
  }
  std::uint32_t word() { return byte() | std::uint32_t{byte()} << 8U; }
  std::vector<std::byte> some(std::size_t count) {
    std::vector<std::byte> out;
    while (out.size() < count && !bytes_.empty()) {
      out.push_back(static_cast<std::byte>(byte()));
    }
    return out;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

void boot_and_check(TestSlots& slots, RememberingVerifier& verifier, ResetReason reason) {
  slots.supply.power_on();
  const std::array<int, 2> before{held(slots, 0), held(slots, 1)};
  const BootDecision decision = decide(slots, verifier, kProduct, reason);
  require(slots.violations() == 0);
  const bool crashed = reason == ResetReason::kWatchdog || reason == ResetReason::kFault;
  if (decision.action == BootDecision::Action::kRun) {
    require(decision.slot < ImageSlots::kCount);
    require(before[decision.slot] >= 0);
    require(held(slots, decision.slot) == before[decision.slot]);
    const Marks marks = read_marks(slots.slot(decision.slot));
    require(decision.trial != (marks.last == MarkKind::kConfirmed));
    slots.runs = decision.slot;
  } else {
    require(decision.slot == ImageSlots::kCount);
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      require(before[i] < 0 || (crashed && read_marks(slots.slot(i)).last != MarkKind::kConfirmed));
    }
    slots.runs = ImageSlots::kCount;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 4096) {
    return 0;
  }
  Input input(data, size);
  TestSlots slots;
  RememberingVerifier verifier;
  slots.supply.power_on();
  const std::uint32_t bytes = slots.slot_bytes();
  for (int steps = 0; !input.empty() && steps < 64; ++steps) {
    const std::uint8_t what = input.byte();
    const std::uint8_t slot = what >> 7U;
    scatter::simulator::CutFlash& flash = slots.parts[slot];
    switch (what % 8) {
      case 0:
      case 1:
        slots.install(images()[input.byte() % images().size()], {});
        break;
      case 2:
      case 3: {
        const auto kind = static_cast<MarkKind>(1 + input.byte() % 4);
        (void)write_mark(flash, kind, kind == MarkKind::kConfirmed ? input.byte() : 0);
        break;
      }
      case 4: {
        const std::uint32_t at = input.word() % bytes;
        const std::vector<std::byte> raw = input.some(std::min<std::uint32_t>(input.byte(), bytes - at));
        flash.overwrite(at, raw);
        break;
      }
      case 5:
        flash.rot(input.word() % bytes, static_cast<std::uint8_t>(1U << input.byte() % 8));
        break;
      case 6:
        flash.trap(input.word() % (bytes - 32), 1 + input.byte() % 32);
        break;
      case 7:
        boot_and_check(slots, verifier, static_cast<ResetReason>(input.byte() % 5));
        break;
    }
  }
  boot_and_check(slots, verifier, ResetReason::kPowerOn);
  // Nobody confirmed anything in between: an image on trial does not come up again while another one is good.
  const std::uint8_t first = slots.runs;
  const bool was_trial =
      first < ImageSlots::kCount && read_marks(slots.slot(first)).last != MarkKind::kConfirmed;
  boot_and_check(slots, verifier, ResetReason::kPowerOn);
  if (was_trial && slots.runs == first) {
    const auto other = static_cast<std::uint8_t>(1 - first);
    require(held(slots, other) < 0 || read_marks(slots.slot(other)).last != MarkKind::kConfirmed);
  }
  return 0;
}
