// Compiled once per instruction set (Highway); the best that the processor has is taken at run time.
// Contraction to fused operations is off in this file: distances are the same on every machine.
#include "host_sdk/reflectance/search/traverse.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "host_sdk/reflectance/search/traverse.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scatter::search::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 16>;
using Keys = hn::CappedTag<double, 8>;
constexpr Floats kFloats;
constexpr Keys kKeys;
using FloatVector = hn::Vec<Floats>;
using KeyVector = hn::Vec<Keys>;
constexpr std::size_t kLanes = hn::MaxLanes(kFloats);
constexpr std::size_t kKeyLanes = hn::MaxLanes(kKeys);
constexpr std::size_t kSteps = kFanOut / kLanes;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A neighbour as one number that sorts by (distance, id): the bits of the distance above those of
// the id, read as a positive double, because minimum and maximum of doubles exist everywhere. The
// distance is lifted by one step of a double's exponent: no key is subnormal, so that a caller's
// flush-to-zero mode changes nothing; even an infinite distance makes a finite key.
constexpr std::uint32_t kLift = 0x00100000;
constexpr double kNoKey = std::numeric_limits<double>::max();

HWY_INLINE double key_of(std::uint32_t distance_bits, std::uint32_t id) {
  return std::bit_cast<double>(std::uint64_t{distance_bits + kLift} << 32 | id);
}
HWY_INLINE float distance_of(double key) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(key) >> 32) - kLift);
}
HWY_INLINE Neighbor neighbor_of(double key) {
  return {distance_of(key), static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(key))};
}

struct Query {
  FloatVector x[kAxes];
};

HWY_INLINE Query spread(const Point& p) {
  return {
      {hn::Set(kFloats, p.x_i), hn::Set(kFloats, p.y_i), hn::Set(kFloats, p.x_o), hn::Set(kFloats, p.y_o)}};
}

HWY_INLINE FloatVector sum_of_squares(FloatVector a, FloatVector b, FloatVector c, FloatVector d) {
  return hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Add(hn::Mul(c, c), hn::Mul(d, d)));
}

// To the points of a leaf: exactly distance_squared.
HWY_INLINE FloatVector to_points(const Query& q, const float* first, std::size_t slots) {
  return sum_of_squares(hn::Sub(q.x[0], hn::LoadU(kFloats, first)),
                        hn::Sub(q.x[1], hn::LoadU(kFloats, first + slots)),
                        hn::Sub(q.x[2], hn::LoadU(kFloats, first + 2 * slots)),
                        hn::Sub(q.x[3], hn::LoadU(kFloats, first + 3 * slots)));
}

// To the boxes of a node. Rounding is monotonic and the operations are those of to_points, so that
// no point in a box is ever nearer than this.
HWY_INLINE FloatVector to_boxes(const Query& q, const Node& node, std::size_t first) {
  const auto along = [&](std::size_t a) HWY_ATTR {
    const FloatVector below = hn::Sub(hn::Load(kFloats, node.lo[a] + first), q.x[a]);
    const FloatVector above = hn::Sub(q.x[a], hn::Load(kFloats, node.hi[a] + first));
    return hn::Max(hn::Max(below, above), hn::Zero(kFloats));
  };
  return sum_of_squares(along(0), along(1), along(2), along(3));
}

// Bit k is set where lane k holds.
template <typename Mask>
HWY_INLINE std::uint32_t bits_of(Mask mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(kFloats, mask, bytes);
  std::uint16_t bits = 0;
  std::memcpy(&bits, bytes, 2);
  return bits;
}

// The nearest so far, at most kCapacity, in registers while a leaf is scanned.
template <std::size_t kCapacity>
class FewNearest {
 public:
  explicit FewNearest(std::size_t k) : last_(k - 1) {
    for (double& key : keys_) {
      key = kNoKey;
    }
  }

  [[nodiscard]] HWY_INLINE float worst() const { return worst_; }
  void limit(float worst) { worst_ = worst; }

  /// Takes in what `bits` marks among `distances`.
  HWY_INLINE void take(std::uint32_t bits, const float* distances, const std::uint32_t* ids) {
    KeyVector key[kVectors];
    for (std::size_t v = 0; v < kVectors; ++v) {
      key[v] = hn::Load(kKeys, keys_ + v * kKeyLanes);
    }
    const auto turn = hn::SetTableIndices(kKeys, kTurn);
    const auto first = hn::FirstN(kKeys, 1);
    do {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      bits &= bits - 1;
      std::uint32_t distance_bits = 0;
      std::memcpy(&distance_bits, distances + lane, 4);
      const KeyVector one = hn::Set(kKeys, key_of(distance_bits, ids[lane]));
      // Insertion into a sorted row without a branch: key'[j] = min(key[j], max(key[j - 1], one)).
      KeyVector carried = hn::Zero(kKeys);
      for (std::size_t v = 0; v < kVectors; ++v) {
        const KeyVector turned = hn::TableLookupLanes(key[v], turn);
        key[v] = hn::Min(key[v], hn::Max(hn::IfThenElse(first, carried, turned), one));
        carried = turned;
      }
    } while (bits != 0);
    for (std::size_t v = 0; v < kVectors; ++v) {
      hn::Store(key[v], kKeys, keys_ + v * kKeyLanes);
    }
    const float last = distance_of(keys_[last_]);
    worst_ = keys_[last_] == kNoKey ? worst_ : std::min(last, worst_);
  }

  std::size_t give(std::size_t k, Neighbor* out) const {
    std::size_t n = 0;
    for (; n < k && keys_[n] != kNoKey; ++n) {
      out[n] = neighbor_of(keys_[n]);
    }
    return n;
  }

 private:
  static constexpr std::size_t kVectors = kCapacity / kKeyLanes;
  // Lane j takes lane j - 1; lane 0 the last, for the vector that follows.
  static constexpr std::int64_t kTurn[8] = {kKeyLanes - 1, 0, 1, 2, 3, 4, 5, 6};

  alignas(64) double keys_[kCapacity];
  float worst_ = kInfinity;
  std::size_t last_ = 0;
};

// Any number of neighbours: a heap with the farthest on top.
class ManyNearest {
 public:
  explicit ManyNearest(std::size_t k, std::vector<double>& room) : k_(k), heap_(room) { heap_.clear(); }

  [[nodiscard]] float worst() const { return worst_; }
  void limit(float worst) { worst_ = worst; }

  void take(std::uint32_t bits, const float* distances, const std::uint32_t* ids) {
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      const double key = key_of(std::bit_cast<std::uint32_t>(distances[lane]), ids[lane]);
      if (heap_.size() < k_) {
        heap_.push_back(key);
        std::push_heap(heap_.begin(), heap_.end());
      } else if (key < heap_.front()) {
        std::pop_heap(heap_.begin(), heap_.end());
        heap_.back() = key;
        std::push_heap(heap_.begin(), heap_.end());
      }
    }
    if (heap_.size() == k_) {
      worst_ = std::min(distance_of(heap_.front()), worst_);
    }
  }

  std::size_t give(std::size_t, Neighbor* out) {
    std::sort_heap(heap_.begin(), heap_.end());
    std::transform(heap_.begin(), heap_.end(), out, neighbor_of);
    return heap_.size();
  }

 private:
  std::size_t k_;
  std::vector<double>& heap_;
  float worst_ = kInfinity;
};

// Everything within a radius.
class Within {
 public:
  Within(float worst, std::vector<Neighbor>& out) : worst_(worst), out_(out) {}

  [[nodiscard]] float worst() const { return worst_; }

  void take(std::uint32_t bits, const float* distances, const std::uint32_t* ids) {
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      out_.push_back({distances[lane], ids[lane]});
    }
  }

 private:
  float worst_;
  std::vector<Neighbor>& out_;
};

// A node on the way, with the distances of the children that were not visited.
struct alignas(64) Step {
  float distance[kFanOut];
  const Node* node;
  std::uint32_t left;  // One bit per child not visited.
};

template <typename Nearest>
HWY_INLINE void scan(const Query& q, const Leaf& leaf, Nearest& nearest) {
  alignas(64) float distances[kLeafCapacity];
  const std::size_t slots = leaf_slots(leaf.count);
  const std::uint32_t* ids = leaf.ids();
  const FloatVector worst = hn::Set(kFloats, nearest.worst());
  std::uint32_t near = 0;
  for (std::size_t k = 0; k < leaf.count; k += kLanes) {
    const FloatVector d = to_points(q, leaf.block + k, slots);
    hn::Store(d, kFloats, distances + k);
    near |= bits_of(hn::Le(d, worst)) << k;
  }
  near &= 0xFFFFFFFFU >> (kLeafCapacity - leaf.count);
  if (near != 0) {
    nearest.take(near, distances, ids);
  }
}

HWY_INLINE void enter(const Query& q, const Node& node, float worst, Step& step) {
  const FloatVector limit = hn::Set(kFloats, worst);
  std::uint32_t near = 0;
  for (std::size_t s = 0; s < kSteps; ++s) {
    const FloatVector d = to_boxes(q, node, s * kLanes);
    hn::Store(d, kFloats, step.distance + s * kLanes);
    near |= bits_of(hn::Le(d, limit)) << (s * kLanes);
  }
  step.node = &node;
  step.left = near & (0xFFFFU >> (kFanOut - node.children));
}

// Nearest of the children left, or kFanOut when none can hold anything.
HWY_INLINE std::size_t next_child(Step& step, float worst) {
  std::uint32_t near = 0;
  const FloatVector limit = hn::Set(kFloats, worst);
  for (std::size_t s = 0; s < kSteps; ++s) {
    near |= bits_of(hn::Le(hn::Load(kFloats, step.distance + s * kLanes), limit)) << (s * kLanes);
  }
  near &= step.left;
  if (near == 0) {
    return kFanOut;
  }
  std::size_t best = static_cast<std::size_t>(std::countr_zero(near));
  for (std::uint32_t rest = near & (near - 1); rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
    best = step.distance[lane] < step.distance[best] ? lane : best;
  }
  step.left = near & ~(1U << best);
  return best;
}

template <typename Nearest>
HWY_INLINE void walk(const Node* root, const Point& query, Nearest& nearest, Step* steps) {
  const Query q = spread(query);
  Step* step = steps;
  enter(q, *root, nearest.worst(), *step);
  for (;;) {
    const std::size_t c = next_child(*step, nearest.worst());
    if (c == kFanOut) {
      if (step == steps) {
        return;
      }
      --step;
      continue;
    }
    const Node& node = *step->node;
    if (node.is_leaf(c)) {
      scan(q, node.leaf(c), nearest);
    } else {
      ++step;
      enter(q, *node.node(c), nearest.worst(), *step);
    }
  }
}

template <std::size_t kCapacity>
std::size_t few(const Tree& tree, const Point& query, std::size_t k, Neighbor* out) {
  Step steps[kMostLevels];
  FewNearest<kCapacity> nearest(k);
  walk(tree.root, query, nearest, steps);
  return nearest.give(k, out);
}

bool is_finite(const Point& p) {
  return std::isfinite(p.x_i) && std::isfinite(p.y_i) && std::isfinite(p.x_o) && std::isfinite(p.y_o);
}

std::size_t nearest_impl(const Tree& tree, const Point& query, std::size_t k, Neighbor* out) {
  if (k == 0 || tree.root == nullptr || !is_finite(query)) {
    return 0;
  }
  if (k <= 8) {
    return few<8>(tree, query, k, out);
  }
  if (k <= 16) {
    return few<16>(tree, query, k, out);
  }
  if (k <= 32) {
    return few<32>(tree, query, k, out);
  }
  Step steps[kMostLevels];
  std::vector<double> room;
  ManyNearest nearest(std::min(k, tree.size), room);
  walk(tree.root, query, nearest, steps);
  return nearest.give(k, out);
}

void nearest_rows_impl(const Tree& tree, const Point* queries, std::size_t count, std::size_t k,
                       Neighbor* out) {
  for (std::size_t n = 0; n < count; ++n) {
    Neighbor* row = out + n * k;
    std::fill(row + nearest_impl(tree, queries[n], k, row), row + k, Neighbor{kInfinity, 0xFFFFFFFFU});
  }
}

void collect_impl(const Tree& tree, const Point& query, float radius_squared, std::vector<Neighbor>& out) {
  if (tree.root == nullptr || !is_finite(query) || !(radius_squared >= 0)) {
    return;
  }
  Step steps[kMostLevels];
  Within within(radius_squared, out);
  walk(tree.root, query, within, steps);
}

}  // namespace
}  // namespace scatter::search::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scatter::search {

HWY_EXPORT(nearest_impl);
HWY_EXPORT(nearest_rows_impl);
HWY_EXPORT(collect_impl);

std::size_t nearest_one(const Tree& tree, const Point& query, std::span<Neighbor> out) {
  return HWY_DYNAMIC_DISPATCH(nearest_impl)(tree, query, out.size(), out.data());
}

void nearest_rows(const Tree& tree, const Point* queries, std::size_t count, std::size_t k, Neighbor* out) {
  HWY_DYNAMIC_DISPATCH(nearest_rows_impl)(tree, queries, count, k, out);
}

void collect_within(const Tree& tree, const Point& query, float radius_squared, std::vector<Neighbor>& out) {
  HWY_DYNAMIC_DISPATCH(collect_impl)(tree, query, radius_squared, out);
}

}  // namespace scatter::search
#endif  // HWY_ONCE
