// The one place of the host SDK's numerical rooms that knows how the system maps memory.
#pragma once

#include <cstddef>

namespace scatter {

/// Bytes of a huge page where the system has them.
inline constexpr std::size_t kHugePage = std::size_t{2} << 20;

/// Asks the system to back memory with huge pages: those that lie in it as a whole, so that nothing grows.
/// A system that declines, or that has none, changes nothing but the speed.
/// Threads   any.
void ask_for_huge_pages(std::byte* memory, std::size_t bytes) noexcept;

}  // namespace scatter
