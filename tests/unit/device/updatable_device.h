// A scripted device that takes firmware: what outlives its connections and restarts.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/device/updater.h"
#include "tests/unit/device/scripted_device.h"

namespace scatter::device::test {

/// Honest unless a test tells it otherwise. Bodies are programmed in order, as real flash is.
class UpdatableDevice {
 public:
  struct Slot {
    std::string version;
    std::uint32_t counter = 0;
    protocol::SlotVerdict verdict = protocol::SlotVerdict::kEmpty;
    Bytes header;
    Bytes body;
    std::uint32_t body_bytes = 0;
  };

  /// Opens a connection; UpdateOptions' OpenDevice.
  [[nodiscard]] OpenDevice opener();

  std::array<Slot, 2> slots;
  std::uint8_t running = 0;
  std::string product = "HS-1";
  std::uint32_t lowest_counter = 1;
  std::uint32_t slot_bytes = 500'000;
  std::uint32_t chunk_bytes = 64;
  std::uint32_t capabilities = protocol::kCapabilityUpdate;
  std::uint32_t boot_count = 7;
  protocol::ResetReason reset_reason = protocol::ResetReason::kPowerOn;
  protocol::FaultCode fault = protocol::FaultCode::kNone;
  protocol::FaultRecord record;

  // What goes wrong.
  std::optional<std::uint32_t> unplug_at;  ///< Once, when so many bytes of the body are there.
  std::optional<int> lose_write;           ///< The nth write that arrives is lost, once.
  int lose_every = 0;                      ///< Every nth write that arrives is lost; 0: none.
  bool new_firmware_crashes = false;
  std::uint32_t pattern_error = 0;  ///< Of the new firmware's self test.
  int broken_links = 0;             ///< So many links after the restart break at update_status.
  bool reboot_is_lost = false;      ///< The link breaks before the first restart is asked for.
  int busy_openings = 0;            ///< So many openings after the restart find it held.
  bool stays_away = false;          ///< Does not come back after a restart.
  bool finds_damage = false;        ///< update_finish says DATA_LOSS.
  Duration reply_delay{};           ///< Of update_write.

  std::map<protocol::MessageId, int> carried_out;
  int openings = 0;
  Duration sending_time{};  ///< From the first write to update_finish, on the device's clock.

 private:
  bool serve(ScriptedDevice& device, const protocol::Frame& frame);
  void begin(ScriptedDevice& device, const protocol::Frame& frame);
  void write(ScriptedDevice& device, const protocol::Frame& frame);
  void restart();
  [[nodiscard]] Slot& other() noexcept { return slots[1 - running]; }
  [[nodiscard]] protocol::UpdateState state();

  int writes_heard_ = 0;
  bool gone_ = false;
  bool restarted_ = false;
  std::optional<TimePoint> first_write_;
};

}  // namespace scatter::device::test
