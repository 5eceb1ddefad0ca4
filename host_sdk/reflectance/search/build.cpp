#include "host_sdk/reflectance/search/build.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "host_sdk/reflectance/search/plan.h"

namespace scatter::search {

namespace {

constexpr std::size_t kLeafFill = 44;  // Wanted points per leaf: room for splits that are not exact.
constexpr std::size_t kFlatFill = 30;  // The same for points in fewer dimensions: a ball meets fewer leaves.
constexpr std::size_t kMixedBytes = 22;  // Per point, nodes included.
constexpr std::size_t kSharedBytes = 14;
constexpr std::size_t kSureFill = 50;  // Most per leaf on average that a range may ask of its children.
constexpr std::size_t kFineBins = 256;
constexpr std::size_t kCoarseBins = 64;
constexpr std::size_t kCoarseBelow = 1024;  // Points.

// Four floats in one register of any x86-64 or ARM processor; other machines get plain code.
using Four = float __attribute__((vector_size(16)));

Four least(Four a, Four b) noexcept {
  return a < b ? a : b;
}
Four most(Four a, Four b) noexcept {
  return a > b ? a : b;
}

struct Bounds {
  Four lo = Four{} + std::numeric_limits<float>::infinity();
  Four hi = Four{} - std::numeric_limits<float>::infinity();

  void take(Four x) noexcept {
    lo = least(lo, x);
    hi = most(hi, x);
  }
  [[nodiscard]] Box box() const noexcept {
    Box b;
    for (std::size_t a = 0; a < kAxes; ++a) {
      b.lo[a] = lo[a];
      b.hi[a] = hi[a];
    }
    return b;
  }
};

Four four(const Point& p) noexcept {
  return Four{p.x_i, p.y_i, p.x_o, p.y_o};
}

// Unsigned numbers in the order of the floats, -0.0 just below 0.0.
std::uint32_t ordered(float x) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  return (bits & 0x80000000U) != 0 ? ~bits : bits | 0x80000000U;
}

// Most leaves of one child of a node over so many points.
std::size_t leaves_of_a_child(std::size_t count) noexcept {
  std::size_t leaves = 1;
  while (leaves * kFanOut * kSureFill < count) {
    leaves *= kFanOut;
  }
  return leaves;
}

// Points per leaf to aim at. Goniometers leave y_i at 0.
std::size_t leaf_fill(const Box& box) noexcept {
  bool flat = false;
  for (std::size_t a = 0; a < kAxes; ++a) {
    flat |= box.lo[a] == box.hi[a];
  }
  return flat ? kFlatFill : kLeafFill;
}

// Where each child's share of its node's points ends.
constexpr std::array<std::uint32_t, kFanOut + 1> kEqual{0, 1,  2,  3,  4,  5,  6,  7, 8,
                                                        9, 10, 11, 12, 13, 14, 15, 16};
// Shares of 32 to 58 in the frequencies of leaves that grow and are halved at 64 (as the inverse of
// the square), in an order that gives neighbours different ones.
constexpr std::array<std::uint32_t, kFanOut + 1> kGrown = [] {
  std::array<std::uint32_t, kFanOut + 1> ends{};
  for (std::size_t c = 0; c < kFanOut; ++c) {
    const auto rank = static_cast<double>(c * 7 % kFanOut);
    ends[c + 1] = ends[c] + static_cast<std::uint32_t>(64 / (2 - 0.9 * (rank + 0.5) / kFanOut));
  }
  return ends;
}();

// Points and ids, which each level of the tree moves from one store to the other.
struct Store {
  std::unique_ptr<Four[]> points;
  std::unique_ptr<std::uint32_t[]> ids;

  explicit Store(std::size_t count)
      : points(std::make_unique_for_overwrite<Four[]>(count)),
        ids(std::make_unique_for_overwrite<std::uint32_t[]>(count)) {}
};

class Builder {
 public:
  Builder(std::span<const Point> points, std::span<const std::uint32_t> ids, Fill fill, Pool& pool)
      : pool_(pool),
        leaf_weights_(fill == Fill::kEqual ? kEqual : kGrown),
        count_(points.size()),
        stores_{Store(count_), Store(count_)},
        group_(std::make_unique_for_overwrite<std::uint8_t[]>(count_)) {
    for (std::size_t k = 0; k < count_; ++k) {
      const Four x = four(points[k]);
      stores_[0].points[k] = x;
      bounds_.take(x);
    }
    if (ids.empty()) {
      std::iota(stores_[0].ids.get(), stores_[0].ids.get() + count_, 0U);
    } else {
      std::copy(ids.begin(), ids.end(), stores_[0].ids.get());
    }
  }

  Node* root() { return node(0, count_, bounds_.box(), 0); }

 private:
  // What became of a node's points: child c has those from at[c] to at[c + 1].
  struct Dealt {
    std::size_t children = 0;
    std::size_t begin = 0;
    std::size_t end = 0;
    std::array<std::size_t, kFanOut + 1> at{};
    std::array<Bounds, kFanOut> bounds{};
  };

  // Node over [begin, end) of one of the stores.
  // NOLINTNEXTLINE(misc-no-recursion): as deep as the tree.
  Node* node(std::size_t begin, std::size_t end, const Box& box, std::size_t from) {
    const std::size_t count = end - begin;
    const std::size_t below = leaves_of_a_child(count);
    const std::size_t full = below * leaf_fill(box);
    const std::size_t wanted = (count + full - 1) / full;
    Node* node = pool_.new_node();
    Dealt dealt;
    dealt.children = std::min(wanted, kFanOut);
    dealt.begin = begin;
    dealt.end = end;
    dealt.at[0] = begin;
    node->children = static_cast<std::uint16_t>(dealt.children);
    if (!group_points(dealt, box, from, below)) {
      group_exactly(dealt, box, from);
    }
    if (below == 1) {
      hang_leaves(*node, dealt, shares_incidence(box), from);
      return node;
    }
    move_points(dealt, from);
    for (std::size_t c = 0; c < dealt.children; ++c) {
      const Box of_child = dealt.bounds[c].box();
      node->hang(c, this->node(dealt.at[c], dealt.at[c + 1], of_child, 1 - from), of_child);
    }
    return node;
  }

  // Sets group_ of every point to its child, and the borders. Returns false, with the borders
  // unusable, when a child would get more than it can hold or nothing.
  bool group_points(Dealt& dealt, const Box& box, std::size_t from, std::size_t below) {
    const std::size_t begin = dealt.begin;
    const std::size_t end = dealt.end;
    const std::size_t bins = end - begin < kCoarseBelow ? kCoarseBins : kFineBins;
    const std::size_t incidences = count_incidences(dealt, box, bins, from);
    Plan plan;
    if (!make_plan(box, dealt.children, bins, incidences, plan)) {
      return false;
    }
    const Four* points = stores_[from].points.get();
    // Children and points of each group so far; groups are numbered in the order of the children.
    std::array<std::size_t, kFanOut> children{dealt.children};
    std::array<std::size_t, kFanOut> size{end - begin};
    std::size_t groups = 1;
    std::uint8_t* group = group_.get();
    const std::array<std::uint32_t, kFanOut + 1>& weights = below == 1 ? leaf_weights_ : kEqual;
    const auto bin_of = [points](const Plan::Axis& axis, std::size_t k) {
      return static_cast<std::size_t>(static_cast<int>((points[k][axis.axis] - axis.lo) * axis.scale));
    };
    // Each pass over the points ends the cut before and counts for the next one.
    const auto assign = [&](const Plan::Axis axis, std::size_t k) {
      return part_[group[k] * bins + bin_of(axis, k)];
    };
    for (std::size_t level = 0; level < plan.count; ++level) {
      const Plan::Axis axis = plan.axes[level];
      histogram_.assign(groups * bins, 0);
      std::uint32_t* histogram = histogram_.data();
      if (level == 0) {
        for (std::size_t k = begin; k < end; ++k) {
          group[k] = 0;
          ++histogram[bin_of(axis, k)];
        }
      } else {
        const Plan::Axis before = plan.axes[level - 1];
        for (std::size_t k = begin; k < end; ++k) {
          const std::uint8_t g = assign(before, k);
          group[k] = g;
          ++histogram[g * bins + bin_of(axis, k)];
        }
      }
      part_.resize(groups * bins);
      std::array<std::size_t, kFanOut> next_children{};
      std::array<std::size_t, kFanOut> next_size{};
      std::size_t next = 0;
      std::size_t child = 0;  // First of the group.
      if (level == 0 && incidences > 0 && incidences <= dealt.children) {
        for (std::size_t bin = 0; bin < bins; ++bin) {
          part_[bin] = static_cast<std::uint8_t>(next);
          if (histogram_[bin] != 0) {
            next_size[next++] = histogram_[bin];
          }
        }
        deal_children(dealt.children, incidences, next_size, next_children);
        groups = 0;  // None is left to cut.
      }
      for (std::size_t g = 0; g < groups; ++g) {
        const std::size_t parts = std::min(axis.parts, children[g]);
        std::size_t bin = 0;
        std::size_t reached = 0;
        std::size_t given = 0;
        const std::uint32_t whole = weights[child + children[g]] - weights[child];
        for (std::size_t p = 0; p < parts; ++p) {
          const std::size_t share = (children[g] - given + (parts - p) - 1) / (parts - p);
          given += share;
          const std::size_t goal = size[g] * (weights[child + given] - weights[child]) / whole;
          const std::size_t first = reached;
          for (; bin < bins; ++bin) {
            const std::size_t in_bin = histogram_[g * bins + bin];
            if (p + 1 < parts && reached + in_bin / 2 >= goal) {
              break;
            }
            reached += in_bin;
            part_[g * bins + bin] = static_cast<std::uint8_t>(next);
          }
          next_children[next] = share;
          next_size[next] = reached - first;
          ++next;
        }
        child += children[g];
      }
      children = next_children;
      size = next_size;
      groups = next;
    }
    const std::size_t most = below == 1 ? kLeafCapacity : below * kSureFill;
    for (std::size_t c = 0; c < dealt.children; ++c) {
      if (size[c] == 0 || size[c] > most) {
        return false;
      }
      dealt.at[c + 1] = dealt.at[c] + size[c];
    }
    if (plan.count == 0) {
      std::fill(group + begin, group + end, std::uint8_t{0});
      return true;
    }
    for (std::size_t k = begin; k < end; ++k) {
      group[k] = assign(plan.axes[plan.count - 1], k);
    }
    return groups == dealt.children;
  }

  // Bins with points along the axis of incidences; 0 when there is no such axis or when leaves would
  // not become full of one incidence.
  std::size_t count_incidences(const Dealt& dealt, const Box& box, std::size_t bins, std::size_t from) {
    const std::size_t axis = incidence_axis(box);
    if (axis == kAxes) {
      return 0;
    }
    const float scale = bin_scale(box, axis, bins);
    if (!(scale > 0) || !std::isfinite(scale)) {
      return 0;
    }
    const Four* points = stores_[from].points.get();
    std::array<std::uint8_t, kFineBins> occupied{};
    for (std::size_t k = dealt.begin; k < dealt.end; ++k) {
      occupied[static_cast<std::size_t>(static_cast<int>((points[k][axis] - box.lo[axis]) * scale))] = 1;
    }
    const auto count = static_cast<std::size_t>(std::count(occupied.begin(), occupied.end(), 1));
    const bool few = count <= bins / 2 && count * kLeafCapacity <= dealt.end - dealt.begin;
    return few ? count : 0;
  }

  // The same by sorting: along the longest side, in equal shares; equal components are told apart by
  // where they stand, so that this always succeeds.
  void group_exactly(Dealt& dealt, const Box& box, std::size_t from) {
    std::size_t axis = 0;
    for (std::size_t a = 1; a < kAxes; ++a) {
      axis = box.hi[a] - box.lo[a] > box.hi[axis] - box.lo[axis] ? a : axis;
    }
    const std::size_t begin = dealt.begin;
    const std::size_t count = dealt.end - begin;
    keys_.resize(count);
    for (std::size_t k = 0; k < count; ++k) {
      keys_[k] = std::uint64_t{ordered(stores_[from].points[begin + k][axis])} << 32 | k;
    }
    std::sort(keys_.begin(), keys_.end());
    for (std::size_t c = 0; c < dealt.children; ++c) {
      dealt.at[c + 1] = begin + count * (c + 1) / dealt.children;
      for (std::size_t k = count * c / dealt.children; k < count * (c + 1) / dealt.children; ++k) {
        group_[begin + static_cast<std::uint32_t>(keys_[k])] = static_cast<std::uint8_t>(c);
      }
    }
  }

  void move_points(Dealt& dealt, std::size_t from) {
    const Store& source = stores_[from];
    Store& target = stores_[1 - from];
    std::array<std::size_t, kFanOut + 1> to = dealt.at;
    for (std::size_t k = dealt.begin; k < dealt.end; ++k) {
      const std::size_t c = group_[k];
      const std::size_t at = to[c]++;
      target.points[at] = source.points[k];
      target.ids[at] = source.ids[k];
    }
    // Apart from moving: neighbours in a scan go to the same child, and would wait for each other.
    for (std::size_t c = 0; c < dealt.children; ++c) {
      Bounds bounds;
      for (std::size_t k = dealt.at[c]; k < dealt.at[c + 1]; ++k) {
        bounds.take(target.points[k]);
      }
      dealt.bounds[c] = bounds;
    }
  }

  // One bit per child whose points share omega_i.
  std::uint32_t sharing_children(const Dealt& dealt, std::size_t from) const {
    const Store& source = stores_[from];
    std::array<Four, kFanOut> first{};
    std::uint32_t seen = 0;
    std::uint32_t mixed = 0;
    const std::uint32_t all = (1U << dealt.children) - 1;
    for (std::size_t k = dealt.begin; k < dealt.end && mixed != all; ++k) {
      const std::size_t c = group_[k];
      const Four x = source.points[k];
      if ((seen >> c & 1U) == 0) {
        seen |= 1U << c;
        first[c] = x;
      }
      mixed |= (x[0] != first[c][0] || x[1] != first[c][1] ? 1U : 0U) << c;
    }
    return all & ~mixed;
  }

  void hang_leaves(Node& node, Dealt& dealt, bool shared, std::size_t from) {
    const Store& source = stores_[from];
    const std::uint32_t sharing = shared ? 0xFFFFU : sharing_children(dealt, from);
    std::array<float*, kFanOut> to{};
    std::array<std::size_t, kFanOut> slots{};
    for (std::size_t c = 0; c < dealt.children; ++c) {
      const std::size_t count = dealt.at[c + 1] - dealt.at[c];
      const bool leaf_shared = (sharing >> c & 1U) != 0;
      node.hang(c, Leaf{pool_.new_leaf(count, leaf_shared), count, leaf_shared});
      to[c] = node.leaf(c).x_o();
      slots[c] = leaf_slots(count);
    }
    for (std::size_t k = dealt.begin; k < dealt.end; ++k) {
      const std::size_t c = group_[k];
      const Four x = source.points[k];
      float* at = to[c]++;
      const std::size_t step = slots[c];
      if ((sharing >> c & 1U) == 0) {
        *(at - 2 * step) = x[0];
        *(at - step) = x[1];
      }
      at[0] = x[2];
      at[step] = x[3];
      std::memcpy(at + 2 * step, &source.ids[k], sizeof(std::uint32_t));
      dealt.bounds[c].take(x);
    }
    for (std::size_t c = 0; c < dealt.children; ++c) {
      node.set_box(c, dealt.bounds[c].box());
    }
  }

  Pool& pool_;
  const std::array<std::uint32_t, kFanOut + 1>& leaf_weights_;
  std::size_t count_;
  Bounds bounds_;
  std::array<Store, 2> stores_;
  std::unique_ptr<std::uint8_t[]> group_;  // Child of each point.
  std::vector<std::uint32_t> histogram_;
  std::vector<std::uint8_t> part_;
  std::vector<std::uint64_t> keys_;
};

}  // namespace

Tree build_tree(std::span<const Point> points, std::span<const std::uint32_t> ids, Fill fill) {
  Tree tree;
  if (points.empty()) {
    return tree;
  }
  // Leaves rounded up to four points, and their share of the nodes above. Of points that come one
  // incidence after the other most leaves will share it.
  std::size_t turns = 0;
  for (std::size_t k = 1; k < points.size(); ++k) {
    turns += points[k].x_i != points[k - 1].x_i || points[k].y_i != points[k - 1].y_i ? 1U : 0U;
  }
  tree.pool.reserve(points.size() * (turns < points.size() / kFlatFill ? kSharedBytes : kMixedBytes));
  Builder builder(points, ids, fill, tree.pool);
  tree.root = builder.root();
  tree.size = points.size();
  tree.levels = 1;
  for (std::size_t leaves = leaves_of_a_child(points.size()); leaves > 1; leaves /= kFanOut) {
    ++tree.levels;
  }
  return tree;
}

void rebuild(Tree& tree, Fill fill) {
  std::vector<Point> points;
  std::vector<std::uint32_t> ids;
  points.reserve(tree.size);
  ids.reserve(tree.size);
  std::vector<const Node*> waiting;
  if (tree.root != nullptr) {
    waiting.push_back(tree.root);
  }
  while (!waiting.empty()) {
    const Node& node = *waiting.back();
    waiting.pop_back();
    for (std::size_t c = 0; c < node.children; ++c) {
      if (!node.is_leaf(c)) {
        waiting.push_back(node.node(c));
        continue;
      }
      const Leaf leaf = node.leaf(c);
      for (std::size_t k = 0; k < leaf.count; ++k) {
        points.push_back(leaf.point(k));
        ids.push_back(leaf.ids()[k]);
      }
    }
  }
  tree = build_tree(points, ids, fill);
}

Box box_of(const Leaf& leaf) noexcept {
  Box box;
  const auto bound = [&](std::size_t a, const float* x) {
    const auto [lo, hi] = std::minmax_element(x, x + leaf.count);
    box.lo[a] = *lo;
    box.hi[a] = *hi;
  };
  bound(2, leaf.x_o());
  bound(3, leaf.y_o());
  if (leaf.shared) {
    box.lo[0] = box.hi[0] = leaf.x_i;
    box.lo[1] = box.hi[1] = leaf.y_i;
  } else {
    bound(0, leaf.block);
    bound(1, leaf.block + leaf_slots(leaf.count));
  }
  return box;
}

Box box_of(const Node& node) noexcept {
  Box box;
  for (std::size_t a = 0; a < kAxes; ++a) {
    box.lo[a] = *std::min_element(node.lo[a], node.lo[a] + node.children);
    box.hi[a] = *std::max_element(node.hi[a], node.hi[a] + node.children);
  }
  return box;
}

}  // namespace scatter::search
