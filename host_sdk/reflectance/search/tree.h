// The R-tree in memory: nodes, leaves and the pool that holds both. Internal to search/.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "host_sdk/reflectance/search/neighbor_index.h"

namespace scatter::search {

inline constexpr std::size_t kFanOut = 16;
inline constexpr std::size_t kLeafCapacity = 64;
inline constexpr std::size_t kAxes = 4;
/// Of nodes above one another. Bulk construction needs 8 for 2^32 points; a tree that changes in an
/// unlucky way would grow past it and is built anew instead.
inline constexpr std::size_t kMostLevels = 16;

/// Closed box; the default contains nothing.
struct Box {
  std::array<float, kAxes> lo{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
                              std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};
  std::array<float, kAxes> hi{
      -std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
      -std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};

  [[nodiscard]] bool operator==(const Box&) const noexcept = default;
};

/// Whether all that the box holds shares omega_i.
[[nodiscard]] constexpr bool shares_incidence(const Box& b) noexcept {
  return b.lo[0] == b.hi[0] && b.lo[1] == b.hi[1];
}

/// A leaf is one block of floats: component arrays of `leaf_slots(count)` elements each, then as many
/// ids. A mixed leaf has all four components; one whose points share omega_i has only those of
/// omega_o, the others stand in its box. Count and kind are kept by the node above. Blocks may be
/// read 64 bytes past their end.
[[nodiscard]] constexpr std::size_t leaf_slots(std::size_t count) noexcept {
  return (count + 3) & ~std::size_t{3};
}
[[nodiscard]] constexpr std::size_t leaf_bytes(std::size_t count, bool shared) noexcept {
  return leaf_slots(count) * ((shared ? 2 : kAxes) * sizeof(float) + sizeof(std::uint32_t));
}

/// Leaf seen with its count and kind.
struct Leaf {
  float* block = nullptr;
  std::size_t count = 0;
  bool shared = false;  ///< One omega_i for all points.
  float x_i = 0;        ///< Where shared.
  float y_i = 0;

  [[nodiscard]] float* x_o() const noexcept { return block + (shared ? 0 : 2) * leaf_slots(count); }
  [[nodiscard]] float* y_o() const noexcept { return x_o() + leaf_slots(count); }
  [[nodiscard]] std::uint32_t* ids() const noexcept {
    return reinterpret_cast<std::uint32_t*>(x_o() + 2 * leaf_slots(count));
  }
  [[nodiscard]] Point point(std::size_t k) const noexcept {
    return {shared ? x_i : block[k], shared ? y_i : block[leaf_slots(count) + k], x_o()[k], y_o()[k]};
  }
  /// The point has the leaf's omega_i where that is shared.
  void put(std::size_t k, const Point& p, std::uint32_t id) const noexcept {
    if (!shared) {
      block[k] = p.x_i;
      block[leaf_slots(count) + k] = p.y_i;
    }
    x_o()[k] = p.x_o;
    y_o()[k] = p.y_o;
    ids()[k] = id;
  }
};

/// Up to 16 children, each a leaf or a node, with their tight boxes side by side.
struct alignas(64) Node {
  float lo[kAxes][kFanOut];
  float hi[kAxes][kFanOut];
  void* child[kFanOut];
  std::uint8_t points[kFanOut];  ///< Of a leaf, 1..64; 0: the child is a node.
  std::uint16_t children;        ///< 1..16; the lanes from here on hold anything.
  /// One bit per child. Of a leaf: it has that layout. Of a node: only set where all its points share
  /// omega_i, so that the incident part of the distance is the same everywhere below.
  std::uint16_t shared;

  [[nodiscard]] bool is_leaf(std::size_t c) const noexcept { return points[c] != 0; }
  [[nodiscard]] bool is_shared(std::size_t c) const noexcept { return (shared >> c & 1U) != 0; }
  [[nodiscard]] Leaf leaf(std::size_t c) const noexcept {
    return {static_cast<float*>(child[c]), points[c], is_shared(c), lo[0][c], lo[1][c]};
  }
  [[nodiscard]] Node* node(std::size_t c) const noexcept { return static_cast<Node*>(child[c]); }
  [[nodiscard]] Box box(std::size_t c) const noexcept {
    Box b;
    for (std::size_t a = 0; a < kAxes; ++a) {
      b.lo[a] = lo[a][c];
      b.hi[a] = hi[a][c];
    }
    return b;
  }
  void set_box(std::size_t c, const Box& b) noexcept {
    for (std::size_t a = 0; a < kAxes; ++a) {
      lo[a][c] = b.lo[a];
      hi[a][c] = b.hi[a];
    }
  }
  void set_shared(std::size_t c, bool on) noexcept {
    shared = static_cast<std::uint16_t>((shared & ~(1U << c)) | (on ? 1U : 0U) << c);
  }
  void hang(std::size_t c, const Leaf& leaf) noexcept {
    child[c] = leaf.block;
    points[c] = static_cast<std::uint8_t>(leaf.count);
    set_shared(c, leaf.shared);
  }
  void hang(std::size_t c, Node* node, const Box& b) noexcept {
    child[c] = node;
    points[c] = 0;
    set_box(c, b);
    set_shared(c, shares_incidence(b));
  }
};

/// Memory of one tree: blocks cut from large chunks, free blocks kept in one list per size.
class Pool {
 public:
  Pool() = default;
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;
  Pool(Pool&&) noexcept = default;
  Pool& operator=(Pool&&) noexcept = default;
  ~Pool() = default;

  /// The next chunk has at least this size: a bulk build asks for what it needs.
  void reserve(std::size_t bytes) { next_chunk_ = bytes > next_chunk_ ? bytes : next_chunk_; }
  [[nodiscard]] Node* new_node();
  [[nodiscard]] float* new_leaf(std::size_t count, bool shared);
  void free_node(Node* node) noexcept;
  void free_leaf(const Leaf& leaf) noexcept;
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

 private:
  struct FreeBlock {
    FreeBlock* next = nullptr;
  };
  struct Release {
    void operator()(std::byte* chunk) const noexcept;
  };
  [[nodiscard]] void* cut(std::size_t bytes, std::size_t alignment);

  std::vector<std::unique_ptr<std::byte, Release>> chunks_;
  std::byte* begin_ = nullptr;  ///< Of what is left of the last chunk.
  std::byte* end_ = nullptr;
  std::size_t next_chunk_ = 0;
  std::size_t bytes_ = 0;
  std::array<FreeBlock*, leaf_bytes(kLeafCapacity, false) / 16 + 1> free_leaves_{};  ///< By bytes / 16.
  FreeBlock* free_nodes_ = nullptr;
};

/// The whole structure.
struct Tree {
  Pool pool;
  Node* root = nullptr;  ///< nullptr when empty.
  std::size_t size = 0;
  std::size_t changes = 0;  ///< Additions and removals since the tree was built in bulk.
  std::size_t levels = 0;   ///< Most nodes on a way down, or more; at most kMostLevels.
};

}  // namespace scatter::search
