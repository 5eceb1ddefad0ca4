// Messages between a board without a camera (QEMU's Cortex-M7) and the simulated bench, over a serial line of
// their own. The bench draws a frame only when the firmware has lit an LED and triggered an exposure with it:
// nothing enters the board that the firmware did not command.
//
// A message is: u8 kind, u8 length n, n bytes of payload (protocol/codec.h: fields in order, little endian),
// u8 check = 0xFF - (sum of all bytes before it) mod 256. The line loses nothing (an emulated UART); the
// check catches a side that speaks another version. A message with a wrong check or length is answered by
// Fault and changes nothing.
#pragma once

#include <cstdint>

#include "protocol/field.h"

namespace scatter::firmware::backplane {

inline constexpr std::uint8_t kVersion = 1;
inline constexpr std::size_t kMaxPayload = 32;

enum class Kind : std::uint8_t {
  // Board to bench.
  kBooted = 'B',   ///< The firmware starts: LEDs off, exposure cancelled, the host's line is dropped.
  kLight = 'L',    ///< At most one LED is lit.
  kTrigger = 'T',  ///< Exposes a window now.
  kRelease = 'X',  ///< Cancels the exposure or gives the frame back.
  kMove = 'M',     ///< The stage brings a target.
  // Bench to board.
  kReady = 'r',    ///< The frame is in shared memory; thermometers show the moment.
  kSettled = 's',  ///< The stage stands.
  kFault = 'f',    ///< The bench refused the last command.
};

struct Booted {
  static constexpr Kind kKind = Kind::kBooted;
  std::uint8_t version = kVersion;
  std::uint8_t reset_reason = 0;  ///< protocol::ResetReason
  std::uint8_t bootloader = 0;    ///< 1: sent by the bootloader, 0: by the firmware.
  static constexpr auto schema() {
    using protocol::field;
    return protocol::fields(field("version", &Booted::version, "", "of these messages"),
                            field("reset_reason", &Booted::reset_reason, "", "why"),
                            field("bootloader", &Booted::bootloader, "", "1: the bootloader says so"));
  }
};

struct Light {
  static constexpr Kind kKind = Kind::kLight;
  std::uint8_t illumination = 0xFF;  ///< 0xFF: none.
  static constexpr auto schema() {
    return protocol::fields(protocol::field("illumination", &Light::illumination, "", "255 = none"));
  }
};

struct Trigger {
  static constexpr Kind kKind = Kind::kTrigger;
  std::uint32_t number = 0;  ///< Rises by one; Ready and Fault name it.
  std::uint16_t x = 0, y = 0, width = 0, height = 0;
  std::uint32_t exposure_us = 0;
  static constexpr auto schema() {
    using protocol::field;
    return protocol::fields(field("number", &Trigger::number, "", "rises by one"),
                            field("x", &Trigger::x, "px", "window"), field("y", &Trigger::y, "px", "window"),
                            field("width", &Trigger::width, "px", "window"),
                            field("height", &Trigger::height, "px", "window"),
                            field("exposure_us", &Trigger::exposure_us, "us", "exposure time"));
  }
};

struct Release {
  static constexpr Kind kKind = Kind::kRelease;
  static constexpr auto schema() { return protocol::fields(); }
};

struct Move {
  static constexpr Kind kKind = Kind::kMove;
  std::uint8_t target = 0;  ///< protocol::Target
  static constexpr auto schema() {
    return protocol::fields(
        protocol::field("target", &Move::target, "", "0 sample, 1 dark cap, 2 white, ..."));
  }
};

struct Ready {
  static constexpr Kind kKind = Kind::kReady;
  std::uint32_t number = 0;
  std::uint32_t monitor_uv = 0;
  std::uint32_t pixel_crc = 0;      ///< CRC-32C of the frame's bytes in shared memory.
  std::uint8_t readout_failed = 0;  ///< 1: a simulated readout fault, there are no pixels.
  static constexpr auto schema() {
    using protocol::field;
    return protocol::fields(field("number", &Ready::number, "", "of the trigger"),
                            field("monitor_uv", &Ready::monitor_uv, "uV", "photodiode"),
                            field("pixel_crc", &Ready::pixel_crc, "", "of the frame's bytes"),
                            field("readout_failed", &Ready::readout_failed, "", "1: no pixels"));
  }
};

struct Settled {
  static constexpr Kind kKind = Kind::kSettled;
  std::uint8_t target = 0;
  static constexpr auto schema() {
    return protocol::fields(protocol::field("target", &Settled::target, "", "what is in place"));
  }
};

struct Fault {
  static constexpr Kind kKind = Kind::kFault;
  std::uint8_t command = 0;  ///< Kind of what was refused.
  std::uint32_t number = 0;  ///< Of the trigger, else 0.
  static constexpr auto schema() {
    return protocol::fields(protocol::field("command", &Fault::command, "", "kind that was refused"),
                            protocol::field("number", &Fault::number, "", "of the trigger, else 0"));
  }
};

}  // namespace scatter::firmware::backplane
