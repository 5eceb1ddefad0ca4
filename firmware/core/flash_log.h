// Append-only records in flash, in two halves: one is in use, the other receives the live records when
// the first is full. The half in use is erased only after the other one has become valid.
//
// Half:   offset size
//              0    4 magic "OSLG"
//              4    4 generation; the valid half with the later one is in use
//              8    4 format version 1
//             12    4 CRC-32C of bytes 0..11
//             16      records, each starting at a multiple of the program granule
// Record:      0    2 kind
//              2    2 payload length n
//              4    4 CRC-32C of bytes 0..3
//              8    n payload
//            8+n    4 CRC-32C of bytes 0..8+n-1
// All little endian. A half is valid if and only if its header's CRC is right; the header is programmed
// last. A record is valid if and only if both its CRCs are right; anything else is stepped over,
// granule by granule, and counted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/ports/ports.h"

namespace scatter::firmware {

class FlashLog {
 public:
  /// Longest payload of a record [B].
  static constexpr std::size_t kMaxPayload = 256;
  /// Coarsest program granule that is supported [B].
  static constexpr std::size_t kMaxGranule = 64;

  /// Gets every valid record of the half in use, oldest first.
  class Reader {
   public:
    virtual void record(std::uint16_t kind, std::span<const std::byte> payload) noexcept = 0;

   protected:
    ~Reader() = default;
  };

  explicit FlashLog(Flash& flash) noexcept : flash_(flash) {}

  /// Finds the half in use (formats the first when neither is valid) and reads it. False when the flash
  /// cannot hold a log or cannot be written; append then always fails.
  bool mount(Reader& reader) noexcept;
  /// Damaged stretches that mount stepped over.
  [[nodiscard]] std::uint32_t recovered() const noexcept { return recovered_; }

  enum class Append : std::uint8_t { kDone, kFull, kFailed };
  /// Adds a record. kFull: nothing was written, compact first. kFailed: the flash refused.
  [[nodiscard]] Append append(std::uint16_t kind, std::span<const std::byte> payload) noexcept;

  /// Compaction: begin, append the live records, finish. Until finish the old half stays in use.
  [[nodiscard]] bool begin_compaction() noexcept;
  [[nodiscard]] bool finish_compaction() noexcept;
  /// Instead of finish: the old half stays in use; it is still full.
  void abandon_compaction() noexcept;

 private:
  [[nodiscard]] std::uint32_t aligned(std::size_t size) const noexcept;
  [[nodiscard]] bool read_generation(std::uint32_t half, std::uint32_t& generation) noexcept;
  [[nodiscard]] bool erase_half(std::uint32_t half) noexcept;
  [[nodiscard]] bool write_header(std::uint32_t half, std::uint32_t generation) noexcept;
  [[nodiscard]] std::uint32_t end_of_data(std::uint32_t half) noexcept;
  [[nodiscard]] std::size_t read_record(std::uint32_t offset, std::span<std::byte> buffer) noexcept;
  void scan(Reader& reader) noexcept;
  [[nodiscard]] std::uint32_t base(std::uint32_t half) const noexcept { return half * half_bytes_; }

  Flash& flash_;
  Flash::Geometry geometry_;
  std::uint32_t half_bytes_ = 0;  // 0 = not mounted.
  std::uint32_t half_ = 0;        // Receives records: in use, or being filled by a compaction.
  std::uint32_t generation_ = 0;
  std::uint32_t next_ = 0;  // Offset in the half of the next record.
  std::uint32_t recovered_ = 0;
};

}  // namespace scatter::firmware
