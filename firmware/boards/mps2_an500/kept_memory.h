// What survives a reset but not a loss of power: why the board was reset, and the snapshot of the last crash.
// It lies at a fixed place that no image's data covers, so that bootloader and firmware of any version share
// it.
#pragma once

#include <cstdint>
#include <string_view>

#include "firmware/ports/ports.h"
#include "protocol/messages.h"

namespace scatter::firmware::mps2_an500 {

/// Processor state at a crash, as pushed by the exception and read from the fault registers.
struct CrashState {
  protocol::ResetReason reason = protocol::ResetReason::kFault;
  std::uint32_t exception = 0;
  std::uint32_t pc = 0;
  std::uint32_t lr = 0;
  std::uint32_t sp = 0;
  std::uint32_t psr = 0;
  std::uint32_t fault_status = 0;
  std::uint32_t hard_fault_status = 0;
  std::uint32_t fault_address = 0;
};

/// First thing after a reset (in the bootloader, or in an image that runs without one): settles why the
/// board was reset. Memory that holds no valid note means power-on. From here on a reset that nobody
/// announces counts as the watchdog's.
void begin_boot() noexcept;
/// Why the board was last reset.
[[nodiscard]] protocol::ResetReason reset_reason() noexcept;
/// The next boot reports this reason.
void announce_reset(protocol::ResetReason reason) noexcept;

/// Who runs, for a snapshot: at most 32 bytes of `build_id` are kept. The firmware says it once it knows.
void name_running_image(std::string_view build_id, std::uint32_t boot_count) noexcept;
/// Writes the snapshot. For fault handlers: needs no working stack but its own 200 bytes.
void record_crash(const CrashState& state, std::uint64_t uptime_us) noexcept;
/// The last snapshot; present == 0 when there is none or its checksum is wrong.
[[nodiscard]] protocol::FaultRecord last_crash() noexcept;

/// Reset port. reboot() only asks: the main loop lets the last bytes leave, then resets.
class BoardReset final : public Reset {
 public:
  constexpr BoardReset() noexcept = default;
  void reboot() noexcept override { wanted_ = true; }
  [[nodiscard]] protocol::ResetReason reason() noexcept override { return reset_reason(); }
  [[nodiscard]] protocol::FaultRecord fault_record() noexcept override { return last_crash(); }
  [[nodiscard]] bool wanted() const noexcept { return wanted_; }

 private:
  bool wanted_ = false;
};

}  // namespace scatter::firmware::mps2_an500
