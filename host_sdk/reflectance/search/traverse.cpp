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

#include <hwy/cache_control.h>

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

constexpr std::size_t kPrefetched = 704;  // Bytes: the points of a common leaf, the boxes of a node.
// A batch stops looking back for a while when a query took in so many points all the same.
constexpr std::size_t kUselessPerNeighbor = 2;
constexpr std::size_t kPause = 16;
constexpr int kFewLanes = 3;  // Up to here a loop over the lanes is faster than a vector's minimum.
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

HWY_INLINE hn::Mask<Floats> mask_of(std::uint32_t bits) {
  std::uint8_t bytes[8] = {};
  std::memcpy(bytes, &bits, 4);
  return hn::LoadMaskBits(kFloats, bytes);
}

// The nearest so far, at most kCapacity, in registers while a leaf is scanned.
template <std::size_t kCapacity>
class FewNearest {
 public:
  explicit FewNearest(std::size_t k) : last_(k - 1) { start(); }

  void start() {
    for (double& key : keys_) {
      key = kNoKey;
    }
    worst_ = kInfinity;
  }

  [[nodiscard]] HWY_INLINE float worst() const { return worst_; }
  void limit(float worst) { worst_ = worst; }

  /// Takes in what `bits` marks among `distances`.
  HWY_INLINE void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    const std::uint32_t* ids = leaf.ids();
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
    set_worst();
  }

  std::size_t give(std::size_t k, Neighbor* out) const {
    std::size_t n = 0;
    for (; n < k && keys_[n] != kNoKey; ++n) {
      out[n] = neighbor_of(keys_[n]);
    }
    return n;
  }

 private:
  HWY_INLINE void set_worst() {
    const double last = keys_[last_];
    worst_ = last == kNoKey ? worst_ : std::min(distance_of(last), worst_);
  }

  static constexpr std::size_t kVectors = kCapacity / kKeyLanes;
  // Lane j takes lane j - 1; lane 0 the last, for the vector that follows.
  static constexpr std::int64_t kTurn[8] = {kKeyLanes - 1, 0, 1, 2, 3, 4, 5, 6};

  alignas(64) double keys_[kCapacity];
  float worst_ = kInfinity;
  std::size_t last_ = 0;
};

// The same, and where the points lie: how far the next query is from them limits its search from
// the start.
template <std::size_t kCapacity>
class RowNearest : public FewNearest<kCapacity> {
 public:
  using FewNearest<kCapacity>::FewNearest;

  void start() {
    FewNearest<kCapacity>::start();
    taken_ = 0;
    count_ = 0;
    full_ = false;
  }

  HWY_INLINE void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    FewNearest<kCapacity>::take(bits, distances, leaf);
    const std::size_t slots = leaf_slots(leaf.count);
    taken_ += static_cast<std::size_t>(std::popcount(bits));
    for (; bits != 0 && count_ < kRoom; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      distance_[count_] = distances[lane];
      for (std::size_t a = 0; a < kAxes; ++a) {
        at_[a][count_] = leaf.block[a * slots + lane];
      }
      ++count_;
    }
    if (count_ == kRoom) {
      forget();
      full_ |= count_ == kRoom;
    }
  }

  /// Points that were taken in since the start.
  [[nodiscard]] std::size_t taken() const { return taken_; }

  /// Upper limit of the k-th distance from another place, infinity when not known.
  HWY_INLINE float limit_at(const Query& q, std::size_t k) {
    forget();
    if (count_ < k || full_) {
      return kInfinity;
    }
    FloatVector most = hn::Zero(kFloats);
    for (std::size_t n = 0; n < count_; n += kLanes) {
      const FloatVector d = sum_of_squares(
          hn::Sub(q.x[0], hn::Load(kFloats, at_[0] + n)), hn::Sub(q.x[1], hn::Load(kFloats, at_[1] + n)),
          hn::Sub(q.x[2], hn::Load(kFloats, at_[2] + n)), hn::Sub(q.x[3], hn::Load(kFloats, at_[3] + n)));
      most = hn::Max(most, hn::IfThenElseZero(hn::FirstN(kFloats, count_ - n), d));
    }
    return hn::GetLane(hn::MaxOfLanes(kFloats, most));
  }

 private:
  static constexpr std::size_t kRoom = 128;

  // Drops what has been pushed out by nearer points.
  HWY_INLINE void forget() {
    std::size_t kept = 0;
    for (std::size_t n = 0; n < count_; ++n) {
      const bool keep = distance_[n] <= this->worst();
      distance_[kept] = distance_[n];
      for (std::size_t a = 0; a < kAxes; ++a) {
        at_[a][kept] = at_[a][n];
      }
      kept += keep ? 1 : 0;
    }
    count_ = kept;
  }

  std::size_t taken_ = 0;
  std::size_t count_ = 0;
  bool full_ = false;
  alignas(64) float distance_[kRoom];
  alignas(64) float at_[kAxes][kRoom];
};

// Any number of neighbours: a heap with the farthest on top.
class ManyNearest {
 public:
  explicit ManyNearest(std::size_t k, std::vector<double>& room) : k_(k), heap_(room) { heap_.clear(); }

  [[nodiscard]] float worst() const { return worst_; }
  void limit(float worst) { worst_ = worst; }

  void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    const std::uint32_t* ids = leaf.ids();
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

  void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    const std::uint32_t* ids = leaf.ids();
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

// Distances to the points of a leaf, and which are at most `worst`.
HWY_INLINE std::uint64_t measure(const Query& q, const Leaf& leaf, float worst, float* distances) {
  const std::size_t slots = leaf_slots(leaf.count);
  const FloatVector limit = hn::Set(kFloats, worst);
  hwy::Prefetch(leaf.ids());
  hwy::Prefetch(leaf.ids() + 16);
  std::uint64_t near = 0;
  for (std::size_t k = 0; k < leaf.count; k += kLanes) {
    const FloatVector d = to_points(q, leaf.block + k, slots);
    hn::Store(d, kFloats, distances + k);
    near |= std::uint64_t{bits_of(hn::Le(d, limit))} << k;
  }
  return near & (~std::uint64_t{0} >> (kLeafCapacity - leaf.count));
}

// Returns whether anything was taken in.
template <typename Nearest>
HWY_INLINE bool scan(const Query& q, const Leaf& leaf, Nearest& nearest) {
  alignas(64) float distances[kLeafCapacity];
  const std::uint64_t near = measure(q, leaf, nearest.worst(), distances);
  if (near != 0) {
    nearest.take(near, distances, leaf);
  }
  return near != 0;
}

// While nothing limits the distance: each group of points is held against what those before it left.
template <typename Nearest>
HWY_INLINE void scan_first(const Query& q, const Leaf& leaf, Nearest& nearest) {
  alignas(64) float distances[kLeafCapacity];
  std::uint64_t left = measure(q, leaf, nearest.worst(), distances);
  for (std::size_t k = 0; k < leaf.count; k += kFanOut) {
    const FloatVector limit = hn::Set(kFloats, nearest.worst());
    std::uint64_t near = 0;
    for (std::size_t s = 0; s < kFanOut; s += kLanes) {
      near |= std::uint64_t{bits_of(hn::Le(hn::Load(kFloats, distances + k + s), limit))} << (k + s);
    }
    near &= left;
    if (near != 0) {
      nearest.take(near, distances, leaf);
    }
  }
}

// Children that may hold something at most `worst` away.
HWY_INLINE std::uint32_t near_children(const Step& step, float worst) {
  const FloatVector limit = hn::Set(kFloats, worst);
  std::uint32_t near = 0;
  for (std::size_t s = 0; s < kSteps; ++s) {
    near |= bits_of(hn::Le(hn::Load(kFloats, step.distance + s * kLanes), limit)) << (s * kLanes);
  }
  return near & step.left;
}

HWY_INLINE void prefetch(const void* at, std::size_t bytes) {
  const auto* line = static_cast<const std::uint8_t*>(at);
  for (std::size_t n = 0; n < bytes; n += 64) {
    hwy::Prefetch(line + n);
  }
}

HWY_INLINE void enter(const Query& q, const Node& node, float worst, Step& step) {
  // What is read after the boxes comes along with them.
  prefetch(node.child, sizeof node.child + sizeof node.points);
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

// Lane with the least of the distances that `among` marks.
HWY_INLINE std::size_t least_of(const float* distance, std::uint32_t among) {
  if (std::popcount(among) <= kFewLanes) {
    auto best = static_cast<std::size_t>(std::countr_zero(among));
    for (std::uint32_t rest = among & (among - 1); rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      best = distance[lane] < distance[best] ? lane : best;
    }
    return best;
  }
  FloatVector least = hn::Set(kFloats, kInfinity);
  for (std::size_t s = 0; s < kSteps; ++s) {
    const auto mask = mask_of(among >> (s * kLanes));
    least = hn::Min(least, hn::IfThenElse(mask, hn::Load(kFloats, distance + s * kLanes), least));
  }
  least = hn::MinOfLanes(kFloats, least);
  std::uint32_t equal = 0;
  for (std::size_t s = 0; s < kSteps; ++s) {
    equal |= bits_of(hn::Eq(hn::Load(kFloats, distance + s * kLanes), least)) << (s * kLanes);
  }
  return static_cast<std::size_t>(std::countr_zero(equal & among));
}

// Depth first, the nearest child first; what cannot hold anything near enough is never entered.
template <typename Nearest>
HWY_INLINE void walk(const Node* root, const Point& query, Nearest& nearest, Step* steps) {
  const Query q = spread(query);
  Step* step = steps;
  enter(q, *root, nearest.worst(), *step);
  bool first = nearest.worst() == kInfinity;
  for (;;) {
    if (step->left == 0) {
      if (step == steps) {
        return;
      }
      --step;
      step->left = near_children(*step, nearest.worst());
      continue;
    }
    const std::size_t c = least_of(step->distance, step->left);
    step->left &= ~(1U << c);
    const Node& node = *step->node;
    if (!first && step->left != 0) {
      prefetch(node.child[std::countr_zero(step->left)], kPrefetched);
    }
    if (!node.is_leaf(c)) {
      ++step;
      enter(q, *node.node(c), nearest.worst(), *step);
      continue;
    }
    const Leaf leaf = node.leaf(c);
    if (first) {
      first = false;
      scan_first(q, leaf, nearest);
      step->left = near_children(*step, nearest.worst());
    } else if (scan(q, leaf, nearest)) {
      step->left = near_children(*step, nearest.worst());
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

template <std::size_t kCapacity>
void few_rows(const Tree& tree, const Point* queries, std::size_t count, std::size_t k, Neighbor* out) {
  Step steps[kMostLevels];
  FewNearest<kCapacity> alone(k);
  // The one in use and the one before it.
  RowNearest<kCapacity> nearest[2] = {RowNearest<kCapacity>(k), RowNearest<kCapacity>(k)};
  bool known = false;
  std::size_t pause = 0;  // Queries to come for which looking back does not pay.
  for (std::size_t n = 0; n < count; ++n) {
    Neighbor* row = out + n * k;
    std::size_t found = 0;
    if (!is_finite(queries[n])) {
      known = false;
    } else if (pause > 0) {
      --pause;
      alone.start();
      walk(tree.root, queries[n], alone, steps);
      found = alone.give(k, row);
    } else {
      RowNearest<kCapacity>& now = nearest[n % 2];
      now.start();
      if (known) {
        now.limit(nearest[1 - n % 2].limit_at(spread(queries[n]), k));
      }
      walk(tree.root, queries[n], now, steps);
      found = now.give(k, row);
      pause = known && now.taken() > kUselessPerNeighbor * k ? kPause : 0;
      known = pause == 0 && found == k;
    }
    std::fill(row + found, row + k, Neighbor{kInfinity, 0xFFFFFFFFU});
  }
}

void nearest_rows_impl(const Tree& tree, const Point* queries, std::size_t count, std::size_t k,
                       Neighbor* out) {
  if (tree.root != nullptr && k >= 1 && k <= 32) {
    if (k <= 8) {
      few_rows<8>(tree, queries, count, k, out);
    } else if (k <= 16) {
      few_rows<16>(tree, queries, count, k, out);
    } else {
      few_rows<32>(tree, queries, count, k, out);
    }
    return;
  }
  for (std::size_t n = 0; n < count; ++n) {
    Neighbor* row = out + n * k;
    std::fill(row + nearest_impl(tree, queries[n], k, row), row + k, Neighbor{kInfinity, 0xFFFFFFFFU});
  }
}

std::uint32_t around_impl(const Node& node, const Point& p) {
  Step step;
  enter(spread(p), node, 0.0F, step);
  return step.left;
}

std::size_t nearest_child_impl(const Node& node, const Point& p) {
  Step step;
  enter(spread(p), node, kInfinity, step);
  return least_of(step.distance, step.left);
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
HWY_EXPORT(around_impl);
HWY_EXPORT(nearest_child_impl);

std::uint32_t children_around(const Node& node, const Point& p) {
  return HWY_DYNAMIC_DISPATCH(around_impl)(node, p);
}

std::size_t nearest_child(const Node& node, const Point& p) {
  return HWY_DYNAMIC_DISPATCH(nearest_child_impl)(node, p);
}

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
