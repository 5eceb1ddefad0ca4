#include "host_sdk/reflectance/estimators/scratch.h"

#include <algorithm>
#include <memory>
#include <vector>

namespace scatter::reflectance {
namespace {

constexpr std::size_t kAlignment = alignof(std::max_align_t);
constexpr std::size_t kLeastBlock = std::size_t{1} << 18U;

struct Block {
  std::unique_ptr<std::byte[]> bytes;
  std::size_t size = 0;
};

/// Blocks never move, so arrays handed out earlier stay where they are.
struct Arena {
  std::vector<Block> blocks;
  std::size_t block = 0;  ///< In use; blocks.size() when a new one is needed.
  std::size_t used = 0;   ///< Bytes of it.
};

Arena& arena() noexcept {
  thread_local Arena of_this_thread;
  return of_this_thread;
}

}  // namespace

Scratch::Scratch() noexcept : block_(arena().block), used_(arena().used) {}

Scratch::~Scratch() {
  arena().block = block_;
  arena().used = used_;
}

void* Scratch::take_bytes(std::size_t bytes) noexcept {
  Arena& a = arena();
  bytes = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  while (a.block < a.blocks.size() && a.used + bytes > a.blocks[a.block].size) {
    a.block += 1;
    a.used = 0;
  }
  if (a.block == a.blocks.size()) {
    const std::size_t size = std::max(bytes, kLeastBlock);
    a.blocks.push_back({std::make_unique_for_overwrite<std::byte[]>(size), size});
    a.used = 0;
  }
  void* found = a.blocks[a.block].bytes.get() + a.used;
  a.used += bytes;
  return found;
}

}  // namespace scatter::reflectance
