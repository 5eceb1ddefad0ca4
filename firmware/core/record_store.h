// One record of a few hundred bytes that survives everything: written again as a whole at each change, in two
// copies. The newest whole record counts; nothing is ever put together from two.
//
// The flash is cut in two banks, one per copy; a bank is a ring of groups (one erase unit, or as many as a
// place needs), a group holds as many places as fit. Records go from place to place; a group is erased when
// the ring comes to it, and only while the newest record stands whole elsewhere.
//
//   place  offset size
//               0    4 magic "OSRC"
//               4    2 format version 1
//               6    2 size of this header, 24
//               8    8 number; rises with every record
//              16    4 payload length n
//              20    4 CRC-32C of bytes 0..19
//              24    n payload, then 0xFF up to a multiple of the program granule
//                    commit granule, programmed last, when the rest reads back right:
//                    4 bytes CRC-32C of everything before it, 4 bytes CRC-32C of number and the former
//                    4 bytes, 0xFF up to the granule
// All little endian. A record is whole if and only if all three checksums are right. A later format keeps
// bytes 0..23 and begins every erase unit that it uses with a record: that is how an older firmware knows to
// keep its hands off.
//
// Why a cell that a power cut left unstable cannot change what the device says:
// - mount() reads; the first write() after it (the caller's, before it acts on anything) takes a fresh group
//   in each bank, erased in this power-on. No cell is ever programmed that this power-on did not erase, so at
//   most one record per group can be unstable, and what a cut left behind the newest whole record is erased
//   before anything new is trusted.
// - That first write's number leaves a gap above everything found, so that a record that nobody saw and that
//   shows itself later is older than it.
// - The bank that lacks the newest record is written first: when the other one is touched, a sound copy
// stands.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/store_report.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware {

/// RAM: about 1.5 KiB. Not thread-safe. Cost: mount reads every header and a few records; a write programs
/// and reads back a record twice, and erases at most one group per bank when no cell is bad.
class RecordStore {
 public:
  /// Longest payload [B].
  static constexpr std::size_t kMaxPayload = 1280;
  /// Coarsest program granule that is supported [B].
  static constexpr std::size_t kMaxGranule = 64;

  explicit RecordStore(Flash& flash) noexcept : flash_(flash) {}

  /// Finds the newest whole record; payload().first(length) holds it until payload() is written to. `length`
  /// is 0 when there is none. Changes nothing in flash. False: unusable, or a later version's; write() then
  /// fails and leaves everything as it is. Needs at least two groups per bank: 4 erase units of 1.4 KiB or
  /// more, else as many smaller ones as make 4 places.
  [[nodiscard]] bool mount(std::size_t& length) noexcept;

  /// Where a record is put together and where mount leaves it. write() does not change it.
  [[nodiscard]] std::span<std::byte> payload() noexcept {
    return std::span(staging_).subspan(kHeaderBytes, kMaxPayload);
  }
  /// Makes the first `length` bytes of payload() the newest record. False: not one copy could be written and
  /// read back; the record before it stays in force.
  [[nodiscard]] bool write(std::size_t length) noexcept;

  /// What mount found, and what writing met since.
  [[nodiscard]] const StoreReport& report() const noexcept { return report_; }

 private:
  static constexpr std::size_t kHeaderBytes = 24;
  static constexpr std::size_t kCommitBytes = 8;
  static constexpr std::uint32_t kNone = 0xFFFF'FFFF;
  struct Header {
    enum class Kind : std::uint8_t { kErased, kDamaged, kRecord, kLaterVersion };
    Kind kind = Kind::kErased;
    std::uint64_t number = 0;
    std::uint32_t length = 0;
  };
  struct Bank {
    std::uint32_t newest = kNone;  ///< Place of its newest whole record.
    std::uint64_t number = 0;      ///< Of that record, 0 = none.
    std::uint32_t next = 0;        ///< Place to write next.
    std::uint32_t erased = kNone;  ///< Group erased in this power-on that `next` may lie in.
  };

  [[nodiscard]] bool lay_out() noexcept;
  [[nodiscard]] std::uint32_t aligned(std::size_t size) const noexcept;
  [[nodiscard]] std::uint32_t offset_of(std::size_t bank, std::uint32_t place) const noexcept;
  [[nodiscard]] Header header_at(std::size_t bank, std::uint32_t place) noexcept;
  [[nodiscard]] bool load(std::size_t bank, std::uint32_t place, std::uint32_t& length) noexcept;
  [[nodiscard]] bool find_newest(std::size_t bank, std::uint64_t& highest) noexcept;
  [[nodiscard]] std::uint32_t damaged_after(std::size_t bank) noexcept;
  void take_next_group(Bank& bank) const noexcept;
  [[nodiscard]] bool erase_group(std::size_t bank, std::uint32_t group) noexcept;
  [[nodiscard]] bool write_place(std::size_t bank, std::uint32_t body, std::uint32_t total) noexcept;
  [[nodiscard]] bool write_copy(std::size_t bank, std::uint32_t body, std::uint32_t total) noexcept;
  [[nodiscard]] bool reads_back(std::uint32_t offset, std::uint32_t length) noexcept;

  Flash& flash_;
  Flash::Geometry geometry_;
  std::uint32_t place_bytes_ = 0;
  std::uint32_t places_per_group_ = 0;
  std::uint32_t units_per_group_ = 0;
  std::uint32_t groups_ = 0;  ///< Per bank; 0 = not to be written.
  std::array<Bank, 2> banks_{};
  std::uint64_t number_ = 0;  ///< Last one given.
  StoreReport report_;
  std::array<std::byte, kHeaderBytes + kMaxPayload + kMaxGranule + kMaxGranule> staging_{};
};

}  // namespace scatter::firmware
