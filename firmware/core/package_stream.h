// A firmware file (.scfw) that arrives as a stream of blocks, without seeking: keeps the image for the slot
// that may be written, skips the other one, and hands the kept one to the UpdateReceiver.
//
// The file's layout is the byte table in host_sdk/firmware_files/README.md; the constants here restate it,
// because firmware includes nothing of the host's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/core/update_receiver.h"
#include "protocol/image_header.h"

namespace scatter::firmware {

inline constexpr std::uint32_t kPackageMagic = 0x57464353;  // "SCFW"
inline constexpr std::uint16_t kPackageVersion = 1;
inline constexpr std::uint32_t kPackageTableBytes = 64;  ///< The table, and the step of image offsets.
inline constexpr std::uint32_t kPackageMaxBodyBytes = 16U << 20U;
inline constexpr std::uint32_t kDfuSuffixBytes = 16;

/// Why a file was not taken.
enum class PackageFault : std::uint8_t {
  kNone,
  kFormat,      ///< Not a .scfw of version 1, damaged, or bytes behind its end.
  kProduct,     ///< For another product.
  kRefused,     ///< Header refused: signature, slot, address, size, security counter.
  kNotNow,      ///< Receiver in use, or the other slot is the fallback of a trial.
  kErase,       ///< The slot cannot be erased, or did not take the header.
  kProgram,     ///< Flash did not take a part of the body.
  kVerify,      ///< What is in flash is not what the header says.
  kIncomplete,  ///< Finished before its end.
  kUnknown,     ///< The receiver lost the download: somebody else used it.
};

/// RAM: 5188 B on a Cortex-M7, no heap. Threads: one. The receiver is the stream's alone from start() until
/// it is ready(), has a fault() or is cancelled.
class PackageStream {
 public:
  static constexpr std::uint32_t kMaxBlock = 4096;  ///< Largest block [B].

  /// `product` must outlive the stream, as the receiver must.
  PackageStream(UpdateReceiver& receiver, std::string_view product) noexcept
      : receiver_(receiver), product_(product) {}

  /// A file begins. Nothing is erased before its signed header was checked.
  void start() noexcept;
  /// The next block, at most kMaxBlock bytes; copied. Not while busy(), and not after a fault.
  void take(std::span<const std::byte> block) noexcept;
  /// The file is whole: hash the image and mark it ready. Only when complete() and not busy().
  void finish() noexcept;
  /// One bounded piece of what there is to do. Worst case: one step of the receiver, or kChunk bytes
  /// programmed and read back, or one look at both slots (two signature checks).
  void step() noexcept;
  /// Stops; the same file, sent again from its start, resumes in the flash where it can.
  void cancel() noexcept;

  [[nodiscard]] bool busy() const noexcept;
  [[nodiscard]] PackageFault fault() const noexcept { return fault_; }
  /// Every byte of the file is here; a DFU suffix behind it, if it came, is whole.
  [[nodiscard]] bool complete() const noexcept {
    return fault_ == PackageFault::kNone && filled_ == used_ && file_bytes_ != 0 && body_at_ == body_bytes_ &&
           begun_ && (position_ == file_bytes_ || position_ == file_bytes_ + kDfuSuffixBytes);
  }
  /// finish() ended well, and no other download has touched the slot since.
  [[nodiscard]] bool ready() const noexcept { return ready_; }

 private:
  enum class Job : std::uint8_t { kNone, kChooseSlot, kBegin, kFindPlace, kFinish };
  static constexpr std::uint32_t kChunk = 1024;  // Whole granules of any flash.

  void ask(Job job, const UpdateAnswer& answer) noexcept;
  void ended(Job job, const UpdateAnswer& answer) noexcept;
  void fail(PackageFault fault) noexcept;
  /// Moves bytes of the block into chunk_ until it holds `wanted`.
  [[nodiscard]] bool gather(std::uint32_t wanted) noexcept;
  void consume() noexcept;
  void read_table() noexcept;
  void begin_image() noexcept;
  void add_body() noexcept;
  void skip() noexcept;

  UpdateReceiver& receiver_;
  std::string_view product_;

  Job job_ = Job::kNone;
  PackageFault fault_ = PackageFault::kNone;
  bool ready_ = false;
  bool slot_known_ = false;
  bool begun_ = false;        // The receiver accepted the header.
  bool place_known_ = false;  // resume_at_ is.
  std::uint8_t slot_ = 0;

  std::uint32_t position_ = 0;    // Of the next byte of the file.
  std::uint32_t file_bytes_ = 0;  // 0: table not read yet.
  std::array<std::uint32_t, ImageSlots::kCount> offset_{};
  std::array<std::uint32_t, ImageSlots::kCount> size_{};
  std::uint32_t body_bytes_ = 0;
  std::uint32_t body_at_ = 0;    // Handed to the receiver.
  std::uint32_t resume_at_ = 0;  // A chunk ends here: before it bytes are compared, behind it programmed.

  std::uint32_t used_ = 0, filled_ = 0;  // Of block_.
  std::uint32_t chunk_fill_ = 0;
  std::array<std::byte, kMaxBlock> block_{};
  std::array<std::byte, kChunk> chunk_{};
};

}  // namespace scatter::firmware
