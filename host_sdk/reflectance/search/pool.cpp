#include <algorithm>
#include <new>

#include "host_sdk/memory/huge_pages.h"
#include "host_sdk/reflectance/search/tree.h"

namespace scatter::search {

namespace {

constexpr std::size_t kLine = 64;
// What may be read past the last block of a chunk.
constexpr std::size_t kMargin = 64;
constexpr std::size_t kSmallestChunk = 4096;

}  // namespace

void Pool::Release::operator()(std::byte* chunk) const noexcept {
  ::operator delete(chunk, std::align_val_t{kLine});
}

void* Pool::cut(std::size_t bytes, std::size_t alignment) {
  const auto aligned = [&](std::byte* p) {
    const auto address = reinterpret_cast<std::uintptr_t>(p);
    return p + ((alignment - address % alignment) % alignment);
  };
  std::byte* at = begin_ == nullptr ? nullptr : aligned(begin_);
  if (at == nullptr || at > end_ || static_cast<std::size_t>(end_ - at) < bytes) {
    // Chunks of 1/32 of what is there keep the unused part below 3 %.
    const std::size_t size = std::max({kSmallestChunk, bytes_ / 32, next_chunk_, bytes}) + kMargin;
    next_chunk_ = 0;
    auto* chunk = static_cast<std::byte*>(::operator new(size, std::align_val_t{kLine}));
    // A search jumps about in all of the tree; with pages of 4 KiB most jumps in a large one would also
    // miss the processor's table of pages.
    ask_for_huge_pages(chunk, size);
    chunks_.emplace_back(chunk);
    std::fill_n(chunk + (size - kMargin), kMargin, std::byte{0});
    bytes_ += size;
    begin_ = chunk;
    end_ = chunk + (size - kMargin);
    at = chunk;
  }
  begin_ = at + bytes;
  return at;
}

Node* Pool::new_node() {
  void* block = free_nodes_;
  if (free_nodes_ != nullptr) {
    free_nodes_ = free_nodes_->next;
  } else {
    block = cut(sizeof(Node), alignof(Node));
  }
  Node* node = new (block) Node;
  node->children = 0;
  node->shared = 0;
  return node;
}

float* Pool::new_leaf(std::size_t count, bool shared) {
  const std::size_t bytes = leaf_bytes(count, shared);
  FreeBlock*& list = free_leaves_[bytes / 16];
  if (list != nullptr) {
    FreeBlock* block = list;
    list = block->next;
    return reinterpret_cast<float*>(block);
  }
  return static_cast<float*>(cut(bytes, sizeof(float) * 4));
}

void Pool::free_node(Node* node) noexcept {
  free_nodes_ = new (node) FreeBlock{free_nodes_};
}

void Pool::free_leaf(const Leaf& leaf) noexcept {
  FreeBlock*& list = free_leaves_[leaf_bytes(leaf.count, leaf.shared) / 16];
  list = new (leaf.block) FreeBlock{list};
}

}  // namespace scatter::search
