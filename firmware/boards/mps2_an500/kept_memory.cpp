#include "firmware/boards/mps2_an500/kept_memory.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <span>

#include "protocol/crc.h"

namespace scatter::firmware::mps2_an500 {
namespace {

// All words, so that there is no padding and images built years apart agree. A change needs other magics.
struct Note {
  std::uint32_t magic;
  std::uint32_t why_now;   // Settled by begin_boot.
  std::uint32_t why_next;  // What the next boot shall settle.
  std::uint32_t check;
};
struct Snapshot {
  std::uint32_t magic;
  std::uint32_t reason;
  std::uint32_t exception;
  std::uint32_t boot_count;
  std::uint32_t uptime_low;
  std::uint32_t uptime_high;
  std::uint32_t pc;
  std::uint32_t lr;
  std::uint32_t sp;
  std::uint32_t psr;
  std::uint32_t fault_status;
  std::uint32_t hard_fault_status;
  std::uint32_t fault_address;
  std::uint32_t build_id_bytes;
  std::array<char, 32> build_id;
  std::uint32_t crc;  // CRC-32C of everything before.
};
struct Kept {
  Note note;
  Snapshot snapshot;
};

constexpr std::uint32_t kNoteMagic = 0x4E53'4F31;      // "1OSN"
constexpr std::uint32_t kSnapshotMagic = 0x4353'4F31;  // "1OSC"
// Any reason above the last one is damage.
constexpr auto kLastReason = static_cast<std::uint32_t>(protocol::ResetReason::kBrownOut);

// Placed by the linker script: no section of any image, so that nothing initialises it.
extern "C" Kept __kept_memory;  // NOLINT(bugprone-reserved-identifier)

[[nodiscard]] std::uint32_t check_of(const Note& note) noexcept {
  return ~(note.magic + note.why_now * 0x0101'0101U + note.why_next * 0x1010'1010U);
}
[[nodiscard]] std::uint32_t crc_of(const Snapshot& snapshot) noexcept {
  return protocol::crc32c(std::as_bytes(std::span(&snapshot, 1)).first(offsetof(Snapshot, crc)));
}
[[nodiscard]] bool valid(const Note& note) noexcept {
  return note.magic == kNoteMagic && note.check == check_of(note) && note.why_now <= kLastReason &&
         note.why_next <= kLastReason;
}
void write_note(protocol::ResetReason now, protocol::ResetReason next) noexcept {
  Note& note = __kept_memory.note;
  note.magic = kNoteMagic;
  note.why_now = static_cast<std::uint32_t>(now);
  note.why_next = static_cast<std::uint32_t>(next);
  note.check = check_of(note);
}

constinit std::array<char, 32> running_image{};
constinit std::uint32_t running_image_bytes = 0;
constinit std::uint32_t running_boot_count = 0;

}  // namespace

void begin_boot() noexcept {
  Kept& kept = __kept_memory;
  const bool kept_on = valid(kept.note);
  if (!kept_on) {
    std::memset(&kept, 0, sizeof(kept));  // Power-on: what the cells hold is chance.
  }
  write_note(
      kept_on ? static_cast<protocol::ResetReason>(kept.note.why_next) : protocol::ResetReason::kPowerOn,
      protocol::ResetReason::kWatchdog);
}

protocol::ResetReason reset_reason() noexcept {
  const Note& note = __kept_memory.note;
  return valid(note) ? static_cast<protocol::ResetReason>(note.why_now) : protocol::ResetReason::kPowerOn;
}

void announce_reset(protocol::ResetReason reason) noexcept {
  write_note(reset_reason(), reason);
}

void name_running_image(std::string_view build_id, std::uint32_t boot_count) noexcept {
  running_image_bytes = static_cast<std::uint32_t>(std::min(build_id.size(), running_image.size()));
  std::copy_n(build_id.begin(), running_image_bytes, running_image.begin());
  running_boot_count = boot_count;
}

void record_crash(const CrashState& state, std::uint64_t uptime_us) noexcept {
  Snapshot& s = __kept_memory.snapshot;
  s.magic = 0;  // Not valid until it is whole.
  s.reason = static_cast<std::uint32_t>(state.reason);
  s.exception = state.exception;
  s.boot_count = running_boot_count;
  s.uptime_low = static_cast<std::uint32_t>(uptime_us);
  s.uptime_high = static_cast<std::uint32_t>(uptime_us >> 32U);
  s.pc = state.pc;
  s.lr = state.lr;
  s.sp = state.sp;
  s.psr = state.psr;
  s.fault_status = state.fault_status;
  s.hard_fault_status = state.hard_fault_status;
  s.fault_address = state.fault_address;
  s.build_id_bytes = running_image_bytes;
  s.build_id = running_image;
  s.magic = kSnapshotMagic;
  s.crc = crc_of(s);
  announce_reset(state.reason);
}

protocol::FaultRecord last_crash() noexcept {
  const Snapshot& s = __kept_memory.snapshot;
  protocol::FaultRecord record;
  if (s.magic != kSnapshotMagic || s.crc != crc_of(s)) {
    return record;
  }
  record.present = 1;
  record.reason = static_cast<std::uint8_t>(s.reason);
  record.exception = static_cast<std::uint8_t>(s.exception);
  record.boot_count = s.boot_count;
  record.uptime_us = std::uint64_t{s.uptime_high} << 32U | s.uptime_low;
  record.pc = s.pc;
  record.lr = s.lr;
  record.sp = s.sp;
  record.psr = s.psr;
  record.fault_status = s.fault_status;
  record.hard_fault_status = s.hard_fault_status;
  record.fault_address = s.fault_address;
  record.build_id =
      std::string_view(s.build_id.data(), std::min<std::size_t>(s.build_id_bytes, s.build_id.size()));
  return record;
}

}  // namespace scatter::firmware::mps2_an500
