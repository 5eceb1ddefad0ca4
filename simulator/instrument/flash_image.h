// Flash memory of the virtual board: strict about erase-before-program, optionally kept in a file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "firmware/ports/ports.h"
#include "host_sdk/error/error.h"

namespace scatter::simulator {

/// 256 KiB in units of 4 KiB, programmed in granules of 32 bytes (a flash word of the STM32H7 class), for
/// what the firmware remembers, and behind it two slots of 512 KiB for firmware images. Threads: one.
class FlashImage final : public firmware::Flash {
 public:
  static constexpr Geometry kGeometry{.unit_bytes = 4096, .units = 64, .program_bytes = 32};
  static constexpr Geometry kSlotGeometry{.unit_bytes = 4096, .units = 128, .program_bytes = 32};

  /// Erased, in memory only.
  FlashImage();
  ~FlashImage();
  FlashImage(const FlashImage&) = delete;
  FlashImage& operator=(const FlashImage&) = delete;

  /// Backed by `file`: its contents if it exists, else erased and created. A file of the 256 KiB alone, as
  /// older simulators wrote it, grows by erased slots. Errors    kDataLoss: the file has another size;
  /// kPermissionDenied: it cannot be written.
  [[nodiscard]] static Result<std::unique_ptr<FlashImage>> open(const std::filesystem::path& file);

  [[nodiscard]] Geometry geometry() noexcept override { return kGeometry; }
  [[nodiscard]] bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override;
  /// Refuses, and counts as a violation, cells that are not erased and unaligned ranges.
  [[nodiscard]] bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool erase(std::uint32_t unit) noexcept override;

  /// 0 or 1.
  [[nodiscard]] firmware::Flash& slot(std::uint8_t index) noexcept { return slots_[index]; }
  /// Nothing was ever programmed into the slots.
  [[nodiscard]] bool slots_are_blank() const noexcept;

  /// Calls that real flash forbids, slots included; a correct firmware leaves this at 0.
  [[nodiscard]] std::uint64_t violations() const noexcept { return violations_; }
  /// The 256 KiB, then the slots.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return cells_; }

 private:
  /// A stretch of cells with an address space of its own.
  struct Region {
    std::size_t base = 0;
    Geometry geometry;
  };
  class Slot final : public firmware::Flash {
   public:
    Slot(FlashImage& image, std::uint8_t index) : image_(image), region_(slot_region(index)) {}
    [[nodiscard]] Geometry geometry() noexcept override { return kSlotGeometry; }
    [[nodiscard]] bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
      return image_.read_in(region_, offset, out);
    }
    [[nodiscard]] bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
      return image_.program_in(region_, offset, bytes);
    }
    [[nodiscard]] bool erase(std::uint32_t unit) noexcept override { return image_.erase_in(region_, unit); }

   private:
    FlashImage& image_;
    Region region_;
  };

  [[nodiscard]] static Region slot_region(std::uint8_t index) noexcept;
  [[nodiscard]] bool read_in(const Region& region, std::uint32_t offset, std::span<std::byte> out) noexcept;
  [[nodiscard]] bool program_in(const Region& region, std::uint32_t offset,
                                std::span<const std::byte> bytes) noexcept;
  [[nodiscard]] bool erase_in(const Region& region, std::uint32_t unit) noexcept;
  [[nodiscard]] bool store(std::size_t offset, std::size_t length) noexcept;

  std::vector<std::byte> cells_;
  std::array<Slot, 2> slots_{Slot(*this, 0), Slot(*this, 1)};
  int file_ = -1;  ///< POSIX descriptor, -1: memory only.
  std::uint64_t violations_ = 0;
};

}  // namespace scatter::simulator
