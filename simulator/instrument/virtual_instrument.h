// The instrument's twin: the real firmware core on the virtual board, driven through its link.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "host_sdk/error/error.h"
#include "simulator/instrument/instrument_options.h"

namespace scatter::firmware {
class Instrument;
class Rescue;
struct Ports;
struct Step;
}  // namespace scatter::firmware

namespace scatter::simulator {

class Sample;
class UsbFirmware;
class UsbPort;
class VirtualBoard;

/// One simulated instrument and its carrier's host end. Carrier::kPipe: attach(), host_write(), host_read(),
/// run_until() and what goes with them, which do nothing over USB; Carrier::kUsb: usb(), with run_ready() and
/// advance_to().
///
/// Time      Virtual clock: moves only inside run_until(), from event to event; while the host is busy
///           it stands still. Real clock: moves by itself; the owner calls run_ready() often enough.
/// Repeats   Virtual clock: the same calls give the same bytes and times, always.
/// Threads   one at a time.
class VirtualInstrument {
 public:
  /// Power on. Errors: see VirtualBoard::make.
  [[nodiscard]] static Result<std::unique_ptr<VirtualInstrument>> make(const InstrumentOptions& options);
  ~VirtualInstrument();
  VirtualInstrument(const VirtualInstrument&) = delete;
  VirtualInstrument& operator=(const VirtualInstrument&) = delete;

  /// The USB socket; null for Carrier::kPipe. After submit() and its like, run_ready() lets the device
  /// answer.
  [[nodiscard]] UsbPort* usb() noexcept;
  /// Presses the measure button once.
  void press_button() noexcept;

  /// Plugs the host in; what an earlier host left on the way is gone.
  void attach();
  /// Pulls the plug. The firmware notices before time goes on.
  void detach();
  /// False after detach(), a fault that breaks the link, or a restart of the device: attach again.
  /// After a restart, what the device had sent before can still be read.
  [[nodiscard]] bool attached() const noexcept;

  /// Takes as many bytes as the carrier has room for, maybe none: then run and try again.
  [[nodiscard]] std::size_t host_write(std::span<const std::byte> bytes);
  /// Gives the bytes that are there, maybe none.
  [[nodiscard]] std::size_t host_read(std::span<std::byte> out);
  [[nodiscard]] std::size_t readable();
  [[nodiscard]] std::size_t writable();

  /// Does everything that can be done at this moment, up to a change of what is plugged in where.
  /// Result    when there will be more to do without the host, on now_us()'s scale; at most 1 s ahead.
  std::uint64_t run_ready();
  /// What the host waits for.
  enum class Until : std::uint8_t { kReadable, kWritable };
  /// Runs until bytes wait for the host (or there is room for its bytes), the link breaks, or
  /// now_us() reaches time_us. Real clock: sleeps in between, at most `slice_us` in all.
  void run_until(std::uint64_t time_us, Until until = Until::kReadable, std::uint64_t slice_us = 10'000);

  /// Virtual clock: time moves on to `time_us` without anything happening in between.
  void advance_to(std::uint64_t time_us) noexcept;

  /// Time since power-on; does not start again when the device restarts.
  [[nodiscard]] std::uint64_t now_us() const noexcept;
  /// 2026-01-01T00:00:00Z at power-on, then with now_us().
  [[nodiscard]] std::uint64_t unix_time_us() const noexcept { return kPowerOnUnixUs + now_us(); }
  [[nodiscard]] ClockMode clock_mode() const noexcept;

  /// What lies under the instrument.
  [[nodiscard]] std::shared_ptr<const Sample> sample() const noexcept;
  /// Takes it away and puts another one there. Errors: kFailedPrecondition when one of them transmits and the
  /// other does not.
  [[nodiscard]] Status put(std::shared_ptr<const Sample> sample);

  /// The parts, for tests and for whoever wants to look inside.
  [[nodiscard]] VirtualBoard& board() noexcept { return *board_; }

 private:
  explicit VirtualInstrument(std::unique_ptr<VirtualBoard> board);
  void start_firmware();
  [[nodiscard]] firmware::Step poll_firmware();
  /// Changes whenever the host has to look at its end anew.
  [[nodiscard]] std::uint64_t attachment() const noexcept;
  void restart_if_wanted();
  void age_calibrations();
  void age_calibration(bool host_has_all);

  bool ages_calibrations_ = false;  ///< calibration=stale
  bool references_used_ = false;
  std::uint64_t asleep_until_us_ = 0;  ///< Between a restart and the firmware's first turn, over USB.
  std::unique_ptr<VirtualBoard> board_;
  std::unique_ptr<UsbFirmware> usb_;  ///< Carrier::kUsb; made anew at each boot.
  std::unique_ptr<firmware::Ports> ports_;
  std::unique_ptr<firmware::Instrument> core_;
  std::unique_ptr<firmware::Rescue> rescue_;  ///< Instead of core_ when no image could be started; kPipe.
};

}  // namespace scatter::simulator
