// A board over virtual time for the firmware's tests: every port written by hand, nothing of the
// simulator. The scene is a picture per illumination in DN per microsecond, so that expected pixel
// values follow from the exposure by one multiplication.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "firmware/ports/ports.h"

namespace scatter::firmware::fake {

inline constexpr std::uint16_t kWidth = 64;
inline constexpr std::uint16_t kHeight = 48;
inline constexpr std::uint32_t kReadoutUs = 16'000;
inline constexpr std::uint16_t kBlack = 16;
inline constexpr std::uint16_t kLastCode = 1023;

struct FakeClock final : Clock {
  std::uint64_t time_us = 1;
  std::uint64_t now_us() noexcept override { return time_us; }
};

struct FakeLink final : Link {
  std::deque<std::byte> to_device;
  std::vector<std::byte> to_host;
  std::size_t capacity = 64 * 1024;  ///< Of to_host: back-pressure.
  std::size_t most_per_write = 64 * 1024;
  bool attached = true;

  std::size_t read(std::span<std::byte> out) noexcept override {
    const std::size_t count = std::min(out.size(), to_device.size());
    std::copy_n(to_device.begin(), count, out.begin());
    to_device.erase(to_device.begin(), to_device.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
  std::size_t write(std::span<const std::byte> bytes) noexcept override {
    if (!attached) {
      return bytes.size();
    }
    const std::size_t room = capacity - std::min(capacity, to_host.size());
    const std::size_t count = std::min({bytes.size(), room, most_per_write});
    to_host.insert(to_host.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
  bool connected() noexcept override { return attached; }
};

struct FakeFlash final : Flash {
  static constexpr std::uint32_t kUnit = 4096;
  static constexpr std::uint32_t kUnits = 4;
  std::vector<std::byte> cells = std::vector<std::byte>(std::size_t{kUnit} * kUnits, std::byte{0xFF});
  std::uint32_t violations = 0;  ///< Programmed cells that were not erased, or out of bounds.
  std::uint32_t operations = 0;
  std::uint32_t fail_after = 0xFFFF'FFFF;  ///< Operations from here on fail without effect.

  Geometry geometry() noexcept override { return {kUnit, kUnits, 8}; }
  bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
    if (offset + out.size() > cells.size()) {
      ++violations;
      return false;
    }
    std::copy_n(cells.begin() + offset, out.size(), out.begin());
    return true;
  }
  bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
    if (operations++ >= fail_after) {
      return false;
    }
    if (offset % 8 != 0 || bytes.size() % 8 != 0 || offset + bytes.size() > cells.size()) {
      ++violations;
      return false;
    }
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      violations += cells[offset + i] == std::byte{0xFF} ? 0U : 1U;
      cells[offset + i] &= bytes[i];
    }
    return true;
  }
  bool erase(std::uint32_t unit) noexcept override {
    if (operations++ >= fail_after) {
      return false;
    }
    std::fill_n(cells.begin() + unit * kUnit, kUnit, std::byte{0xFF});
    return true;
  }
};

/// DN per microsecond at a pixel under an illumination (Illuminator::kNone = off).
using Scene = std::function<float(std::uint8_t illumination, std::uint32_t x, std::uint32_t y)>;

struct FakeOptics final : Sensor, Illuminator, Monitor, Thermometer {
  explicit FakeOptics(FakeClock& its_clock) : clock(its_clock) {}
  FakeClock& clock;
  Scene scene = [](std::uint8_t led, std::uint32_t, std::uint32_t) { return led == kNone ? 0.F : 0.01F; };
  std::vector<std::uint16_t> pixels;
  SensorSettings settings;
  std::uint64_t triggered_us = 0;
  bool busy = false;
  bool broken = false;           ///< Exposures never finish.
  std::uint32_t fail_reads = 0;  ///< Next calls of read_rows that fail.
  std::uint8_t lit = kNone;
  std::uint8_t dead_led = 0xFE;
  std::uint32_t last_monitor_uv = 0;
  std::int32_t temperature_mK = 298'150;
  std::uint32_t triggers = 0;
  std::uint32_t releases = 0;

  [[nodiscard]] std::uint64_t done_us() const { return triggered_us + settings.exposure_us + kReadoutUs; }

  bool trigger(const SensorSettings& wanted) noexcept override {
    if (busy) {
      return false;
    }
    settings = wanted;
    triggered_us = clock.time_us;
    busy = true;
    ++triggers;
    const std::uint8_t seen = lit == dead_led ? kNone : lit;
    last_monitor_uv = seen == kNone ? 0 : 500'000;
    pixels.resize(std::size_t{wanted.width} * wanted.height);
    for (std::uint32_t y = 0; y < wanted.height; ++y) {
      for (std::uint32_t x = 0; x < wanted.width; ++x) {
        const float dn = static_cast<float>(kBlack) +
                         scene(seen, x + wanted.x, y + wanted.y) * static_cast<float>(wanted.exposure_us);
        pixels[y * wanted.width + x] =
            static_cast<std::uint16_t>(std::clamp(std::round(dn), 0.F, static_cast<float>(kLastCode)));
      }
    }
    return true;
  }
  SensorState state() noexcept override {
    if (!busy) {
      return SensorState::kIdle;
    }
    return !broken && clock.time_us >= done_us() ? SensorState::kReady : SensorState::kExposing;
  }
  std::uint64_t ready_at_us() noexcept override { return busy && !broken ? done_us() : 0; }
  bool read_rows(std::uint16_t first, std::uint16_t count, std::span<std::uint16_t> out) noexcept override {
    if (fail_reads > 0) {
      --fail_reads;
      return false;
    }
    std::copy_n(pixels.begin() + std::ptrdiff_t{first} * settings.width, std::size_t{count} * settings.width,
                out.begin());
    return true;
  }
  void release() noexcept override {
    busy = false;
    ++releases;
  }
  bool light(std::uint8_t illumination) noexcept override {
    lit = illumination;
    return true;
  }
  std::uint32_t reading_uv() noexcept override { return last_monitor_uv; }
  std::int32_t sensor_mK() noexcept override { return temperature_mK; }
  std::int32_t led_board_mK() noexcept override { return temperature_mK; }
};

struct FakeStage final : ReferenceStage {
  explicit FakeStage(FakeClock& its_clock) : clock(its_clock) {}
  FakeClock& clock;
  std::uint64_t settled_us = 0;
  std::optional<protocol::Target> at;
  std::uint32_t moves = 0;
  bool move_to(protocol::Target target) noexcept override {
    if (target == protocol::Target::kTranslucentReference) {
      return false;
    }
    at = target;
    settled_us = clock.time_us + 300'000;
    ++moves;
    return true;
  }
  bool moving() noexcept override { return clock.time_us < settled_us; }
  std::uint64_t settled_at_us() noexcept override { return settled_us; }
};

struct FakeHousekeeping final : Watchdog, Reset {
  std::uint32_t kicks = 0;
  std::uint32_t reboots = 0;
  void kick() noexcept override { ++kicks; }
  void reboot() noexcept override { ++reboots; }
  protocol::ResetReason why = protocol::ResetReason::kPowerOn;
  protocol::FaultRecord crash;
  protocol::ResetReason reason() noexcept override { return why; }
  protocol::FaultRecord fault_record() noexcept override { return crash; }
};

struct FakeFactory final : Factory {
  protocol::Descriptor data;
  std::vector<std::byte> hot_pixels;
  FakeFactory() {
    data.product = "HS-1 test";
    data.serial = "T0001";
    data.hardware_revision = "A";
    protocol::SensorInfo& s = data.sensor;
    s.width_px = kWidth;
    s.height_px = kHeight;
    s.bits = 10;
    s.min_exposure_us = 10;
    s.max_exposure_us = 200'000;
    s.readout_us = kReadoutUs;
    s.gain_e_per_dn = 10;
    s.full_well_e = 20'000;  // The ADC saturates first.
    s.black_level_dn = kBlack;
    data.dark_lifetime_s = 1800;
    data.reference_lifetime_s = 3600;
    data.calibration_span_mK = 3000;
    for (std::uint8_t head = 0; head < 4; ++head) {
      for (std::uint8_t channel = 0; channel < 3; ++channel) {
        protocol::Illumination led;
        led.theta_rad = 0.35F * static_cast<float>(head);
        led.head = head;
        led.channel = channel;
        data.illuminations.push_back(led);
      }
    }
    for (const auto kind : {protocol::Target::kWhiteReference, protocol::Target::kBlackReference}) {
      protocol::ReferenceCertificate certificate;
      certificate.kind = kind;
      certificate.id = "R-1";
      data.certificates.push_back(certificate);
    }
  }
  void add_hot_pixel(std::uint32_t x, std::uint32_t y) {
    const std::uint32_t index = y * kWidth + x;
    for (int shift = 0; shift < 32; shift += 8) {
      hot_pixels.push_back(static_cast<std::byte>((index >> shift) & 0xFFU));
    }
  }
  const protocol::Descriptor& descriptor() noexcept override { return data; }
  std::span<const std::byte> object(protocol::ObjectId id) noexcept override {
    return id == protocol::ObjectId::kHotPixels ? std::span<const std::byte>(hot_pixels)
                                                : std::span<const std::byte>();
  }
};

struct FakeBoard {
  FakeClock clock;
  FakeLink link;
  FakeOptics optics{clock};
  FakeHousekeeping keeper;
  FakeFlash flash;
  FakeFactory factory;
  FakeStage stage{clock};
  bool with_stage = false;
  ImageSlots* image_slots = nullptr;
  Verifier* verifier = nullptr;

  [[nodiscard]] Ports ports() {
    return {.clock = clock,
            .link = link,
            .sensor = optics,
            .illuminator = optics,
            .monitor = optics,
            .thermometer = optics,
            .watchdog = keeper,
            .reset = keeper,
            .flash = flash,
            .factory = factory,
            .reference_stage = with_stage ? &stage : nullptr,
            .image_slots = image_slots,
            .verifier = verifier};
  }
};

}  // namespace scatter::firmware::fake
