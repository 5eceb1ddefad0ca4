#include "host_sdk/reflectance/search/build.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

namespace scatter::search {

namespace {

constexpr std::size_t kLeafFill = 28;     // Wanted points per leaf: room for splits that are not exact.
constexpr std::size_t kSureFill = 31;     // Most per leaf on average that a range may ask of its children.
constexpr std::size_t kMostParts = 4;     // Of one pass over the points.
constexpr std::size_t kExactBelow = 192;  // Points; ranges up to here are split exactly.
constexpr std::size_t kBins = 256;

struct Entry {
  std::array<float, kAxes> x;
};

Box grown(const Entry* begin, const Entry* end) noexcept {
  Box box;
  for (const Entry* e = begin; e != end; ++e) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      box.lo[a] = std::min(box.lo[a], e->x[a]);
      box.hi[a] = std::max(box.hi[a], e->x[a]);
    }
  }
  return box;
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

// Points of a range lie in front_, which each pass permutes by way of back_.
class Builder {
 public:
  Builder(std::span<const Point> points, std::span<const std::uint32_t> ids, Pool& pool)
      : pool_(pool),
        front_(points.size()),
        back_(points.size()),
        front_ids_(points.size()),
        back_ids_(points.size()),
        bin_(points.size()) {
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Point& p = points[k];
      front_[k].x = {p.x_i, p.y_i, p.x_o, p.y_o};
    }
    if (ids.empty()) {
      std::iota(front_ids_.begin(), front_ids_.end(), 0U);
    } else {
      std::copy(ids.begin(), ids.end(), front_ids_.begin());
    }
  }

  Node* node(std::size_t begin, std::size_t end) {
    const std::size_t count = end - begin;
    const std::size_t below = leaves_of_a_child(count);
    const std::size_t wanted = (count + below * kLeafFill - 1) / (below * kLeafFill);
    Node* node = pool_.new_node();
    node->children = 0;
    split(*node, begin, end, std::min(wanted, kFanOut), below);
    return node;
  }

 private:
  struct Parts {
    std::size_t count = 0;
    std::array<std::size_t, kMostParts> children{};
    std::array<std::size_t, kMostParts + 1> at{};  // Borders.
  };

  // Hangs [begin, end) under `node` as `children` children of at most `below` leaves each.
  void split(Node& node, std::size_t begin, std::size_t end, std::size_t children, std::size_t below) {
    const Box box = grown(&front_[begin], &front_[begin] + (end - begin));
    if (children == 1) {
      hang(node, begin, end, below, box);
      return;
    }
    std::array<std::size_t, kAxes> axes{0, 1, 2, 3};
    std::sort(axes.begin(), axes.end(),
              [&](std::size_t a, std::size_t b) { return box.hi[a] - box.lo[a] > box.hi[b] - box.lo[b]; });
    const std::size_t axis = axes[0];
    const float longest = box.hi[axis] - box.lo[axis];
    const float next = box.hi[axes[1]] - box.lo[axes[1]];
    // Slices no thinner than the next axis is long.
    const std::size_t slices = next > 0.5F * longest ? 2 : kMostParts;
    Parts parts;
    parts.count = std::min(children, slices);
    parts.at[0] = begin;
    std::size_t given = 0;
    for (std::size_t p = 0; p < parts.count; ++p) {
      parts.children[p] = (children - given + (parts.count - p) - 1) / (parts.count - p);
      given += parts.children[p];
      parts.at[p + 1] = begin + (end - begin) * given / children;
    }
    if (end - begin <= kExactBelow || !split_about(parts, axis, box, below)) {
      split_exactly(parts, axis);
    }
    for (std::size_t p = 0; p < parts.count; ++p) {
      split(node, parts.at[p], parts.at[p + 1], parts.children[p], below);
    }
  }

  void hang(Node& parent, std::size_t begin, std::size_t end, std::size_t below, const Box& box) {
    const std::size_t c = parent.children++;
    parent.set_box(c, box);
    if (below > 1) {
      parent.child[c] = node(begin, end);
      parent.points[c] = 0;
      return;
    }
    const std::size_t count = end - begin;
    parent.child[c] = pool_.new_leaf(count);
    parent.points[c] = static_cast<std::uint8_t>(count);
    const Leaf leaf = parent.leaf(c);
    for (std::size_t k = 0; k < count; ++k) {
      const Entry& e = front_[begin + k];
      leaf.put(k, {e.x[0], e.x[1], e.x[2], e.x[3]}, front_ids_[begin + k]);
    }
  }

  // At borders between bins of a histogram, moving parts.at.
  // Returns false, with nothing changed, when a part would not fit its children.
  bool split_about(Parts& parts, std::size_t axis, const Box& box, std::size_t below) {
    const std::size_t begin = parts.at[0];
    const std::size_t end = parts.at[parts.count];
    const float lo = box.lo[axis];
    const float scale = static_cast<float>(kBins) / (box.hi[axis] - lo);
    if (!(scale > 0) || !std::isfinite(scale)) {
      return false;  // No extent, or too much or too little for a float.
    }
    std::array<std::uint32_t, kBins> histogram{};
    for (std::size_t k = begin; k < end; ++k) {
      const float t = std::min((front_[k].x[axis] - lo) * scale, static_cast<float>(kBins - 1));
      const auto b = static_cast<std::uint8_t>(static_cast<int>(t));
      bin_[k] = b;
      ++histogram[b];
    }
    Parts moved = parts;
    std::array<std::uint8_t, kBins> part_of{};
    std::size_t bin = 0;
    std::size_t reached = begin;
    for (std::size_t p = 0; p + 1 < parts.count; ++p) {
      while (bin < kBins && reached + histogram[bin] / 2 < parts.at[p + 1]) {
        reached += histogram[bin];
        part_of[bin++] = static_cast<std::uint8_t>(p);
      }
      moved.at[p + 1] = reached;
    }
    for (; bin < kBins; ++bin) {
      part_of[bin] = static_cast<std::uint8_t>(parts.count - 1);
    }
    for (std::size_t p = 0; p < parts.count; ++p) {
      const std::size_t count = moved.at[p + 1] - moved.at[p];
      if (count == 0 || count > parts.children[p] * below * kSureFill ||
          count < (parts.at[p + 1] - parts.at[p]) / 2) {
        return false;
      }
    }
    parts = moved;
    std::array<std::size_t, kMostParts + 1> to = parts.at;
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t at = to[part_of[bin_[k]]]++;
      back_[at] = front_[k];
      back_ids_[at] = front_ids_[k];
    }
    take_back(begin, end);
    return true;
  }

  // At parts.at; equal components are told apart by where they stand.
  void split_exactly(const Parts& parts, std::size_t axis) {
    const std::size_t begin = parts.at[0];
    const std::size_t end = parts.at[parts.count];
    keys_.resize(end - begin);
    for (std::size_t k = begin; k < end; ++k) {
      keys_[k - begin] = std::uint64_t{ordered(front_[k].x[axis])} << 32 | (k - begin);
    }
    auto from = keys_.begin();
    for (std::size_t p = 1; p < parts.count; ++p) {
      const auto to = keys_.begin() + static_cast<std::ptrdiff_t>(parts.at[p] - begin);
      std::nth_element(from, to, keys_.end());
      from = to;
    }
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t source = begin + static_cast<std::uint32_t>(keys_[k - begin]);
      back_[k] = front_[source];
      back_ids_[k] = front_ids_[source];
    }
    take_back(begin, end);
  }

  void take_back(std::size_t begin, std::size_t end) {
    std::copy(back_.begin() + static_cast<std::ptrdiff_t>(begin),
              back_.begin() + static_cast<std::ptrdiff_t>(end),
              front_.begin() + static_cast<std::ptrdiff_t>(begin));
    std::copy(back_ids_.begin() + static_cast<std::ptrdiff_t>(begin),
              back_ids_.begin() + static_cast<std::ptrdiff_t>(end),
              front_ids_.begin() + static_cast<std::ptrdiff_t>(begin));
  }

  Pool& pool_;
  std::vector<Entry> front_;
  std::vector<Entry> back_;
  std::vector<std::uint32_t> front_ids_;
  std::vector<std::uint32_t> back_ids_;
  std::vector<std::uint8_t> bin_;
  std::vector<std::uint64_t> keys_;
};

}  // namespace

Tree build_tree(std::span<const Point> points, std::span<const std::uint32_t> ids) {
  Tree tree;
  if (points.empty()) {
    return tree;
  }
  // Leaves rounded up to four points, and their share of the nodes above.
  tree.pool.reserve(points.size() * 23);
  Builder builder(points, ids, tree.pool);
  tree.root = builder.node(0, points.size());
  tree.size = points.size();
  tree.levels = 1;
  for (std::size_t leaves = leaves_of_a_child(points.size()); leaves > 1; leaves /= kFanOut) {
    ++tree.levels;
  }
  return tree;
}

void rebuild(Tree& tree) {
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
  tree = build_tree(points, ids);
}

Box box_of(const Leaf& leaf) noexcept {
  Box box;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const auto [lo, hi] = std::minmax_element(leaf.axis(a), leaf.axis(a) + leaf.count);
    box.lo[a] = *lo;
    box.hi[a] = *hi;
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
