// What the simulator breaks on purpose: parsed from text such as "drop:1e-3+stall:20000:500".
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::simulator {

/// One direction of the link.
enum class Direction : std::uint8_t { kToHost = 0, kToDevice = 1 };

/// Chances per wire frame, each 0..1 and drawn independently.
struct LinkRates {
  double drop = 0;       ///< The frame vanishes.
  double corrupt = 0;    ///< 1..5 bits of it are flipped.
  double duplicate = 0;  ///< It comes twice.
  double reorder = 0;    ///< It comes after the next frame.
  double truncate = 0;   ///< It is cut at a byte.
  double garbage = 0;    ///< 1..64 random bytes come before it.
  [[nodiscard]] constexpr bool any() const noexcept {
    return drop > 0 || corrupt > 0 || duplicate > 0 || reorder > 0 || truncate > 0 || garbage > 0;
  }
};

/// From byte `at_byte` of one direction (counted since power-on) nothing passes for a while.
struct Stall {
  Direction direction = Direction::kToHost;
  std::uint64_t at_byte = 0;
  std::optional<std::uint64_t> duration_us;  ///< Absent: for ever.
};

/// The link breaks, once, when `at_byte` bytes of one direction have passed.
struct Disconnect {
  Direction direction = Direction::kToHost;
  std::uint64_t at_byte = 0;
};

/// Chances per IN transfer of the USB bulk pipe, each 0..1; without effect on other carriers.
struct UsbRates {
  double stall = 0;  ///< The endpoint halts; what waited in it is lost.
  double short_read =
      0;              ///< The transfer ends early, maybe before its first byte; the rest comes in the next.
  double babble = 0;  ///< The device sends more than was asked for: the transfer's bytes are lost.
  [[nodiscard]] constexpr bool any() const noexcept { return stall > 0 || short_read > 0 || babble > 0; }
};

/// Every fault of a run. Default: none.
struct FaultPlan {
  std::array<LinkRates, 2> link;  ///< Indexed by Direction.
  UsbRates usb;
  std::vector<Stall> stalls;
  std::vector<Disconnect> disconnects;
  double readout = 0;                         ///< Chance per frame that its readout fails.
  std::vector<std::uint8_t> dead_leds;        ///< Illuminations that stay dark.
  std::vector<std::uint64_t> reset_at_frame;  ///< The device restarts in these exposures, counted from 1.

  [[nodiscard]] const LinkRates& rates(Direction direction) const noexcept {
    return link[static_cast<std::size_t>(direction)];
  }
};

/// Adds the faults of `text` to `plan`.
///
/// Grammar   FAULT ('+' FAULT)*, FAULT = NAME ':' VALUE [':' MS] [':to_host' | ':to_device'].
///           Rates apply to both directions unless one is named; stall and disconnect to to_host.
/// Names     drop corrupt duplicate reorder truncate garbage (RATE 0..1), stall:AT_BYTE[:MS],
///           disconnect:AT_BYTE, usb_stall:RATE, usb_short:RATE, usb_babble:RATE, readout:RATE, led:INDEX,
///           reset:AT_FRAME.
/// Errors    kInvalidArgument naming the fault, what was expected and what was found; plan untouched.
[[nodiscard]] Status add_faults(std::string_view text, FaultPlan& plan);

}  // namespace scatter::simulator
