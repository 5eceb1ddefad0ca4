// Memory for what is read once and kept: the image of a file, tables computed from it.
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>

namespace scatter {

/// Memory that is not set to anything, aligned for every fundamental type.
///
/// Blocks of 64 KiB to 1 MiB are cut from chunks of 4 MiB on huge pages, because the system takes longer to
/// give a file's worth of new small pages than to copy the file into them. A chunk goes back when its last
/// block does; one is then kept for the next. So up to 4 MiB more than the blocks stay taken, and a block
/// that outlives its neighbours keeps their memory with it.
/// Errors    std::bad_alloc.
/// Threads   any; the block itself is like other memory.
[[nodiscard]] std::shared_ptr<std::byte[]> shared_bytes(std::size_t bytes);

/// As shared_bytes, for `count` numbers.
template <typename T>
  requires std::is_trivial_v<T>
[[nodiscard]] std::shared_ptr<T[]> shared_block(std::size_t count) {
  auto bytes = shared_bytes(count * sizeof(T));
  auto* numbers = reinterpret_cast<T*>(bytes.get());
  return {std::move(bytes), numbers};
}

}  // namespace scatter
