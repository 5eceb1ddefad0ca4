#include "host_sdk/memory/huge_pages.h"

#if defined(__linux__)
#include <sys/mman.h>
#endif

#include <cstdint>

namespace scatter {

void ask_for_huge_pages([[maybe_unused]] std::byte* memory, [[maybe_unused]] std::size_t bytes) noexcept {
#if defined(__linux__)
  const auto address = reinterpret_cast<std::uintptr_t>(memory);
  const std::size_t skipped = (kHugePage - address % kHugePage) % kHugePage;
  if (bytes >= skipped + kHugePage) {
    ::madvise(memory + skipped, (bytes - skipped) / kHugePage * kHugePage, MADV_HUGEPAGE);
  }
#endif
}

}  // namespace scatter
