// The smallest board: every port that the firmware needs, in memory, with the firmware on top and the
// conformance suite as its judge. A port to hardware begins as a copy of this in firmware/boards/NAME;
// docs/porting.md says what takes the place of each class.
#include <algorithm>
#include <array>
#include <cstdio>
#include <deque>
#include <memory>
#include <optional>

#include "firmware/core/instrument.h"
#include "host_sdk/device/conformance/conformance.h"

namespace {

using namespace scatter;

constexpr std::uint16_t kSide = 64;
constexpr std::uint32_t kReadoutUs = 2000;
constexpr std::uint16_t kBlack = 32;

/// On hardware a timer; here time passes only when the host waits.
class BoardClock final : public firmware::Clock {
 public:
  std::uint64_t now_us() noexcept override { return time_us; }
  std::uint64_t time_us = 0;
};

/// On hardware USB endpoints; here two queues.
class BoardLink final : public firmware::Link {
 public:
  std::size_t read(std::span<std::byte> out) noexcept override { return take(to_device, out); }
  std::size_t write(std::span<const std::byte> bytes) noexcept override {
    to_host.insert(to_host.end(), bytes.begin(), bytes.end());
    return bytes.size();
  }
  bool connected() noexcept override { return plugged; }

  static std::size_t take(std::deque<std::byte>& from, std::span<std::byte> out) {
    const std::size_t count = std::min(out.size(), from.size());
    std::copy_n(from.begin(), count, out.begin());
    from.erase(from.begin(), from.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
  std::deque<std::byte> to_device, to_host;
  bool plugged = false;
};

/// On hardware the sensor with its DMA, the LED drivers and the photodiode: they share the exposure.
class BoardOptics final : public firmware::Sensor, public firmware::Illuminator, public firmware::Monitor {
 public:
  BoardOptics(BoardClock& clock, std::size_t leds) : clock_(clock), leds_(leds) {}

  bool trigger(const firmware::SensorSettings& settings) noexcept override {
    if (state() != firmware::SensorState::kIdle || settings.x + settings.width > kSide ||
        settings.y + settings.height > kSide) {
      return false;
    }
    window_ = settings;
    exposing_ = true;
    exposed_lit_ = lit_ != kNone;
    ready_at_us_ = clock_.now_us() + settings.exposure_us + kReadoutUs * settings.height / kSide;
    return true;
  }
  firmware::SensorState state() noexcept override {
    if (!exposing_) {
      return firmware::SensorState::kIdle;
    }
    return clock_.now_us() < ready_at_us_ ? firmware::SensorState::kExposing : firmware::SensorState::kReady;
  }
  std::uint64_t ready_at_us() noexcept override { return exposing_ ? ready_at_us_ : 0; }
  bool read_rows(std::uint16_t first, std::uint16_t count, std::span<std::uint16_t> out) noexcept override {
    const std::uint32_t light = exposed_lit_ ? window_.exposure_us / 50 : 0;
    for (std::size_t k = 0; k < out.size(); ++k) {
      const std::size_t row = window_.y + first + k / window_.width;
      out[k] = static_cast<std::uint16_t>(std::min<std::size_t>(kBlack + light + row % 4, 1023));
    }
    return out.size() == std::size_t{count} * window_.width;
  }
  void release() noexcept override { exposing_ = false; }

  bool light(std::uint8_t illumination) noexcept override {
    if (illumination != kNone && illumination >= leds_) {
      return false;
    }
    lit_ = illumination;
    return true;
  }
  std::uint32_t reading_uv() noexcept override { return exposed_lit_ ? 500'000 : 40; }

 private:
  BoardClock& clock_;
  std::size_t leds_;
  firmware::SensorSettings window_;
  std::uint8_t lit_ = kNone;
  bool exposing_ = false;
  bool exposed_lit_ = false;
  std::uint64_t ready_at_us_ = 0;
};

class BoardThermometer final : public firmware::Thermometer {
 public:
  std::int32_t sensor_mK() noexcept override { return 298'150; }
  std::int32_t led_board_mK() noexcept override { return 299'150; }
};

class BoardWatchdog final : public firmware::Watchdog {
 public:
  void kick() noexcept override {}
};

class BoardReset final : public firmware::Reset {
 public:
  void reboot() noexcept override { wanted = true; }
  protocol::ResetReason reason() noexcept override { return last; }
  bool wanted = false;
  protocol::ResetReason last = protocol::ResetReason::kPowerOn;
};

/// On hardware an FRAM, EEPROM or flash with small erase units: 8 units of 4 KiB here.
class BoardFlash final : public firmware::Flash {
 public:
  BoardFlash() { cells_.fill(std::byte{0xFF}); }
  Geometry geometry() noexcept override { return {.unit_bytes = kUnit, .units = kUnits, .program_bytes = 8}; }
  bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
    std::copy_n(cells_.begin() + offset, out.size(), out.begin());
    return true;
  }
  bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
    std::transform(bytes.begin(), bytes.end(), cells_.begin() + offset, cells_.begin() + offset,
                   [](std::byte fresh, std::byte cell) { return fresh & cell; });
    return true;
  }
  bool erase(std::uint32_t unit) noexcept override {
    std::fill_n(cells_.begin() + unit * kUnit, kUnit, std::byte{0xFF});
    return true;
  }

 private:
  static constexpr std::uint32_t kUnit = 4096;
  static constexpr std::uint32_t kUnits = 8;
  std::array<std::byte, std::size_t{kUnit} * kUnits> cells_{};
};

/// On hardware firmware/core/factory_set.h over flash that production wrote.
class BoardFactory final : public firmware::Factory {
 public:
  BoardFactory() {
    protocol::Descriptor& d = descriptor_;
    d.product = std::string_view("Smallest board");
    d.serial = std::string_view("0001");
    d.hardware_revision = std::string_view("A");
    d.sensor = {.width_px = kSide,
                .height_px = kSide,
                .bits = 10,
                .min_exposure_us = 30,
                .max_exposure_us = 200'000,
                .readout_us = kReadoutUs,
                .gain_e_per_dn = 30,
                .full_well_e = 28'000,
                .read_noise_e = 25,
                .black_level_dn = kBlack,
                .dark_current_e_per_s = 100,
                .dark_doubling_K = 8,
                .reference_temperature_mK = 298'150};
    d.optics = {.center_x_px = kSide / 2.0F,
                .center_y_px = kSide / 2.0F,
                .radius_px = 20,
                .a1 = 1,
                .theta_max_rad = 1.3F,
                .image_theta_max_rad = 1.5F};
    d.spot_diameter_mm = 4;
    d.dark_lifetime_s = 8 * 3600;
    d.reference_lifetime_s = 8 * 3600;
    d.calibration_span_mK = 4000;
    for (const std::uint8_t head : {std::uint8_t{0}, std::uint8_t{1}}) {
      d.illuminations.push_back({.theta_rad = 0.35F * static_cast<float>(head + 1),
                                 .wavelength_nm = 630,
                                 .fwhm_nm = 20,
                                 .angular_radius_rad = 0.02F,
                                 .head = head});
    }
  }
  const protocol::Descriptor& descriptor() noexcept override { return descriptor_; }
  std::span<const std::byte> object(protocol::ObjectId) noexcept override { return {}; }

 private:
  protocol::Descriptor descriptor_;
};

/// The composition root: all parts, and the firmware over them.
class Board {
 public:
  Board() { boot(); }

  /// The main loop until the host has something to read or `until_us`. On hardware: for ever, resting until
  /// Step::wake_at_us or an interrupt.
  void run(std::uint64_t until_us) {
    while (link.to_host.empty()) {
      const firmware::Step step = instrument_->poll();
      if (reset_.wanted) {
        reset_.last = protocol::ResetReason::kRequested;
        boot();
        return;
      }
      if (!step.did_work && clock.time_us >= until_us) {
        return;
      }
      if (!step.did_work) {
        clock.time_us = std::clamp(step.wake_at_us, clock.time_us + 1, std::max(until_us, clock.time_us + 1));
      }
    }
  }

  BoardClock clock;
  BoardLink link;

 private:
  void boot() {
    reset_.wanted = false;
    link.plugged = false;
    clock.time_us = 0;
    optics_.release();
    instrument_.emplace(ports_);  // Mounts the flash and counts the boot.
  }

  BoardFactory factory_;
  BoardOptics optics_{clock, factory_.descriptor().illuminations.size()};
  BoardThermometer thermometer_;
  BoardWatchdog watchdog_;
  BoardReset reset_;
  BoardFlash flash_;
  firmware::Ports ports_{.clock = clock,
                         .link = link,
                         .sensor = optics_,
                         .illuminator = optics_,
                         .monitor = optics_,
                         .thermometer = thermometer_,
                         .watchdog = watchdog_,
                         .reset = reset_,
                         .flash = flash_,
                         .factory = factory_,
                         .build_id = "smallest board 1"};
  std::optional<firmware::Instrument> instrument_;
};

/// The cable: what a host sees of the board. Plugging in is opening, pulling out is closing.
class Cable final : public device::Transport {
 public:
  explicit Cable(std::shared_ptr<Board> board) : board_(std::move(board)) {
    board_->link.to_host.clear();
    board_->link.to_device.clear();
    board_->link.plugged = true;
  }
  ~Cable() override { close(); }
  Result<std::span<const std::byte>> receive(device::TimePoint deadline,
                                             const std::stop_token& stop) override {
    if (!board_->link.plugged) {
      return fail(ErrorCode::kDisconnected, "the board restarted", "open it again");
    }
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "stopped", "start again");
    }
    const auto until = std::chrono::ceil<std::chrono::microseconds>(deadline.time_since_epoch()).count();
    board_->run(static_cast<std::uint64_t>(std::max<std::int64_t>(until, 0)));
    lent_.assign(board_->link.to_host.begin(), board_->link.to_host.end());
    board_->link.to_host.clear();
    if (lent_.empty()) {
      return fail(ErrorCode::kDeadlineExceeded, "nothing came", "allow more time");
    }
    return lent_;
  }
  Status write(std::span<const std::byte> bytes, device::TimePoint, const std::stop_token&) override {
    board_->link.to_device.insert(board_->link.to_device.end(), bytes.begin(), bytes.end());
    return {};
  }
  device::TimePoint now() const override {
    return device::TimePoint(std::chrono::microseconds(board_->clock.time_us));
  }
  std::uint64_t system_time_unix_ns() const override { return kStartNs + board_->clock.time_us * 1000; }
  void close() noexcept override {
    board_->link.plugged = false;
    board_->run(board_->clock.time_us);  // The firmware sees that the host is gone.
  }

 private:
  static constexpr std::uint64_t kStartNs = 1'767'225'600'000'000'000;
  std::shared_ptr<Board> board_;
  std::vector<std::byte> lent_;
};

}  // namespace

int main() {
  const auto board = std::make_shared<Board>();
  conformance::Options options;
  options.open = [&](const device::Wait&) -> Result<std::unique_ptr<device::Transport>> {
    return std::make_unique<Cable>(board);
  };
  options.write = true;
  const auto report = conformance::run(options);
  if (!report) {
    std::fprintf(stderr, "error: %s\nremedy: %s\n", report.error().what.c_str(),
                 report.error().remedy.c_str());
    return 1;
  }
  for (const conformance::Finding& finding : report->findings) {
    if (finding.verdict == conformance::Verdict::kFailed) {
      std::printf("%s: %s\n  look at: %s\n", finding.check.name.data(), finding.trouble.c_str(),
                  finding.check.look_at.data());
    }
  }
  std::printf("%zu passed, %zu failed, %zu skipped\n", report->count(conformance::Verdict::kPassed),
              report->count(conformance::Verdict::kFailed), report->count(conformance::Verdict::kSkipped));
  return report->passed() ? 0 : 1;
}
