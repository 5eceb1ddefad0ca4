// The way of one search through the tree, for one instruction set. Included by traverse.cpp only.
// Per-target include guard, as Highway asks for.
#if defined(SCATTER_SEARCH_WALK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SCATTER_SEARCH_WALK_INL_H
#undef SCATTER_SEARCH_WALK_INL_H
#else
#define SCATTER_SEARCH_WALK_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <bit>
#include <cmath>
#include <cstdint>

#include "host_sdk/reflectance/search/found-inl.h"

HWY_BEFORE_NAMESPACE();
namespace scatter::search::HWY_NAMESPACE {
namespace {

HWY_INLINE bool is_finite(const Point& p) {
  return std::isfinite(p.x_i) && std::isfinite(p.y_i) && std::isfinite(p.x_o) && std::isfinite(p.y_o);
}

// A node on the way, with the distances of the children that were not visited.
struct alignas(64) Step {
  float distance[kFanOut];
  float incident[kFanOut];  // Part of omega_i; set where a child shares it.
  const Node* node;
  std::uint32_t left;  // One bit per child not visited.
};

// Bytes: the points of a common leaf, the boxes of a node; the same of a leaf that shares omega_i.
constexpr std::size_t kPrefetched = 704;
constexpr std::size_t kPrefetchedShared = 384;
constexpr std::size_t kTooMany = 6;  // More than wanted that are not worth another cut.
constexpr int kMostCuts = 6;
constexpr int kAnyOrder =
    4;  // So many children are left in the order they have: sorting out the nearest costs more.

// Which of the first `count` distances are at most `limit`; anything for those behind them.
HWY_INLINE std::uint64_t at_most(const float* distances, std::size_t count, float limit) {
  const FloatVector most = hn::Set(kFloats, limit);
  std::uint64_t near = 0;
  for (std::size_t n = 0; n < count; n += kLanes) {
    near |= std::uint64_t{bits_of(hn::Le(hn::Load(kFloats, distances + n), most))} << n;
  }
  return near;
}

// Distances to the points of a leaf, and which are at most `worst`.
HWY_INLINE std::uint64_t measure(const Query& q, const Leaf& leaf, float incident, float worst,
                                 float* distances) {
  const std::size_t slots = leaf_slots(leaf.count);
  const FloatVector limit = hn::Set(kFloats, worst);
  hwy::Prefetch(leaf.ids());
  hwy::Prefetch(leaf.ids() + 16);
  std::uint64_t near = 0;
  if (leaf.shared) {
    const FloatVector part = hn::Set(kFloats, incident);
    for (std::size_t k = 0; k < leaf.count; k += kLanes) {
      const FloatVector d = to_shared_points(q, part, leaf.block + k, slots);
      hn::Store(d, kFloats, distances + k);
      near |= std::uint64_t{bits_of(hn::Le(d, limit))} << k;
    }
  } else {
    for (std::size_t k = 0; k < leaf.count; k += kLanes) {
      const FloatVector d = to_points(q, leaf.block + k, slots);
      hn::Store(d, kFloats, distances + k);
      near |= std::uint64_t{bits_of(hn::Le(d, limit))} << k;
    }
  }
  return near & (~std::uint64_t{0} >> (kLeafCapacity - leaf.count));
}

// Returns whether anything was taken in.
template <typename Nearest>
HWY_INLINE bool scan(const Query& q, const Leaf& leaf, float incident, Nearest& nearest) {
  alignas(64) float distances[kLeafCapacity];
  const std::uint64_t near = measure(q, leaf, incident, nearest.worst(), distances);
  if (near != 0) {
    nearest.take(near, distances, leaf);
  }
  return near != 0;
}

// While nothing limits the distance: of the points of a leaf the `wanted` nearest and few more. The
// limit is sought between the least and the greatest distance, where so many lie below it.
template <typename Nearest>
HWY_INLINE void scan_first(const Query& q, const Leaf& leaf, float incident, Nearest& nearest) {
  alignas(64) float distances[kLeafCapacity] = {};
  std::uint64_t near = measure(q, leaf, incident, nearest.worst(), distances);
  const std::size_t wanted = nearest.wanted();
  if (static_cast<std::size_t>(std::popcount(near)) <= wanted + kTooMany) {
    if (near != 0) {
      nearest.take(near, distances, leaf);
    }
    return;
  }
  if constexpr (Nearest::kPlaces) {
    if (leaf.count <= kPlaced) {
      nearest.place(near, distances, leaf.ids(), leaf.count);
      return;
    }
  }
  FloatVector least = hn::Load(kFloats, distances);
  FloatVector most = hn::Zero(kFloats);
  for (std::size_t n = 0; n < leaf.count; n += kLanes) {
    const FloatVector d = hn::Load(kFloats, distances + n);
    const auto valid = hn::FirstN(kFloats, leaf.count - n);
    least = hn::Min(least, hn::IfThenElse(valid, d, least));
    most = hn::Max(most, hn::IfThenElse(valid, d, most));
  }
  float low = hn::GetLane(hn::MinOfLanes(kFloats, least));
  float high = hn::GetLane(hn::MaxOfLanes(kFloats, most));
  auto below_low = 0.0F;
  auto below_high = static_cast<float>(leaf.count);
  const auto goal = static_cast<float>(wanted + kTooMany / 2);
  const std::uint64_t all = near;
  for (int n = 0; n < kMostCuts; ++n) {
    const float limit = low + (high - low) * ((goal - below_low) / (below_high - below_low));
    const std::uint64_t below = all & at_most(distances, leaf.count, limit);
    const auto count = static_cast<std::size_t>(std::popcount(below));
    if (count < wanted) {
      low = limit;
      below_low = static_cast<float>(count);
      continue;
    }
    near = below;
    if (count <= wanted + kTooMany) {
      break;
    }
    high = limit;
    below_high = static_cast<float>(count);
  }
  nearest.take(near, distances, leaf);
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

// What will be read of a child.
HWY_INLINE void prefetch_child(const Node& node, std::size_t c) {
  if (!node.is_shared(c)) {
    prefetch(node.child[c], kPrefetched);
  } else if (node.is_leaf(c)) {
    prefetch(node.child[c], kPrefetchedShared);
  } else {
    const Node& child = *node.node(c);
    prefetch(static_cast<const void*>(child.lo[2]), 2 * sizeof child.lo[2]);
    prefetch(static_cast<const void*>(child.hi[2]), 2 * sizeof child.hi[2]);
  }
}

// Lane with the least of the distances that `near` marks, to within a few units in their last place: which
// child comes first decides nothing but the speed. In the low bits of each distance goes its lane.
class LeastLane {
 public:
  HWY_INLINE LeastLane() : least_(hn::Set(kInts, 0xFFFFFFFFU)) {}
  HWY_INLINE void look(FloatVector distance, hn::Mask<Floats> near, std::size_t first) {
    const auto lane = hn::Iota(kInts, static_cast<std::uint32_t>(first));
    const auto packed = hn::Or(hn::AndNot(hn::Set(kInts, kFanOut - 1), hn::BitCast(kInts, distance)), lane);
    const auto none = hn::Set(kInts, 0xFFFFFFFFU);
    least_ = hn::Min(least_, hn::IfThenElse(hn::RebindMask(kInts, near), packed, none));
  }
  [[nodiscard]] HWY_INLINE std::size_t get() const {
    return hn::GetLane(hn::MinOfLanes(kInts, least_)) % kFanOut;
  }

 private:
  static constexpr hn::RebindToUnsigned<Floats> kInts{};
  hn::Vec<hn::RebindToUnsigned<Floats>> least_;
};

// Of a child that was entered, the child to visit first, if any is left. kAll: `worst` excludes nothing.
// kShared: all points below share omega_i, whose part of the distance is `shared`.
template <bool kAll, bool kShared>
HWY_INLINE std::size_t enter(const Query& q, const Node& node, float shared, float worst, Step& step) {
  // What is read after the boxes comes along with them.
  prefetch(static_cast<const void*>(node.child), sizeof node.child + sizeof node.points);
  const FloatVector limit = hn::Set(kFloats, worst);
  const std::uint32_t children = 0xFFFFU >> (kFanOut - node.children);
  std::uint32_t near = 0;
  LeastLane least;
  for (std::size_t s = 0; s < kSteps; ++s) {
    const FloatVector incident = kShared ? hn::Set(kFloats, shared) : to_incident_sides(q, node, s * kLanes);
    const FloatVector d = hn::Add(incident, to_outgoing_sides(q, node, s * kLanes));
    hn::Store(incident, kFloats, step.incident + s * kLanes);
    hn::Store(d, kFloats, step.distance + s * kLanes);
    auto mask = mask_of(children >> (s * kLanes));
    if constexpr (!kAll) {
      mask = hn::And(hn::Le(d, limit), mask);
    }
    near |= bits_of(mask) << (s * kLanes);
    least.look(d, mask, s * kLanes);
  }
  step.node = &node;
  step.left = near;
  return least.get();
}

// Enters child c of the node of `step`; the next step is that child's.
template <bool kAll>
HWY_INLINE std::size_t enter_child(const Query& q, std::size_t c, float worst, Step*& step) {
  const Node& node = *step->node;
  const Node& child = *node.node(c);
  const float incident = step->incident[c];
  ++step;
  return node.is_shared(c) ? enter<kAll, true>(q, child, incident, worst, *step)
                           : enter<kAll, false>(q, child, incident, worst, *step);
}

// Child to visit next among those that `among` marks, if any.
HWY_INLINE std::size_t next_of(const float* distance, std::uint32_t among) {
  if (std::popcount(among) <= kAnyOrder) {
    return static_cast<std::size_t>(std::countr_zero(among)) % kFanOut;
  }
  LeastLane least;
  for (std::size_t s = 0; s < kSteps; ++s) {
    least.look(hn::Load(kFloats, distance + s * kLanes), mask_of(among >> (s * kLanes)), s * kLanes);
  }
  return least.get();
}

// Depth first, the nearest child first; what cannot hold anything near enough is never entered.
template <typename Nearest>
HWY_INLINE void walk(const Node* root, const Point& query, Nearest& nearest, Step* steps) {
  const Query q = spread(query);
  Step* step = steps;
  std::size_t c = 0;
  if (nearest.worst() == kInfinity) {
    // Straight down to the nearest leaf.
    c = enter<true, false>(q, *root, 0, kInfinity, *step);
    step->left &= ~(1U << c);
    while (!step->node->is_leaf(c)) {
      c = enter_child<true>(q, c, kInfinity, step);
      step->left &= ~(1U << c);
    }
    scan_first(q, step->node->leaf(c), step->incident[c], nearest);
    step->left = near_children(*step, nearest.worst());
    c = next_of(step->distance, step->left);
  } else {
    c = enter<false, false>(q, *root, 0, nearest.worst(), *step);
  }
  for (;;) {
    while (step->left == 0) {
      if (step == steps) {
        return;
      }
      --step;
      step->left = near_children(*step, nearest.worst());
      c = next_of(step->distance, step->left);
    }
    step->left &= ~(1U << c);
    const Node& node = *step->node;
    if (step->left != 0) {
      prefetch_child(node, static_cast<std::size_t>(std::countr_zero(step->left)));
    }
    if (!node.is_leaf(c)) {
      c = enter_child<false>(q, c, nearest.worst(), step);
      continue;
    }
    if (scan(q, node.leaf(c), step->incident[c], nearest)) {
      step->left = near_children(*step, nearest.worst());
    }
    c = next_of(step->distance, step->left);
  }
}

}  // namespace
}  // namespace scatter::search::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
