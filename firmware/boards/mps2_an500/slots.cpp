#include "firmware/boards/mps2_an500/slots.h"

#include <cstring>

#include "firmware/boards/mps2_an500/registers.h"

namespace scatter::firmware::mps2_an500 {
namespace {

constexpr std::uint32_t kMarksOffset = backplane::kSlotBytes - backplane::kSlotUnitBytes;

[[nodiscard]] std::byte* memory_at(std::uint32_t address) noexcept {
  return reinterpret_cast<std::byte*>(address);  // NOLINT(performance-no-int-to-ptr)
}
[[nodiscard]] bool inside(std::uint32_t offset, std::size_t bytes) noexcept {
  return offset <= backplane::kSlotBytes && bytes <= backplane::kSlotBytes - offset;
}

}  // namespace

bool SlotMemory::read(std::uint32_t offset, std::span<std::byte> out) noexcept {
  if (!inside(offset, out.size())) {
    return false;
  }
  std::memcpy(out.data(), memory_at(address_ + offset), out.size());
  return true;
}

bool SlotMemory::program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept {
  if (!inside(offset, bytes.size()) || offset % backplane::kSlotGranuleBytes != 0 ||
      bytes.size() % backplane::kSlotGranuleBytes != 0 || (runs_ && offset < kMarksOffset)) {
    return false;
  }
  // Word by word in rising order, so that losing power in between leaves a torn prefix as flash would.
  volatile auto* cells = reinterpret_cast<volatile std::uint32_t*>(memory_at(address_ + offset));
  for (std::size_t i = 0; i < bytes.size() / sizeof(std::uint32_t); ++i) {
    std::uint32_t word = 0;
    std::memcpy(&word, bytes.data() + i * sizeof(word), sizeof(word));
    cells[i] = cells[i] & word;
  }
  barrier();
  return true;
}

bool SlotMemory::erase(std::uint32_t unit) noexcept {
  if (runs_ || unit >= geometry().units) {
    return false;
  }
  std::memset(memory_at(address_ + unit * backplane::kSlotUnitBytes), 0xFF, backplane::kSlotUnitBytes);
  barrier();
  return true;
}

}  // namespace scatter::firmware::mps2_an500
