// Rows of neighbours for queries that lie near one another, for one instruction set. Included by
// traverse.cpp only.
// Per-target include guard, as Highway asks for.
#if defined(SCATTER_SEARCH_ROWS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SCATTER_SEARCH_ROWS_INL_H
#undef SCATTER_SEARCH_ROWS_INL_H
#else
#define SCATTER_SEARCH_ROWS_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/reflectance/search/walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace scatter::search::HWY_NAMESPACE {
namespace {

constexpr std::size_t kGroup = 32;      // Most queries that look through the same leaves,
constexpr std::size_t kEnough = 16;     // and how many do not wait for those of the next leaf.
constexpr std::size_t kLeastGroup = 4;  // Fewer walk alone.
constexpr std::size_t kMostLeaves = 128;
constexpr std::size_t kBits = 64;    // Leaves that one mask tells of.
constexpr std::size_t kMerged = 15;  // Candidates that merging takes less time for than ranking.
constexpr float kTighter = 0.98F;
constexpr float kWider = 1.2F;
constexpr float kMostStretch = 4;
constexpr float kRounding = 1e-5F;  // Far above that of a distance, relative.

// Queries side by side, and what each of them has found at the least: k points in a box.
struct Group {
  Box queries;
  Box points;
  std::array<float, kAxes>
      far_lo{};  // Squared, from the lower side of `queries` to the far side of `points`.
  std::array<float, kAxes> far_hi{};
  float reach = 0;  // No query looks farther, squared.
  float slack = 0;
};

// Leaves that may hold a neighbour of a query of the group.
struct Shortlist {
  alignas(64) float lo[kAxes][kMostLeaves];
  alignas(64) float hi[kAxes][kMostLeaves];
  Leaf leaf[kMostLeaves];
  std::size_t count = 0;
};

// One bit per lane whose box may hold a neighbour. Along an axis a query q is in front of the box by
// d(q) and has its points within f(q); of d^2 - f^2, which is linear or concave between the ends of
// the two intervals, the least value is at one of these ends. Where the sum of these over the axes is
// positive, every query has k points nearer than the box. An axis in which the box and the points
// agree, as omega_i within an incidence, adds nothing, however far away the queries are.
HWY_INLINE std::uint32_t lanes_for(const Group& group, const Node& node, std::size_t first) {
  FloatVector excess = hn::Zero(kFloats);
  FloatVector apart = hn::Zero(kFloats);
  for (std::size_t a = 0; a < kAxes; ++a) {
    const FloatVector lo = hn::Load(kFloats, node.lo[a] + first);
    const FloatVector hi = hn::Load(kFloats, node.hi[a] + first);
    const FloatVector least = hn::Set(kFloats, group.queries.lo[a]);
    const FloatVector most = hn::Set(kFloats, group.queries.hi[a]);
    const auto in_front = [&](FloatVector q) HWY_ATTR {
      const FloatVector d = hn::Max(hn::Max(hn::Sub(lo, q), hn::Sub(q, hi)), hn::Zero(kFloats));
      return hn::Mul(d, d);
    };
    const auto beyond_far = [&](FloatVector q) HWY_ATTR {
      const FloatVector f = hn::Max(hn::Sub(q, hn::Set(kFloats, group.points.lo[a])),
                                    hn::Sub(hn::Set(kFloats, group.points.hi[a]), q));
      return hn::Sub(in_front(q), hn::Mul(f, f));
    };
    const FloatVector at_ends = hn::Min(hn::Sub(in_front(least), hn::Set(kFloats, group.far_lo[a])),
                                        hn::Sub(in_front(most), hn::Set(kFloats, group.far_hi[a])));
    const FloatVector at_sides =
        hn::Min(beyond_far(hn::Min(hn::Max(lo, least), most)), beyond_far(hn::Min(hn::Max(hi, least), most)));
    excess = hn::Add(excess, hn::Min(at_ends, at_sides));
    const FloatVector gap = hn::Max(hn::Max(hn::Sub(lo, most), hn::Sub(least, hi)), hn::Zero(kFloats));
    apart = hn::Add(apart, hn::Mul(gap, gap));
  }
  const auto out =
      hn::Or(hn::Gt(excess, hn::Set(kFloats, group.slack)), hn::Gt(apart, hn::Set(kFloats, group.reach)));
  return ~bits_of(out) & ((1U << kLanes) - 1);
}

// False when there are too many.
HWY_INLINE bool collect(const Node* root, const Group& group, Shortlist& list) {
  const Node* waiting[kMostLeaves];
  std::size_t count = 0;
  waiting[count++] = root;
  list.count = 0;
  while (count > 0) {
    const Node& node = *waiting[--count];
    std::uint32_t lanes = 0;
    for (std::size_t s = 0; s < kSteps; ++s) {
      lanes |= lanes_for(group, node, s * kLanes) << (s * kLanes);
    }
    for (lanes &= 0xFFFFU >> (kFanOut - node.children); lanes != 0; lanes &= lanes - 1) {
      const auto c = static_cast<std::size_t>(std::countr_zero(lanes));
      if (!node.is_leaf(c)) {
        if (count == kMostLeaves) {
          return false;
        }
        prefetch_child(node, c);
        waiting[count++] = node.node(c);
        continue;
      }
      if (list.count == kMostLeaves) {
        return false;
      }
      prefetch_child(node, c);
      for (std::size_t a = 0; a < kAxes; ++a) {
        list.lo[a][list.count] = node.lo[a][c];
        list.hi[a][list.count] = node.hi[a][c];
      }
      list.leaf[list.count++] = node.leaf(c);
    }
  }
  return true;
}

// How far a query is from the boxes of a list.
struct Sides {
  alignas(64) float distance[kMostLeaves];
  alignas(64) float incident[kMostLeaves];  // Part of omega_i.
  std::size_t nearest = 0;
};

// Among kBits of them.
HWY_INLINE std::uint64_t leaves_within(const Shortlist& list, const Sides& sides, float limit,
                                       std::size_t from) {
  const std::size_t count = std::min(list.count - from, kBits);
  return at_most(sides.distance + from, count, limit) & (~std::uint64_t{0} >> (kBits - count));
}

HWY_INLINE void measure_sides(const Shortlist& list, const Query& q, Sides& sides) {
  FloatVector least = hn::Set(kFloats, kInfinity);
  for (std::size_t n = 0; n < list.count; n += kLanes) {
    const auto side = [&](std::size_t a) HWY_ATTR { return to_side(q.x[a], list.lo[a] + n, list.hi[a] + n); };
    const FloatVector part = hn::Add(side(0), side(1));
    const FloatVector d = hn::Add(part, hn::Add(side(2), side(3)));
    hn::Store(part, kFloats, sides.incident + n);
    hn::Store(d, kFloats, sides.distance + n);
    least = hn::Min(least, hn::IfThenElse(hn::FirstN(kFloats, list.count - n), d, least));
  }
  const float nearest = hn::GetLane(hn::MinOfLanes(kFloats, least));
  std::size_t from = 0;
  while (from + kBits < list.count && leaves_within(list, sides, nearest, from) == 0) {
    from += kBits;
  }
  sides.nearest =
      from + static_cast<std::size_t>(std::countr_zero(leaves_within(list, sides, nearest, from)));
}

// Points near enough, not sorted.
struct Candidates {
  static constexpr std::size_t kMost = 64;
  alignas(64) float distance[kMost + kLeafCapacity + kLanes] = {};
  alignas(64) std::uint32_t id[kMost + kLeafCapacity + kLanes];
  std::size_t count = 0;

  HWY_INLINE void gather(const Query& q, const Leaf& leaf, float incident, FloatVector limit) {
    const std::size_t slots = leaf_slots(leaf.count);
    const std::uint32_t* ids = leaf.ids();
    const FloatVector part = hn::Set(kFloats, incident);
    for (std::size_t k = 0; k < leaf.count; k += kLanes) {
      keep(leaf.shared ? to_shared_points(q, part, leaf.block + k, slots)
                       : to_points(q, leaf.block + k, slots),
           limit, ids + k, leaf.count - k);
    }
  }

 private:
  HWY_INLINE void keep(FloatVector d, FloatVector limit, const std::uint32_t* ids, std::size_t valid) {
    constexpr hn::RebindToUnsigned<Floats> kIds;
    const auto near = hn::And(hn::Le(d, limit), hn::FirstN(kFloats, valid));
    hn::StoreU(hn::Compress(d, near), kFloats, distance + count);
    hn::StoreU(hn::Compress(hn::LoadU(kIds, ids), hn::RebindMask(kIds, near)), kIds, id + count);
    count += hn::CountTrue(kFloats, near);
  }
};

// All points in the list within the limit; false when there are too many.
HWY_INLINE bool gather(const Shortlist& list, const Sides& sides, const Query& q, float limit,
                       Candidates& candidates) {
  const FloatVector most = hn::Set(kFloats, limit);
  candidates.count = 0;
  for (std::size_t from = 0; from < list.count; from += kBits) {
    for (std::uint64_t left = leaves_within(list, sides, limit, from); left != 0; left &= left - 1) {
      const std::size_t c = from + static_cast<std::size_t>(std::countr_zero(left));
      candidates.gather(q, list.leaf[c], sides.incident[c], most);
      if (candidates.count > Candidates::kMost) {
        return false;
      }
    }
  }
  return true;
}

// The leaf with the nearest box first, the others as they come.
template <typename Nearest>
HWY_INLINE void look_through(const Shortlist& list, const Sides& sides, const Query& q, Nearest& nearest) {
  const std::size_t first = sides.nearest;
  scan_first(q, list.leaf[first], sides.incident[first], nearest);
  for (std::size_t from = 0; from < list.count; from += kBits) {
    std::uint64_t left = leaves_within(list, sides, nearest.worst(), from);
    left &= first - from < kBits ? ~(std::uint64_t{1} << (first - from)) : ~std::uint64_t{0};
    while (left != 0) {
      const std::size_t c = from + static_cast<std::size_t>(std::countr_zero(left));
      left &= left - 1;
      if (scan(q, list.leaf[c], sides.incident[c], nearest)) {
        left &= leaves_within(list, sides, nearest.worst(), from);
      }
    }
  }
}

// Child with the nearest box for each query; the node's boxes stay in registers.
HWY_INLINE void choose_children(const Node& node, bool shared, const Point* queries,
                                const std::uint32_t* which, std::size_t count, std::uint8_t* lanes) {
  const std::uint32_t all = 0xFFFFU >> (kFanOut - node.children);
  for (std::size_t n = 0; n < count; ++n) {
    const Query q = spread(queries[which[n]]);
    FloatVector d[kSteps];
    FloatVector least = hn::Set(kFloats, kInfinity);
    for (std::size_t s = 0; s < kSteps; ++s) {
      d[s] = to_outgoing_sides(q, node, s * kLanes);
      d[s] = shared ? d[s] : hn::Add(d[s], to_incident_sides(q, node, s * kLanes));
      d[s] = hn::IfThenElse(mask_of(all >> (s * kLanes)), d[s], hn::Set(kFloats, kInfinity));
      least = hn::Min(least, d[s]);
    }
    least = hn::MinOfLanes(kFloats, least);
    std::uint32_t equal = 0;
    for (std::size_t s = 0; s < kSteps; ++s) {
      equal |= bits_of(hn::Eq(d[s], least)) << (s * kLanes);
    }
    // All distances may be infinite.
    lanes[n] = static_cast<std::uint8_t>(std::countr_zero(equal));
  }
}

// Queries put in the order of the leaves that they lie nearest to.
class LeafOrder {
 public:
  explicit LeafOrder(const Point* queries) : queries_(queries) {}

  void clear() { order_.clear(); }
  void add(std::size_t query) { order_.push_back(static_cast<std::uint32_t>(query)); }
  void arrange(const Node* root) {
    moved_.resize(order_.size());
    lanes_.resize(order_.size());
    ends_.clear();
    if (!order_.empty()) {
      arrange(*root, false, 0, order_.size());
    }
  }
  [[nodiscard]] std::span<std::uint32_t> order() { return order_; }
  /// Where the queries of one leaf end and those of another begin.
  [[nodiscard]] std::span<const std::uint32_t> ends() const { return ends_; }

 private:
  // NOLINTNEXTLINE(misc-no-recursion): as deep as the tree.
  void arrange(const Node& node, bool shared, std::size_t begin, std::size_t end) {
    if (end - begin <= kLeastGroup) {
      ends_.push_back(static_cast<std::uint32_t>(end));
      return;
    }
    std::uint32_t* order = order_.data();
    choose_children(node, shared, queries_, order + begin, end - begin, lanes_.data() + begin);
    std::array<std::size_t, kFanOut + 1> at{};
    for (std::size_t n = begin; n < end; ++n) {
      ++at[lanes_[n] + 1U];
    }
    at[0] = begin;
    for (std::size_t c = 0; c < kFanOut; ++c) {
      at[c + 1] += at[c];
    }
    std::array<std::size_t, kFanOut + 1> to = at;
    for (std::size_t n = begin; n < end; ++n) {
      moved_[to[lanes_[n]]++] = order[n];
    }
    std::copy(moved_.data() + begin, moved_.data() + end, order + begin);
    for (std::size_t c = 0; c < node.children; ++c) {
      if (at[c] == at[c + 1]) {
        continue;
      }
      if (node.is_leaf(c)) {
        ends_.push_back(static_cast<std::uint32_t>(at[c + 1]));
      } else {
        arrange(*node.node(c), node.is_shared(c), at[c], at[c + 1]);
      }
    }
  }

  const Point* queries_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> moved_;
  std::vector<std::uint32_t> ends_;
  std::vector<std::uint8_t> lanes_;
};

// Batches: queries of the same leaf collect the leaves that matter to any of them.
template <std::size_t kCapacity>
class Rows {
 public:
  Rows(const Tree& tree, const Point* queries, std::size_t k, Neighbor* out)
      : root_(tree.root), queries_(queries), k_(k), out_(out), by_leaf_(queries), middle_(k), nearest_(k) {}

  void answer(std::size_t count) {
    for (std::size_t n = 0; n < count; ++n) {
      if (is_finite(queries_[n])) {
        by_leaf_.add(n);
      } else {
        finish(n, 0);
      }
    }
    by_leaf_.arrange(root_);
    std::size_t begin = 0;
    for (const std::size_t end : by_leaf_.ends()) {
      while (end - begin > kGroup) {
        // In equal parts.
        const std::size_t parts = (end - begin + kGroup - 1) / kGroup;
        const std::size_t next = begin + (end - begin) / parts;
        answer(begin, next);
        begin = next;
      }
      if (end - begin >= kEnough || end == by_leaf_.order().size()) {
        answer(begin, end);
        begin = end;
      }
    }
  }

 private:
  // NOLINTNEXTLINE(misc-no-recursion): as deep as kGroup has bits.
  void answer(std::size_t begin, std::size_t end) {
    if (end - begin < kLeastGroup) {
      alone(begin, end);
      return;
    }
    const std::uint32_t* order = by_leaf_.order().data();
    const std::size_t middle = begin + (end - begin) / 2;
    middle_.start();
    walk(root_, queries_[order[middle]], middle_, steps_);
    finish(order[middle], middle_.give(k_, out_ + order[middle] * k_));
    if (!middle_.knows(k_)) {
      alone(begin, middle);
      alone(middle + 1, end);
      return;
    }
    std::array<float, kGroup> limits{};
    Group group;
    middle_.bound(group.points);
    for (std::size_t n = begin; n < end; ++n) {
      widen(group.queries, queries_[order[n]]);
      limits[n - begin] = middle_.limit_at(spread(queries_[order[n]]));
      group.reach = std::max(group.reach, limits[n - begin]);
    }
    for (std::size_t a = 0; a < kAxes; ++a) {
      const auto far = [&](float q) {
        const float f = std::max(q - group.points.lo[a], group.points.hi[a] - q);
        return f * f;
      };
      group.far_lo[a] = far(group.queries.lo[a]);
      group.far_hi[a] = far(group.queries.hi[a]);
      group.slack += std::max(group.far_lo[a], group.far_hi[a]) * kRounding;
    }
    group.reach *= 1 + kRounding;
    if (!collect(root_, group, list_)) {
      answer(begin, middle);
      answer(middle + 1, end);
      return;
    }
    for (std::size_t n = begin; n < end; ++n) {
      if (n != middle) {
        look(spread(queries_[order[n]]), limits[n - begin]);
        finish(order[n], nearest_.give(k_, out_ + order[n] * k_));
      }
    }
  }

  // One query among the leaves of the list. How far its neighbours reach is guessed from the query
  // before; when that holds, no leaf waits for what another has found.
  HWY_INLINE void look(const Query& q, float limit) {
    measure_sides(list_, q, sides_);
    const float incident = sides_.incident[sides_.nearest];
    const float guess = std::min(limit, incident + beyond_ * stretch_);
    nearest_.start();
    const bool few_enough = gather(list_, sides_, q, guess, candidates_);
    if (few_enough && candidates_.count >= k_) {
      const std::uint64_t all = ~std::uint64_t{0} >> (Candidates::kMost - candidates_.count);
      if (candidates_.count > kMerged && candidates_.count <= kPlaced) {
        nearest_.place(all, candidates_.distance, candidates_.id, candidates_.count);
      } else {
        nearest_.take(all, candidates_.distance, candidates_.id);
      }
      stretch_ *= candidates_.count > k_ + k_ / 2 ? kTighter : 1.0F;
    } else {
      stretch_ = std::min(few_enough ? stretch_ * kWider : stretch_ * kTighter, kMostStretch);
      nearest_.limit(limit);
      look_through(list_, sides_, q, nearest_);
    }
    beyond_ = nearest_.worst() - incident;
  }

  void alone(std::size_t begin, std::size_t end) {
    const std::uint32_t* order = by_leaf_.order().data();
    for (std::size_t n = begin; n < end; ++n) {
      nearest_.start();
      walk(root_, queries_[order[n]], nearest_, steps_);
      finish(order[n], nearest_.give(k_, out_ + order[n] * k_));
    }
  }

  void finish(std::size_t n, std::size_t found) {
    std::fill(out_ + n * k_ + found, out_ + (n + 1) * k_, Neighbor{kInfinity, 0xFFFFFFFFU});
  }

  static void widen(Box& box, const Point& p) {
    const std::array<float, kAxes> x{p.x_i, p.y_i, p.x_o, p.y_o};
    for (std::size_t a = 0; a < kAxes; ++a) {
      box.lo[a] = std::min(box.lo[a], x[a]);
      box.hi[a] = std::max(box.hi[a], x[a]);
    }
  }

  const Node* root_;
  const Point* queries_;
  std::size_t k_;
  Neighbor* out_;
  LeafOrder by_leaf_;
  PlacedNearest<kCapacity> middle_;
  FewNearest<kCapacity> nearest_;
  Shortlist list_;
  Sides sides_;
  Candidates candidates_;
  float beyond_ = 0;      // Square of how far the neighbours of the query before reach, without omega_i.
  float stretch_ = 1.5F;  // What the guess takes more.
  Step steps_[kMostLevels];
};

}  // namespace
}  // namespace scatter::search::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
