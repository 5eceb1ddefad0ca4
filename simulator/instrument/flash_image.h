// Flash memory of the virtual board: strict about erase-before-program, optionally kept in a file.
#pragma once

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

/// 256 KiB in units of 4 KiB, programmed in granules of 32 bytes (a flash word of the STM32H7 class).
/// Threads: one.
class FlashImage final : public firmware::Flash {
 public:
  static constexpr Geometry kGeometry{.unit_bytes = 4096, .units = 64, .program_bytes = 32};

  /// Erased, in memory only.
  FlashImage();
  ~FlashImage();
  FlashImage(const FlashImage&) = delete;
  FlashImage& operator=(const FlashImage&) = delete;

  /// Backed by `file`: its contents if it exists, else erased and created.
  /// Errors    kDataLoss: the file has another size; kPermissionDenied: it cannot be written.
  [[nodiscard]] static Result<std::unique_ptr<FlashImage>> open(const std::filesystem::path& file);

  [[nodiscard]] Geometry geometry() noexcept override { return kGeometry; }
  [[nodiscard]] bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override;
  /// Refuses, and counts as a violation, cells that are not erased and unaligned ranges.
  [[nodiscard]] bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool erase(std::uint32_t unit) noexcept override;

  /// Calls that real flash forbids; a correct firmware leaves this at 0.
  [[nodiscard]] std::uint64_t violations() const noexcept { return violations_; }
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return cells_; }

 private:
  [[nodiscard]] bool store(std::size_t offset, std::size_t length) noexcept;

  std::vector<std::byte> cells_;
  int file_ = -1;  ///< POSIX descriptor, -1: memory only.
  std::uint64_t violations_ = 0;
};

}  // namespace scatter::simulator
