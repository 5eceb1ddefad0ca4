// An instrument on a bus: the fake board, a fake controller, slots, and everything of firmware/core/usb over
// them, with a host that makes control transfers.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

#include "firmware/core/instrument.h"
#include "firmware/core/usb/core_rescue.h"
#include "firmware/core/usb/usb_device.h"
#include "protocol/usb_identity.h"
#include "tests/unit/firmware/dfu_host.h"
#include "tests/unit/firmware/fake_board.h"
#include "tests/unit/firmware/test_images.h"
#include "tests/unit/firmware_usb/fake_usb.h"

namespace scatter::firmware::fake {

struct FakeButton final : Button {
  std::uint32_t count = 0;
  std::uint32_t presses() noexcept override { return count; }
};

struct ControlResult {
  bool stalled = false;
  Bytes data;
};

class UsbBoard {
 public:
  static constexpr std::string_view kProductName = "HS-1 test";

  /// Runs image 1.0.0, confirmed, from slot 0; `rescue_mode`: no image, so the bootloader speaks.
  explicit UsbBoard(bool rescue_mode = false, UsbIdentity its_identity = default_identity())
      : identity(its_identity) {
    if (!rescue_mode) {
      slots.install(make_image({.slot = 0}), {{MarkKind::kConfirmed, 1}});
    }
    slots.runs = rescue_mode ? ImageSlots::kCount : 0;
    boot();
  }
  UsbBoard(const UsbBoard&) = delete;
  UsbBoard& operator=(const UsbBoard&) = delete;

  static UsbIdentity default_identity() {
    return {.manufacturer = "OpenScatter", .product = kProductName, .serial = "T0001", .release_bcd = 0x0102};
  }

  /// New RAM; the cells of flash stay.
  void boot() {
    usb.reset();
    dfu.reset();
    rescue.reset();
    instrument.reset();
    bus.connect(false);
    bus.misuse.clear();
    bus.joins = 0;
    board.image_slots = &slots;
    board.verifier = &verifier;
    link = std::make_unique<UsbLink>(bus);
    ports = std::make_unique<Ports>(Ports{.clock = board.clock,
                                          .link = *link,
                                          .sensor = board.optics,
                                          .illuminator = board.optics,
                                          .monitor = board.optics,
                                          .thermometer = board.optics,
                                          .watchdog = board.keeper,
                                          .reset = board.keeper,
                                          .flash = board.flash,
                                          .factory = board.factory,
                                          .reference_stage = board.with_stage ? &board.stage : nullptr,
                                          .image_slots = &slots,
                                          .verifier = &verifier,
                                          .button = &button});
    if (slots.runs < ImageSlots::kCount) {
      instrument = std::make_unique<Instrument>(*ports);
      rescue = std::make_unique<CoreRescue>(*instrument, *ports);
    } else {
      own_receiver = std::make_unique<UpdateReceiver>(slots, verifier, kProductName);
    }
    UpdateReceiver& receiver = instrument ? *instrument->update_receiver() : *own_receiver;
    dfu =
        std::make_unique<DfuDevice>(board.clock, slots, receiver, kProductName, protocol::usb::kDfuInterface);
    usb = std::make_unique<UsbDevice>(UsbParts{bus, board.clock, board.keeper, *link, *dfu, rescue.get()},
                                      identity);
  }

  /// One turn of the main loop.
  Step turn() {
    const Step a = usb->poll();
    const Step b = instrument ? instrument->poll() : Step{};
    const bool none = a.wake_at_us == 0 || b.wake_at_us == 0;
    return {.did_work = a.did_work || b.did_work,
            .wake_at_us = none ? std::max(a.wake_at_us, b.wake_at_us) : std::min(a.wake_at_us, b.wake_at_us)};
  }
  /// Until nothing happens, at one moment of time. False: it never comes to rest.
  bool settle() {
    for (int i = 0; i < 100'000; ++i) {
      if (!turn().did_work) {
        return true;
      }
    }
    return false;
  }
  void pass(std::uint64_t us) {
    const std::uint64_t end = board.clock.time_us + us;
    settle();
    while (board.clock.time_us < end) {
      board.clock.time_us = std::min(end, board.clock.time_us + 1000);
      settle();
    }
  }

  /// A control transfer; `data` for those to the device. Off the bus nothing answers.
  ControlResult control(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                        std::uint16_t length, std::span<const std::byte> data = {}) {
    if (!bus.on_bus) {
      return {.stalled = true, .data = {}};
    }
    const std::uint32_t joins = bus.joins;
    const auto low = [](std::uint16_t v) { return static_cast<std::uint8_t>(v & 0xFFU); };
    const auto high = [](std::uint16_t v) { return static_cast<std::uint8_t>(v >> 8U); };
    bus.setup({type, request, low(value), high(value), low(index), high(index), low(length), high(length)});
    for (int i = 0; i < 1000 && (bus.unanswered() || !bus.quiet()); ++i) {
      turn();
      if (bus.wanted != 0) {
        bus.give(data);
      }
    }
    if (!bus.on_bus || bus.joins != joins) {
      return {.stalled = true, .data = {}};  // It left meanwhile.
    }
    if (bus.answer == FakeController::Answer::kNone) {
      bus.misuse.emplace_back("no answer to a SETUP");
    }
    return {.stalled = bus.answer == FakeController::Answer::kStalled, .data = bus.sent};
  }
  ControlResult get_descriptor(std::uint8_t kind, std::uint8_t number, std::uint16_t length,
                               std::uint16_t language = 0) {
    return control(0x80, 6, static_cast<std::uint16_t>(kind << 8U | number), language, length);
  }
  bool set_configuration(std::uint16_t value) { return !control(0x00, 9, value, 0, 0).stalled; }
  bool set_interface(std::uint16_t number, std::uint16_t setting) {
    return !control(0x01, 11, setting, number, 0).stalled;
  }
  /// Reset, address, configuration.
  void enumerate() {
    settle();
    bus.reset();
    settle();
    (void)control(0x00, 5, 7, 0, 0);
    (void)set_configuration(1);
    settle();
  }

  FakeBoard board;
  FakeButton button;
  FakeController bus;
  TestSlots slots;
  RememberingVerifier verifier;
  UsbIdentity identity;
  std::unique_ptr<UsbLink> link;
  std::unique_ptr<Ports> ports;
  std::unique_ptr<Instrument> instrument;
  std::unique_ptr<CoreRescue> rescue;
  std::unique_ptr<UpdateReceiver> own_receiver;
  std::unique_ptr<DfuDevice> dfu;
  std::unique_ptr<UsbDevice> usb;
};

}  // namespace scatter::firmware::fake
