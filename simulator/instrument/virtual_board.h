// Every port of the firmware, on simulated parts: what a circuit board is to the real instrument.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "firmware/boot/rescue.h"
#include "firmware/ports/ports.h"
#include "host_sdk/error/error.h"
#include "simulator/bench/bench.h"
#include "simulator/instrument/camera.h"
#include "simulator/instrument/flash_image.h"
#include "simulator/instrument/instrument_options.h"
#include "simulator/instrument/virtual_clock.h"
#include "simulator/instrument/virtual_link.h"
#include "simulator/instrument/virtual_slots.h"
#include "simulator/usb/virtual_usb_controller.h"

namespace scatter::simulator {

/// Threads: one. Stays where it is, because its ports() refer to it.
class VirtualBoard {
 public:
  static constexpr std::uint64_t kWatchdogUs = 5'000'000;  ///< Bites after this time without a kick.

  /// Errors    of Sample::make, Bench::make and FlashImage::open; kInvalidArgument: a fault names an LED
  ///           that this instrument does not have.
  [[nodiscard]] static Result<std::unique_ptr<VirtualBoard>> make(const InstrumentOptions& options);
  VirtualBoard(const VirtualBoard&) = delete;
  VirtualBoard& operator=(const VirtualBoard&) = delete;

  /// Of the firmware that runs since the last boot; ask again after restart(). The link is link().
  [[nodiscard]] firmware::Ports ports() noexcept { return ports(link_); }
  /// With another carrier.
  [[nodiscard]] firmware::Ports ports(firmware::Link& link) noexcept;
  /// Of the bootloader, for when slots().decision() is rescue mode.
  [[nodiscard]] firmware::RescuePorts rescue_ports() noexcept;
  [[nodiscard]] Bench& bench() noexcept { return *bench_; }
  [[nodiscard]] VirtualClock& clock() noexcept { return clock_; }
  [[nodiscard]] VirtualLink& link() noexcept { return link_; }
  /// Null unless the carrier is USB.
  [[nodiscard]] VirtualUsbController* usb() noexcept { return usb_ ? &*usb_ : nullptr; }
  /// The measure button is pressed once.
  void press_button() noexcept { ++button_.count; }
  [[nodiscard]] Camera& camera() noexcept { return camera_; }
  [[nodiscard]] FlashImage& flash() noexcept { return *flash_; }
  [[nodiscard]] VirtualSlots& slots() noexcept { return slots_; }
  [[nodiscard]] const protocol::Descriptor& descriptor() const noexcept { return factory_.data; }

  /// Set when something asks for a restart: the firmware, the watchdog, or the fault plan.
  [[nodiscard]] std::optional<protocol::ResetReason> restart_wanted() noexcept;
  /// What a reset does to the hardware: the link drops, the device leaves the bus, LEDs go off, the clock
  /// starts at 0, the bootloader chooses an image. Flash, temperatures and drift stay.
  void restart(protocol::ResetReason reason) noexcept;

 private:
  struct VirtualWatchdog final : firmware::Watchdog {
    explicit VirtualWatchdog(VirtualClock& its_clock) : clock(its_clock) {}
    void kick() noexcept override { kicked_us = clock.since_power_on_us(); }
    VirtualClock& clock;
    std::uint64_t kicked_us = 0;
  };
  struct VirtualReset final : firmware::Reset {
    void reboot() noexcept override { wanted = true; }
    [[nodiscard]] protocol::ResetReason reason() noexcept override { return why; }
    bool wanted = false;
    protocol::ResetReason why = protocol::ResetReason::kPowerOn;
  };
  struct VirtualButton final : firmware::Button {
    [[nodiscard]] std::uint32_t presses() noexcept override { return count; }
    std::uint32_t count = 0;
  };
  /// The clock of what goes on through restarts.
  struct PowerOnClock final : firmware::Clock {
    explicit PowerOnClock(VirtualClock& its_clock) : clock(its_clock) {}
    [[nodiscard]] std::uint64_t now_us() noexcept override { return clock.since_power_on_us(); }
    VirtualClock& clock;
  };
  struct VirtualFactory final : firmware::Factory {
    explicit VirtualFactory(Bench& its_bench) : bench(its_bench), data(its_bench.descriptor()) {}

    [[nodiscard]] const protocol::Descriptor& descriptor() noexcept override { return data; }
    [[nodiscard]] std::span<const std::byte> object(protocol::ObjectId id) noexcept override {
      return bench.object(id);
    }
    Bench& bench;
    protocol::Descriptor data;
  };

  VirtualBoard(const InstrumentOptions& options, std::unique_ptr<Bench> bench,
               std::unique_ptr<FlashImage> flash);

  FaultPlan plan_;
  std::unique_ptr<Bench> bench_;
  std::unique_ptr<FlashImage> flash_;
  VirtualClock clock_;
  VirtualLink link_;
  PowerOnClock power_on_clock_;
  std::optional<VirtualUsbController> usb_;
  Camera camera_;
  VirtualWatchdog watchdog_;
  VirtualReset reset_;
  VirtualButton button_;
  VirtualFactory factory_;
  VirtualSlots slots_;
};

}  // namespace scatter::simulator
