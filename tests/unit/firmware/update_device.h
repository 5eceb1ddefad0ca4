// A board with slots, started by the bootloader, and its host.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/boot/boot_decision.h"
#include "firmware/boot/rescue.h"
#include "tests/unit/firmware/fake_host.h"
#include "tests/unit/firmware/test_images.h"

namespace scatter::firmware::fake {

inline constexpr std::string_view kProduct = "HS-1 test";  // FakeFactory's.

class Device {
 public:
  Device() {
    board.image_slots = &slots;
    board.verifier = &verifier;
    slots.install(image("1.0.0", 0), {{MarkKind::kConfirmed, 1}});
    boot();
  }
  ~Device() {
    CHECK(slots.violations() == 0);
    CHECK(board.flash.violations == 0);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  static Image image(std::string version, std::uint8_t slot, std::uint32_t counter = 1,
                     std::uint32_t body_bytes = 9000) {
    return make_image(
        {.version = std::move(version), .counter = counter, .slot = slot, .body_bytes = body_bytes});
  }
  void boot(protocol::ResetReason reason = protocol::ResetReason::kPowerOn) {
    slots.supply.power_on();
    decision = decide(slots, verifier, kProduct, reason);
    slots.runs = decision.slot;
    board.keeper.why = reason;
    board.link.to_device.clear();
    board.link.to_host.clear();
    host.reset();
    rescue.reset();
    if (decision.action == BootDecision::Action::kRun) {
      host.emplace(board);
    } else {
      rescue = std::make_unique<Rescue>(RescuePorts{.clock = board.clock,
                                                    .link = board.link,
                                                    .watchdog = board.keeper,
                                                    .reset = board.keeper,
                                                    .slots = slots,
                                                    .verifier = verifier,
                                                    .product = kProduct,
                                                    .serial = "T0001",
                                                    .build_id = "bootloader test"});
      host.emplace(board, [this] { return rescue->poll(); });
    }
    hello = host->hello();
  }

  protocol::StatusReply begin(const Image& what) {
    protocol::UpdateBegin message;
    std::ranges::transform(what.header_bytes, message.header.begin(),
                           [](std::byte b) { return static_cast<std::uint8_t>(b); });
    return host->ask(message).as<protocol::StatusReply>();
  }
  protocol::StatusReply write(const Image& what, std::uint32_t offset, std::uint32_t size) {
    protocol::UpdateWrite message;
    message.offset = offset;
    message.data = std::span(what.body).subspan(offset, size);
    return host->ask(message).as<protocol::StatusReply>();
  }
  protocol::UpdateState state() { return host->ask(protocol::UpdateStatus{}).as<protocol::UpdateState>(); }
  /// Writes from `state().received` to `end`.
  void write_rest(const Image& what, std::uint32_t end) {
    const protocol::UpdateState before = state();
    for (std::uint32_t at = before.received; at < end;) {
      const auto size = std::min<std::uint32_t>(before.chunk_bytes, end - at);
      const protocol::StatusReply reply = write(what, at, size);
      INFO(reply.text.str());
      REQUIRE(reply.status == protocol::StatusCode::kOk);
      at += size;
    }
  }
  void send(const Image& what) {
    const protocol::StatusReply begun = begin(what);
    INFO(begun.text.str());
    REQUIRE(begun.status == protocol::StatusCode::kOk);
    write_rest(what, what.header.body_bytes);
    REQUIRE(host->status_of(protocol::UpdateFinish{}) == protocol::StatusCode::kOk);
  }
  [[nodiscard]] std::vector<std::byte> cells(std::uint8_t slot) {
    std::vector<std::byte> bytes(slots.slot_bytes());
    REQUIRE(slots.slot(slot).read(0, bytes));
    return bytes;
  }

  FakeBoard board;
  TestSlots slots;
  RememberingVerifier verifier;
  BootDecision decision;
  std::unique_ptr<Rescue> rescue;
  std::optional<FakeHost> host;
  protocol::HelloReply hello;
};

}  // namespace scatter::firmware::fake
