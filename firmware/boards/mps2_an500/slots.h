// The two firmware slots: memory that keeps its contents (a file on the emulating machine), treated as flash.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "firmware/backplane/shared_memory.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware::mps2_an500 {

/// Programs by clearing bits only, erases to 0xFF. Refuses to erase, and to program but the marks of, the
/// slot that runs: the memory protection would turn that into a crash.
class SlotMemory final : public Flash {
 public:
  constexpr SlotMemory(std::uint32_t address, bool runs) noexcept : address_(address), runs_(runs) {}
  [[nodiscard]] Geometry geometry() noexcept override {
    return {backplane::kSlotUnitBytes, backplane::kSlotBytes / backplane::kSlotUnitBytes,
            backplane::kSlotGranuleBytes};
  }
  [[nodiscard]] bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override;
  [[nodiscard]] bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool erase(std::uint32_t unit) noexcept override;

 private:
  std::uint32_t address_;
  bool runs_;
};

class Slots final : public ImageSlots {
 public:
  /// `running`: 0, 1, or kCount in the bootloader.
  constexpr explicit Slots(std::uint8_t running) noexcept
      : running_(running), slots_{{{address_of(0), running == 0}, {address_of(1), running == 1}}} {}

  [[nodiscard]] Flash& slot(std::uint8_t index) noexcept override { return slots_[index]; }
  [[nodiscard]] std::uint32_t address(std::uint8_t index) noexcept override { return address_of(index); }
  [[nodiscard]] std::uint8_t running() noexcept override { return running_; }

  [[nodiscard]] static constexpr std::uint32_t address_of(std::uint8_t index) noexcept {
    return backplane::kSharedMemoryAddress + backplane::kSlotOffset[index];
  }

 private:
  std::uint8_t running_;
  std::array<SlotMemory, kCount> slots_;
};

}  // namespace scatter::firmware::mps2_an500
