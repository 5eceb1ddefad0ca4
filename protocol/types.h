// Value types that several messages share.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/bounded.h"
#include "protocol/field.h"

namespace scatter::protocol {

inline constexpr std::size_t kMaxIlluminations = 32;
inline constexpr std::size_t kMaxExposures = 16;

/// First 16 bytes of the SHA-256 that names a calibration; all zero = none.
using CalibrationId = std::array<std::uint8_t, 16>;

/// What the sensor looks at while a frame is taken.
enum class FrameKind : std::uint8_t {
  kLight = 0,    ///< LED on, sample in place.
  kAmbient = 1,  ///< LED off, sample in place.
  kDark = 2,     ///< LED off, dark cap in place.
};

/// What lies under the instrument during a run.
enum class Target : std::uint8_t {
  kSample = 0,
  kDarkCap = 1,
  kWhiteReference = 2,
  kBlackReference = 3,
  kTranslucentReference = 4,
};

/// PFNC names and values' order of bits: Mono16 little endian, Mono10p/Mono12p packed LSB first.
enum class PixelFormat : std::uint8_t { kMono16 = 0, kMono10p = 1, kMono12p = 2 };

enum class ExposureMode : std::uint8_t {
  kFixed = 0,  ///< Every illumination gets every exposure of the list.
  kAuto = 1,   ///< The device chooses per illumination within the time budget.
};

/// Bits of FrameEnd::flags.
enum FrameFlags : std::uint16_t {
  kFrameMonitorLow = 1U << 0U,      ///< Monitor under 10 % of nominal with the LED on: dead LED or cable.
  kFrameTestPattern = 1U << 1U,     ///< Counter pattern instead of pixels.
  kFrameHeldForCredit = 1U << 2U,   ///< The exposure waited for the host's credit.
  kFrameTemperatureOut = 1U << 3U,  ///< A thermometer is outside the descriptor's range.
};

/// exposed = delivered + lost_sensor + lost_firmware + lost_link + lost_host + corrupt, in frames.
/// The device fills the first and the two losses it can see; the host completes the rest.
struct Ledger {
  std::uint64_t exposed = 0;
  std::uint64_t delivered = 0;
  std::uint64_t lost_sensor = 0;    ///< Exposed, never read out (readout fault).
  std::uint64_t lost_firmware = 0;  ///< Read out, dropped by the device (live preview without credit, abort).
  std::uint64_t lost_link = 0;      ///< Sent whole, arrived in part or not at all.
  std::uint64_t lost_host = 0;      ///< Arrived whole, dropped by the host.
  std::uint64_t corrupt = 0;        ///< Arrived whole, checksum or metadata wrong.

  /// Adds the frames of another run.
  constexpr Ledger& operator+=(const Ledger& other) noexcept {
    exposed += other.exposed;
    delivered += other.delivered;
    lost_sensor += other.lost_sensor;
    lost_firmware += other.lost_firmware;
    lost_link += other.lost_link;
    lost_host += other.lost_host;
    corrupt += other.corrupt;
    return *this;
  }
  [[nodiscard]] constexpr bool balances() const noexcept {
    return exposed == delivered + lost_sensor + lost_firmware + lost_link + lost_host + corrupt;
  }
  static constexpr auto schema() {
    return fields(field("exposed", &Ledger::exposed, "frames", "exposures made"),
                  field("delivered", &Ledger::delivered, "frames", "frames handed to the user"),
                  field("lost_sensor", &Ledger::lost_sensor, "frames", "exposed, never read out"),
                  field("lost_firmware", &Ledger::lost_firmware, "frames", "dropped by the device"),
                  field("lost_link", &Ledger::lost_link, "frames", "sent, arrived in part or not at all"),
                  field("lost_host", &Ledger::lost_host, "frames", "arrived, dropped by the host"),
                  field("corrupt", &Ledger::corrupt, "frames", "arrived, contents wrong"));
  }
  friend constexpr bool operator==(const Ledger&, const Ledger&) noexcept = default;
};

/// What to measure: illuminations x exposures x repeats, with LED-off frames between.
///
/// Order of a run: repeats outermost (sweep 1 over all illuminations, then sweep 2, ...), so that
/// repeated frames of one illumination lie far apart in time and show drift or a moving sample.
/// The LED-off frames come at the start of each sweep.
struct Recipe {
  BoundedArray<std::uint8_t, kMaxIlluminations> illuminations{};  ///< Indices into the descriptor's list.
  BoundedArray<std::uint32_t, kMaxExposures> exposures_us{};  ///< kFixed: all; kAuto: first = probe exposure.
  ExposureMode exposure_mode = ExposureMode::kFixed;
  std::uint8_t max_brackets = 4;      ///< kAuto: at most this many exposures per illumination and sweep.
  std::uint16_t repeats = 1;          ///< Sweeps.
  std::uint8_t off_frames = 0;        ///< LED-off frames at the start of each sweep; kind from `target`.
  std::uint32_t off_exposure_us = 0;  ///< Exposure of the LED-off frames; 0 = the longest used so far.
  std::uint32_t time_budget_us = 0;   ///< kAuto: the whole run ends within this time on the device's clock.
  std::uint16_t region_x = 0;         ///< Window on the sensor, pixels.
  std::uint16_t region_y = 0;
  std::uint16_t region_width = 0;   ///< 0 = full width.
  std::uint16_t region_height = 0;  ///< 0 = full height.
  PixelFormat pixel_format = PixelFormat::kMono16;
  Target target = Target::kSample;
  std::uint8_t live_preview = 0;  ///< 1: drop whole frames without credit; 0: hold the exposure.
  std::uint8_t test_pattern = 0;  ///< 1: counter pattern instead of pixels.

  static constexpr auto schema() {
    return fields(
        field("illuminations", &Recipe::illuminations, "", "indices into the descriptor's illumination list"),
        field("exposures_us", &Recipe::exposures_us, "us", "fixed: every one; auto: the first is the probe"),
        field("exposure_mode", &Recipe::exposure_mode, "", "0 fixed, 1 auto"),
        field("max_brackets", &Recipe::max_brackets, "", "auto: most exposures per illumination and sweep"),
        field("repeats", &Recipe::repeats, "", "sweeps over all illuminations"),
        field("off_frames", &Recipe::off_frames, "frames", "LED-off frames at the start of each sweep"),
        field("off_exposure_us", &Recipe::off_exposure_us, "us", "their exposure; 0 = the longest so far"),
        field("time_budget_us", &Recipe::time_budget_us, "us", "auto: the run ends within this time"),
        field("region_x", &Recipe::region_x, "px", "window, left"),
        field("region_y", &Recipe::region_y, "px", "window, top"),
        field("region_width", &Recipe::region_width, "px", "window width, 0 = all"),
        field("region_height", &Recipe::region_height, "px", "window height, 0 = all"),
        field("pixel_format", &Recipe::pixel_format, "", "0 Mono16, 1 Mono10p, 2 Mono12p"),
        field("target", &Recipe::target, "", "what lies under the instrument"),
        field("live_preview", &Recipe::live_preview, "", "1: drop without credit, 0: hold"),
        field("test_pattern", &Recipe::test_pattern, "", "1: counter pattern"));
  }
  friend constexpr bool operator==(const Recipe&, const Recipe&) noexcept = default;
};

/// What the device remembers of a calibration; the frames live with the host.
struct CalibrationManifest {
  CalibrationId id{};                     ///< First 16 bytes of the SHA-256 of the calibration recording.
  Target kind = Target::kWhiteReference;  ///< Dark cap, white, black or translucent reference.
  std::uint32_t sequence = 0;             ///< Device's own count of commits; rises by one.
  std::uint64_t unix_time_s = 0;          ///< Host's clock at commit; 0 = unknown.
  std::uint64_t device_time_us = 0;       ///< Device's clock at commit, this boot.
  std::uint32_t boot_count = 0;           ///< Boot in which device_time_us counts.
  std::int32_t sensor_temperature_mK = 0;
  std::int32_t led_temperature_mK = 0;
  BoundedString<48> certificate_id{};  ///< Which certificate the reference has; "" for dark.
  BoundedArray<float, 6> scalars{};    ///< Mean reference level per colour [e-/s], for information.

  static constexpr auto schema() {
    using M = CalibrationManifest;
    return fields(field("id", &M::id, "", "first 16 bytes of the calibration's SHA-256"),
                  field("kind", &M::kind, "", "1 dark cap, 2 white, 3 black, 4 translucent"),
                  field("sequence", &M::sequence, "", "count of commits"),
                  field("unix_time_s", &M::unix_time_s, "s", "host's clock at commit, 0 = unknown"),
                  field("device_time_us", &M::device_time_us, "us", "device's clock at commit"),
                  field("boot_count", &M::boot_count, "", "boot in which device_time_us counts"),
                  field("sensor_temperature_mK", &M::sensor_temperature_mK, "mK", "at commit"),
                  field("led_temperature_mK", &M::led_temperature_mK, "mK", "at commit"),
                  field("certificate_id", &M::certificate_id, "", "reference certificate"),
                  field("scalars", &M::scalars, "e-/s", "mean reference level per colour"));
  }
  friend constexpr bool operator==(const CalibrationManifest&, const CalibrationManifest&) noexcept = default;
};

}  // namespace scatter::protocol
