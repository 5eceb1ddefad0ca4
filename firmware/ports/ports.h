// What the firmware needs from a board. A board (or the simulator) implements these and hands
// references to firmware/core; nothing else connects the two.
//
// All calls are non-blocking unless said otherwise, are made from the main loop only, and never
// allocate. Time exists only through Clock, so that virtual time is exact.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocol/frame.h"
#include "protocol/image_header.h"
#include "protocol/link_decoder.h"
#include "protocol/messages.h"
#include "protocol/types.h"

namespace scatter::firmware {

/// Monotonic time since boot.
class Clock {
 public:
  [[nodiscard]] virtual std::uint64_t now_us() noexcept = 0;

 protected:
  ~Clock() = default;
};

/// The carrier to the host: a byte pipe in each direction.
class Link {
 public:
  /// Takes up to out.size() received bytes; 0 = none waiting.
  [[nodiscard]] virtual std::size_t read(std::span<std::byte> out) noexcept = 0;
  /// Takes as many of `bytes` as the carrier has room for now (may be 0); the rest stays with the caller.
  [[nodiscard]] virtual std::size_t write(std::span<const std::byte> bytes) noexcept = 0;
  /// The bytes written so far end a wire frame: a carrier that moves packets can end its transfer here.
  virtual void end_frame() noexcept {}
  /// Every byte written was taken by the host, as far as the carrier knows: it may go away without loss.
  [[nodiscard]] virtual bool drained() noexcept { return true; }
  /// False when no host is attached; bytes written then are discarded.
  [[nodiscard]] virtual bool connected() noexcept = 0;
  /// Longest payload of a wire frame on this carrier [B].
  [[nodiscard]] virtual std::uint32_t max_payload() noexcept { return protocol::kMaxPayload; }
  /// What a carrier that checks frames itself has dropped since boot; null: it passes on every byte.
  [[nodiscard]] virtual const protocol::LinkCounters* dropped() noexcept { return nullptr; }

 protected:
  ~Link() = default;
};

struct SensorSettings {
  std::uint16_t x = 0, y = 0, width = 0, height = 0;  ///< Window, pixels.
  std::uint32_t exposure_us = 0;
};

enum class SensorState : std::uint8_t { kIdle, kExposing, kReady, kFault };

/// The image sensor. One exposure at a time: trigger -> kExposing -> kReady -> read_rows... -> release.
class Sensor {
 public:
  /// Starts an exposure now. False when the settings are refused or one is under way.
  [[nodiscard]] virtual bool trigger(const SensorSettings& settings) noexcept = 0;
  [[nodiscard]] virtual SensorState state() noexcept = 0;
  /// Device time at which state() will change by itself; 0 = unknown or idle. Lets the loop sleep.
  [[nodiscard]] virtual std::uint64_t ready_at_us() noexcept = 0;
  /// Copies `count` rows of the window starting at `first` (0-based in the window), u16 per pixel in
  /// DN. Only in kReady; rows are read in rising order, once each. False = readout fault.
  [[nodiscard]] virtual bool read_rows(std::uint16_t first, std::uint16_t count,
                                       std::span<std::uint16_t> out) noexcept = 0;
  /// Gives the frame back (or cancels an exposure under way); then kIdle.
  virtual void release() noexcept = 0;

 protected:
  ~Sensor() = default;
};

/// The LEDs. At most one is lit.
class Illuminator {
 public:
  static constexpr std::uint8_t kNone = 0xFF;
  /// Lights one illumination of the descriptor's list, or none. False = no such LED.
  [[nodiscard]] virtual bool light(std::uint8_t illumination) noexcept = 0;

 protected:
  ~Illuminator() = default;
};

/// Photodiode that watches the LEDs.
class Monitor {
 public:
  /// Mean reading over the last finished exposure [uV].
  [[nodiscard]] virtual std::uint32_t reading_uv() noexcept = 0;

 protected:
  ~Monitor() = default;
};

class Thermometer {
 public:
  [[nodiscard]] virtual std::int32_t sensor_mK() noexcept = 0;
  [[nodiscard]] virtual std::int32_t led_board_mK() noexcept = 0;

 protected:
  ~Thermometer() = default;
};

class Watchdog {
 public:
  virtual void kick() noexcept = 0;

 protected:
  ~Watchdog() = default;
};

class Reset {
 public:
  /// Restarts the device. Returns on boards that restart a moment later (the simulator).
  virtual void reboot() noexcept = 0;
  [[nodiscard]] virtual protocol::ResetReason reason() noexcept = 0;
  /// Snapshot of the last crash since power-on, kept through resets; present == 0: none.
  [[nodiscard]] virtual protocol::FaultRecord fault_record() noexcept { return {}; }

 protected:
  ~Reset() = default;
};

/// Non-volatile memory in erase units. Programming turns 1 bits to 0 only; erase gives 0xFF.
class Flash {
 public:
  struct Geometry {
    std::uint32_t unit_bytes = 0;  ///< Erase unit.
    std::uint32_t units = 0;
    std::uint32_t program_bytes = 0;  ///< Program granule; offsets and lengths are multiples of it.
  };
  [[nodiscard]] virtual Geometry geometry() noexcept = 0;
  /// False = the cells cannot be read (torn or worn). Offsets count from the start of the region.
  [[nodiscard]] virtual bool read(std::uint32_t offset, std::span<std::byte> out) noexcept = 0;
  [[nodiscard]] virtual bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept = 0;
  [[nodiscard]] virtual bool erase(std::uint32_t unit) noexcept = 0;

 protected:
  ~Flash() = default;
};

/// Factory data, written once at production: descriptor, hot pixels, PRNU map.
class Factory {
 public:
  [[nodiscard]] virtual const protocol::Descriptor& descriptor() noexcept = 0;
  /// Memory-mapped bytes of an object; empty = not present. kDescriptor is served by the core.
  [[nodiscard]] virtual std::span<const std::byte> object(protocol::ObjectId id) noexcept = 0;

 protected:
  ~Factory() = default;
};

/// Optional motorised stage that brings the sample or a reference under the instrument.
class ReferenceStage {
 public:
  /// Starts moving. False = no such target on this stage.
  [[nodiscard]] virtual bool move_to(protocol::Target target) noexcept = 0;
  [[nodiscard]] virtual bool moving() noexcept = 0;
  /// Device time at which moving() becomes false; 0 = unknown.
  [[nodiscard]] virtual std::uint64_t settled_at_us() noexcept = 0;

 protected:
  ~ReferenceStage() = default;
};

/// Two equal places for firmware images, each a Flash of its own whose offset 0 is the slot's start; see
/// protocol/image_header.h. Code runs in place from one of them. Absent on boards without update.
class ImageSlots {
 public:
  static constexpr std::uint8_t kCount = 2;
  /// `index` is 0 or 1.
  [[nodiscard]] virtual Flash& slot(std::uint8_t index) noexcept = 0;
  /// Address at which the slot is mapped for execution.
  [[nodiscard]] virtual std::uint32_t address(std::uint8_t index) noexcept = 0;
  /// The slot that this code runs from; kCount in the bootloader.
  [[nodiscard]] virtual std::uint8_t running() noexcept = 0;

 protected:
  ~ImageSlots() = default;
};

/// Cryptography for firmware images (libsodium): Ed25519 signatures and SHA-512. Absent on boards
/// without update.
class Verifier {
 public:
  /// True when `signature` over `message` was made by the trusted key with this id. A release build
  /// trusts no test key.
  [[nodiscard]] virtual bool verify(std::span<const std::byte> message, const protocol::Signature& signature,
                                    const protocol::KeyId& key) noexcept = 0;
  /// One SHA-512 at a time: begin, add any number of times, end.
  virtual void hash_begin() noexcept = 0;
  virtual void hash_add(std::span<const std::byte> bytes) noexcept = 0;
  [[nodiscard]] virtual protocol::Sha512 hash_end() noexcept = 0;

 protected:
  ~Verifier() = default;
};

/// The measure button. Optional.
class Button {
 public:
  /// Presses since boot, bounces not counted.
  [[nodiscard]] virtual std::uint32_t presses() noexcept = 0;

 protected:
  ~Button() = default;
};

/// Everything a board gives. Pointers may be null where said optional; all outlive the core.
struct Ports {
  Clock& clock;
  Link& link;
  Sensor& sensor;
  Illuminator& illuminator;
  Monitor& monitor;
  Thermometer& thermometer;
  Watchdog& watchdog;
  Reset& reset;
  Flash& flash;
  Factory& factory;
  ReferenceStage* reference_stage = nullptr;  ///< Optional.
  ImageSlots* image_slots = nullptr;          ///< Optional: no update without both of these.
  Verifier* verifier = nullptr;
  Button* button = nullptr;                         ///< Optional.
  std::string_view build_id = "openscatter 0.1.0";  ///< Firmware version in HELLO, at most 32 bytes.
};

}  // namespace scatter::firmware
