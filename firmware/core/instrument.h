// The firmware of an instrument: everything that a board runs. A board implements the ports, makes one
// Instrument over them in static memory and calls poll() for ever.
//
//   Instrument instrument(ports);
//   for (;;) {
//     const Step step = instrument.poll();
//     if (!step.did_work) sleep_until(step.wake_at_us);  // or earlier, on link traffic
//   }
//
// No heap, no exceptions, no time but Clock's. RAM: sizeof(Instrument), about 112 KiB. One thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/acquisition.h"
#include "firmware/core/dispatcher.h"
#include "firmware/core/event_log.h"
#include "firmware/core/link_output.h"
#include "firmware/core/persistent_state.h"
#include "firmware/core/step.h"
#include "firmware/ports/ports.h"
#include "protocol/link_decoder.h"

namespace scatter::firmware {

class Instrument {
 public:
  /// Mounts the flash and counts the boot. `ports` and what it refers to must outlive the instrument.
  explicit Instrument(Ports& ports) noexcept;
  Instrument(const Instrument&) = delete;
  Instrument& operator=(const Instrument&) = delete;

  /// Does what can be done now, a bounded piece: some requests, at most one wire frame of pixels.
  /// Kicks the watchdog. Worst case on the bus side: one Link::read, the Link::writes that the carrier
  /// takes, one Sensor::read_rows; flash is touched only by calibration and settings requests.
  [[nodiscard]] Step poll() noexcept;

  [[nodiscard]] protocol::RunState run_state() const noexcept { return acquisition_.state(); }
  /// Of the run under way or the last one.
  [[nodiscard]] const protocol::RunReport& run_report() const noexcept { return acquisition_.report(); }
  [[nodiscard]] bool session_open() const noexcept { return dispatcher_.session_open(); }

 private:
  static constexpr std::size_t kReceiveBytes = 1024;

  bool follow_link() noexcept;
  bool receive() noexcept;
  void handle(const protocol::ParseResult& result) noexcept;

  Ports& ports_;
  std::array<std::byte, protocol::kMaxFrameBytes> decoder_bytes_{};
  protocol::LinkDecoder decoder_{decoder_bytes_};
  std::array<std::byte, kReceiveBytes> received_{};
  std::span<const std::byte> unread_;  // Of received_, not yet decoded.
  bool decoder_has_more_ = false;      // next() may give a frame without new bytes.
  bool connected_ = false;
  std::uint64_t heard_at_us_ = 0;

  LinkOutput output_;
  EventLog events_;
  PersistentState state_;
  Acquisition acquisition_;
  Dispatcher dispatcher_;
};

}  // namespace scatter::firmware
