#include "host_sdk/memory/shared_block.h"

#include <atomic>
#include <mutex>
#include <new>

#include "host_sdk/memory/huge_pages.h"

namespace scatter {
namespace {

constexpr std::size_t kChunk = 2 * kHugePage;
/// Smaller ones are malloc's business, larger ones would leave much of a chunk unused.
constexpr std::size_t kSmallestCut = std::size_t{64} << 10;
constexpr std::size_t kLargestCut = kChunk / 4;
constexpr std::size_t kLine = 64;

struct Release {
  void operator()(std::byte* memory) const noexcept {
    ::operator delete(memory, std::align_val_t{kHugePage});
  }
};
using Memory = std::unique_ptr<std::byte[], Release>;

Memory new_chunk() {
  Memory memory(static_cast<std::byte*>(::operator new(kChunk, std::align_val_t{kHugePage})));
  ask_for_huge_pages(memory.get(), kChunk);
  return memory;
}

/// A chunk that nobody uses, or null. Not destroyed at the end: a block may be held by an object with static
/// lifetime.
constinit std::atomic<std::byte*> spare = nullptr;

class Chunk {
 public:
  Chunk() : memory_(spare.exchange(nullptr)) {
    if (!memory_) {
      memory_ = new_chunk();
    }
  }
  Chunk(const Chunk&) = delete;
  Chunk& operator=(const Chunk&) = delete;
  Chunk(Chunk&&) = delete;
  Chunk& operator=(Chunk&&) = delete;
  ~Chunk() { Memory(spare.exchange(memory_.release())).reset(); }

  /// Null: too little is left.
  [[nodiscard]] std::byte* cut(std::size_t bytes) noexcept {
    if (bytes > kChunk - used_) {
      return nullptr;
    }
    std::byte* at = memory_.get() + used_;
    used_ += (bytes + kLine - 1) / kLine * kLine;
    return at;
  }

 private:
  Memory memory_;
  std::size_t used_ = 0;
};

/// The chunk that blocks are cut from now; its blocks alone keep it.
struct Current {
  std::mutex mutex;
  std::weak_ptr<Chunk> chunk;
};

std::shared_ptr<std::byte[]> cut(std::size_t bytes) {
  static Current current;
  const std::scoped_lock lock(current.mutex);
  auto chunk = current.chunk.lock();
  std::byte* at = chunk ? chunk->cut(bytes) : nullptr;
  if (at == nullptr) {
    chunk = std::make_shared<Chunk>();
    current.chunk = chunk;
    at = chunk->cut(bytes);
  }
  return {std::move(chunk), at};
}

}  // namespace

std::shared_ptr<std::byte[]> shared_bytes(std::size_t bytes) {
  if (bytes >= kSmallestCut && bytes <= kLargestCut) {
    return cut(bytes);
  }
  return std::make_shared_for_overwrite<std::byte[]>(bytes);
}

}  // namespace scatter
