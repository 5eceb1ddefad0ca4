// The firmware of an instrument: everything that a board runs. A board implements the ports, makes one
// Instrument over them in static memory and calls poll() for ever.
//
//   Instrument instrument(ports);
//   for (;;) {
//     const Step step = instrument.poll();
//     if (!step.did_work) sleep_until(step.wake_at_us);  // or earlier, on link traffic
//   }
//
// No heap, no exceptions, no time but Clock's. RAM: sizeof(Instrument), about 120 KiB; a board with a slow
// carrier or memory of several kinds makes an InstrumentCore over memory of its own instead. One thread.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/acquisition.h"
#include "firmware/core/dispatcher.h"
#include "firmware/core/event_log.h"
#include "firmware/core/link_output.h"
#include "firmware/core/persistent_state.h"
#include "firmware/core/request_reader.h"
#include "firmware/core/step.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware {

/// Memory whose size the carrier's longest payload decides.
struct InstrumentMemory {
  std::span<std::byte> decoder;   ///< One wire frame from the host.
  std::span<std::byte> stream;    ///< One wire frame of pixels to the host.
  std::span<std::byte> replies;   ///< kMaxSlots of the ReplyCache, each for the longest reply.
  std::span<std::uint16_t> band;  ///< At least kMaxRowPixels.
};

/// The arrays for carriers of up to kPayload bytes of payload (Link::max_payload). Frame bands (pixels on
/// their way) are `stream` and `band`.
template <std::uint32_t kPayload>
struct InstrumentArrays {
  static constexpr std::size_t kFrameBytes = protocol::kFrameOverhead + kPayload;
  static constexpr std::size_t kReplyBytes = std::min(kFrameBytes, LinkOutput::kMaxControlFrame);

  std::array<std::byte, kFrameBytes> decoder{};
  std::array<std::byte, protocol::ReplyCache::kMaxSlots * kReplyBytes> replies{};
  alignas(8) std::array<std::byte, kFrameBytes> stream{};
  std::array<std::uint16_t, kMaxRowPixels> band{};

  [[nodiscard]] InstrumentMemory memory() noexcept {
    return {.decoder = decoder, .stream = stream, .replies = replies, .band = band};
  }
};

/// The firmware over memory of the caller's.
class InstrumentCore {
 public:
  /// Mounts the flash and counts the boot. `ports` and what it refers to, and the memory, must outlive the
  /// instrument.
  InstrumentCore(Ports& ports, const InstrumentMemory& memory) noexcept;
  InstrumentCore(const InstrumentCore&) = delete;
  InstrumentCore& operator=(const InstrumentCore&) = delete;

  /// Does what can be done now, a bounded piece: some requests, at most one wire frame of pixels.
  /// Kicks the watchdog. Worst case on the bus side: one Link::read, the Link::writes that the carrier
  /// takes, one Sensor::read_rows; flash is touched only by calibration and settings requests.
  [[nodiscard]] Step poll() noexcept;

  [[nodiscard]] protocol::RunState run_state() const noexcept { return acquisition_.state(); }
  /// Of the run under way or the last one.
  [[nodiscard]] const protocol::RunReport& run_report() const noexcept { return acquisition_.report(); }
  [[nodiscard]] bool session_open() const noexcept { return dispatcher_.session_open(); }
  /// Longest turn of the main loop so far [us].
  [[nodiscard]] std::uint32_t worst_poll_us() const noexcept { return dispatcher_.worst_poll_us(); }

  /// For who reaches the instrument past the link (firmware/core/usb): as the messages abort and reboot.
  void abort() noexcept { dispatcher_.abort_from_outside(); }
  void reboot() noexcept { dispatcher_.reboot_from_outside(); }
  /// Null without slots or verifier. Whoever uses it sees to it that no host is on the link meanwhile.
  [[nodiscard]] UpdateReceiver* update_receiver() noexcept { return dispatcher_.update_receiver(); }

  /// Of this boot, for crash snapshots.
  [[nodiscard]] std::uint32_t boot_count() const noexcept { return state_.boot_count(); }

 private:
  static constexpr std::size_t kReceiveBytes = 1024;

  bool follow_link() noexcept;
  bool receive() noexcept;

  Ports& ports_;
  std::array<std::byte, kReceiveBytes> received_{};
  RequestReader reader_;

  LinkOutput output_;
  EventLog events_;
  PersistentState state_;
  Acquisition acquisition_;
  Dispatcher dispatcher_;
};

/// With memory for the longest payload that any carrier has.
class Instrument final : private InstrumentArrays<protocol::kMaxPayload>, public InstrumentCore {
 public:
  explicit Instrument(Ports& ports) noexcept : InstrumentCore(ports, memory()) {}
};

}  // namespace scatter::firmware
