// Who may do what with which memory (PMSAv7). With two regions over one address the higher number counts.
#include <bit>
#include <cstddef>
#include <cstdint>

#include "firmware/backplane/shared_memory.h"
#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/startup.h"

// NOLINTBEGIN(bugprone-reserved-identifier): names of linker scripts.
extern "C" {
extern const std::byte __stack_guard[];
extern const std::byte __code_start[];
}
// NOLINTEND(bugprone-reserved-identifier)

namespace scatter::firmware::mps2_an500 {
namespace {

namespace shared = backplane;

constexpr std::uint32_t kControl = 0xE000'ED94;
constexpr std::uint32_t kNumber = 0xE000'ED98;
constexpr std::uint32_t kBase = 0xE000'ED9C;
constexpr std::uint32_t kAttributes = 0xE000'EDA0;

constexpr std::uint32_t kNoExecute = 1U << 28U;
constexpr std::uint32_t kNoAccess = 0;
constexpr std::uint32_t kReadWrite = 3U << 24U;
constexpr std::uint32_t kReadOnly = 6U << 24U;
// Normal memory, write-back; shared where another side writes it, too.
constexpr std::uint32_t kNormal = 3U << 16U;
constexpr std::uint32_t kSharedNormal = kNormal | 1U << 18U;

/// `bytes` is a power of two, at least 32, and `base` a multiple of it.
void region(std::uint32_t number, std::uint32_t base, std::uint32_t bytes,
            std::uint32_t attributes) noexcept {
  write_register(kNumber, number);
  write_register(kBase, base);
  const auto exponent = static_cast<std::uint32_t>(std::countr_zero(bytes)) - 1U;
  write_register(kAttributes, attributes | exponent << 1U | 1U);
}

}  // namespace

void protect_memory() noexcept {
  constexpr std::uint32_t kBootBytes = 512U << 10U;
  constexpr std::uint32_t kRam = 0x2000'0000;
  constexpr std::uint32_t kRamBytes = 1U << 20U;
  constexpr std::uint32_t kGuardBytes = 256;
  const auto code = reinterpret_cast<std::uintptr_t>(__code_start);
  const bool from_slot = code >= shared::kSharedMemoryAddress;
  barrier();
  write_register(kControl, 0);
  region(0, 0, kBootBytes, kReadOnly | kNormal | (from_slot ? kNoExecute : 0));
  region(1, kRam, kRamBytes, kReadWrite | kNoExecute | kNormal);
  region(2, reinterpret_cast<std::uintptr_t>(__stack_guard), kGuardBytes, kNoAccess | kNoExecute | kNormal);
  region(3, shared::kSharedMemoryAddress, shared::kSharedMemoryBytes,
         kReadWrite | kNoExecute | kSharedNormal);
  region(4, shared::kSharedMemoryAddress + shared::kFactoryOffset, shared::kFactoryBytes,
         kReadOnly | kNoExecute | kSharedNormal);
  if (from_slot) {
    const std::uint32_t slot = code & ~(shared::kSlotBytes - 1U);
    region(5, slot, shared::kSlotBytes, kReadOnly | kSharedNormal);
    // The slot's marks, which the running image writes to confirm itself.
    region(6, slot + shared::kSlotBytes - shared::kSlotUnitBytes, shared::kSlotUnitBytes,
           kReadWrite | kNoExecute | kSharedNormal);
  }
  // Peripherals by the default map, which is no-execute there.
  write_register(kControl, 1U << 2U | 1U << 0U);
  // A fault of its own kind for each cause, division by zero included.
  write_register(0xE000'ED24, read_register(0xE000'ED24) | 7U << 16U);
  write_register(0xE000'ED14, read_register(0xE000'ED14) | 1U << 4U);
  barrier();
}

void unprotect_memory() noexcept {
  barrier();
  write_register(kControl, 0);
  barrier();
}

}  // namespace scatter::firmware::mps2_an500
