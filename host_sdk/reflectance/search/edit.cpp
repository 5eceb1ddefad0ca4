#include "host_sdk/reflectance/search/edit.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <span>

#include "host_sdk/reflectance/search/build.h"
#include "host_sdk/reflectance/search/traverse.h"

namespace scatter::search {

namespace {

constexpr std::size_t kLeafLow = 12;     // Leaves below are merged, if one of their siblings has room,
constexpr std::size_t kMergedLeaf = 48;  // for results up to here, so that the next addition does not split.
constexpr std::size_t kNodeLow = 5;
constexpr std::size_t kMergedNode = 13;

bool has_incidence(const Node& node, std::size_t c, const Point& p) noexcept {
  return node.lo[0][c] == p.x_i && node.lo[1][c] == p.y_i;
}

// The box only: a leaf that shares omega_i must no longer do so when the point has another one.
void widen(Node& node, std::size_t c, const Point& p) noexcept {
  const std::array<float, kAxes> x{p.x_i, p.y_i, p.x_o, p.y_o};
  for (std::size_t a = 0; a < kAxes; ++a) {
    node.lo[a][c] = std::min(node.lo[a][c], x[a]);
    node.hi[a][c] = std::max(node.hi[a][c], x[a]);
  }
}

Box around(const Box& a, const Box& b) noexcept {
  Box box = a;
  for (std::size_t k = 0; k < kAxes; ++k) {
    box.lo[k] = std::min(box.lo[k], b.lo[k]);
    box.hi[k] = std::max(box.hi[k], b.hi[k]);
  }
  return box;
}

float margin(const Box& box) noexcept {
  float sum = 0;
  for (std::size_t a = 0; a < kAxes; ++a) {
    sum += box.hi[a] - box.lo[a];
  }
  return sum;
}

std::size_t widest_axis(const Box& box) noexcept {
  std::size_t widest = 0;
  for (std::size_t a = 1; a < kAxes; ++a) {
    if (box.hi[a] - box.lo[a] > box.hi[widest] - box.lo[widest]) {
      widest = a;
    }
  }
  return widest;
}

void copy_lane(const Node& from, std::size_t c, Node& to, std::size_t at) noexcept {
  to.set_box(at, from.box(c));
  to.child[at] = from.child[c];
  to.points[at] = from.points[c];
  to.set_shared(at, from.is_shared(c));
}

// The last child takes the place of child c.
void drop_lane(Node& node, std::size_t c) noexcept {
  --node.children;
  if (c != node.children) {
    copy_lane(node, node.children, node, c);
  }
}

// A leaf's points on the stack, with room for one more.
struct Entries {
  std::array<Point, kLeafCapacity + 1> point;
  std::array<std::uint32_t, kLeafCapacity + 1> id{};
  std::size_t count = 0;

  void put(const Point& p, std::uint32_t i) noexcept {
    point[count] = p;
    id[count++] = i;
  }
  void put(const Leaf& leaf) noexcept {
    for (std::size_t k = 0; k < leaf.count; ++k) {
      put(leaf.point(k), leaf.ids()[k]);
    }
  }
};

// Hangs entries order[0], order[1], ... as a new leaf into lane c.
void hang_leaf(Pool& pool, Node& node, std::size_t c, const Entries& entries,
               std::span<const std::uint8_t> order) {
  const Point& first = entries.point[order.front()];
  const bool shared = std::all_of(order.begin(), order.end(), [&](std::uint8_t k) {
    return entries.point[k].x_i == first.x_i && entries.point[k].y_i == first.y_i;
  });
  const Leaf leaf{pool.new_leaf(order.size(), shared), order.size(), shared, first.x_i, first.y_i};
  for (std::size_t k = 0; k < order.size(); ++k) {
    leaf.put(k, entries.point[order[k]], entries.id[order[k]]);
  }
  node.hang(c, leaf);
  node.set_box(c, box_of(leaf));
}

// Moves a leaf into a block for `count` points and returns it; points past the smaller count are lost.
Leaf resized(Pool& pool, Node& node, std::size_t c, std::size_t count, bool shared) {
  const Leaf old = node.leaf(c);
  Leaf made{old.block, count, shared, old.x_i, old.y_i};
  if (leaf_slots(count) == leaf_slots(old.count) && shared == old.shared) {
    node.hang(c, made);
    return made;
  }
  made.block = pool.new_leaf(count, shared);
  const std::size_t kept = std::min(count, old.count);
  if (shared == old.shared) {
    for (std::size_t a = 0; a < (shared ? 2 : kAxes); ++a) {
      std::copy_n(old.block + a * leaf_slots(old.count), kept, made.block + a * leaf_slots(count));
    }
    std::copy_n(old.ids(), kept, made.ids());
  } else {
    for (std::size_t k = 0; k < kept; ++k) {
      made.put(k, old.point(k), old.ids()[k]);
    }
  }
  pool.free_leaf(old);
  node.hang(c, made);
  return made;
}

// Lanes of a full node and one more, dealt out to `node` and a new node by the place of their boxes.
Node* split_node(Pool& pool, Node& node, const Node& extra) {
  const Box box = around(box_of(node), extra.box(0));
  const std::size_t axis = widest_axis(box);
  std::array<std::uint8_t, kFanOut + 1> order{};
  std::array<float, kFanOut + 1> middle{};
  for (std::size_t c = 0; c <= kFanOut; ++c) {
    order[c] = static_cast<std::uint8_t>(c);
    middle[c] = c < kFanOut ? node.lo[axis][c] * 0.5F + node.hi[axis][c] * 0.5F
                            : extra.lo[axis][0] * 0.5F + extra.hi[axis][0] * 0.5F;
  }
  std::sort(order.begin(), order.end(), [&](std::uint8_t a, std::uint8_t b) {
    return middle[a] != middle[b] ? middle[a] < middle[b] : a < b;
  });
  const Node whole = node;
  Node* other = pool.new_node();
  node.children = 0;
  other->children = 0;
  for (std::size_t n = 0; n <= kFanOut; ++n) {
    Node& to = n < kFanOut / 2 ? node : *other;
    const std::size_t c = order[n];
    copy_lane(c < kFanOut ? whole : extra, c < kFanOut ? c : 0, to, to.children++);
  }
  return other;
}

// The way from the root to a leaf.
struct Way {
  std::array<Node*, kMostLevels> node{};
  std::array<std::size_t, kMostLevels> lane{};
  std::size_t depth = 0;  // Of the last entry.
};

// Hangs the child in lane 0 of `extra` next to the last entry of the way, splitting upwards.
void hang_upwards(Tree& tree, Way& way, Node& extra) {
  for (;;) {
    Node& node = *way.node[way.depth];
    if (node.children < kFanOut) {
      copy_lane(extra, 0, node, node.children++);
      return;
    }
    Node* other = split_node(tree.pool, node, extra);
    extra.hang(0, other, box_of(*other));
    if (way.depth == 0) {
      Node* root = tree.pool.new_node();
      root->hang(0, &node, box_of(node));
      copy_lane(extra, 0, *root, 1);
      root->children = 2;
      tree.root = root;
      if (++tree.levels > kMostLevels) {
        rebuild(tree, Fill::kGrown);
      }
      return;
    }
    --way.depth;
    way.node[way.depth]->hang(way.lane[way.depth], &node, box_of(node));
  }
}

void split_leaf(Tree& tree, Way& way, const Point& point, std::uint32_t id) {
  Node& node = *way.node[way.depth];
  const std::size_t c = way.lane[way.depth];
  Entries entries;
  entries.put(node.leaf(c));
  entries.put(point, id);
  tree.pool.free_leaf(node.leaf(c));
  widen(node, c, point);
  const std::size_t axis = widest_axis(node.box(c));
  std::array<std::uint8_t, kLeafCapacity + 1> order{};
  std::array<float, kLeafCapacity + 1> along{};
  for (std::size_t k = 0; k <= kLeafCapacity; ++k) {
    order[k] = static_cast<std::uint8_t>(k);
    const Point& p = entries.point[k];
    along[k] = std::array<float, kAxes>{p.x_i, p.y_i, p.x_o, p.y_o}[axis];
  }
  const auto half = order.begin() + (kLeafCapacity + 1) / 2;
  std::nth_element(order.begin(), half, order.end(), [&](std::uint8_t a, std::uint8_t b) {
    return along[a] != along[b] ? along[a] < along[b] : a < b;
  });
  hang_leaf(tree.pool, node, c, entries, {order.begin(), half});
  Node extra{};
  hang_leaf(tree.pool, extra, 0, entries, {half, order.end()});
  hang_upwards(tree, way, extra);
}

// Joins child c with the sibling of its kind that makes the smallest box, if one has room.
void merge_leaf(Pool& pool, Node& node, std::size_t c) {
  const Box box = node.box(c);
  std::size_t best = kFanOut;
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t s = 0; s < node.children; ++s) {
    if (s != c && node.is_leaf(s) && node.points[s] + node.points[c] <= kMergedLeaf) {
      const float size = margin(around(box, node.box(s)));
      if (size < least) {
        least = size;
        best = s;
      }
    }
  }
  if (best == kFanOut) {
    return;
  }
  Entries entries;
  std::array<std::uint8_t, kMergedLeaf> order{};
  std::iota(order.begin(), order.end(), std::uint8_t{0});
  for (const std::size_t lane : {best, c}) {
    entries.put(node.leaf(lane));
    pool.free_leaf(node.leaf(lane));
  }
  hang_leaf(pool, node, best, entries, std::span(order).first(entries.count));
  drop_lane(node, c);
}

void merge_node(Pool& pool, Node& node, std::size_t c) {
  const Box box = node.box(c);
  Node* child = node.node(c);
  std::size_t best = kFanOut;
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t s = 0; s < node.children; ++s) {
    if (s != c && !node.is_leaf(s) && node.node(s)->children + child->children <= kMergedNode) {
      const float size = margin(around(box, node.box(s)));
      if (size < least) {
        least = size;
        best = s;
      }
    }
  }
  if (best == kFanOut) {
    return;
  }
  Node* other = node.node(best);
  for (std::size_t k = 0; k < child->children; ++k) {
    copy_lane(*child, k, *other, other->children++);
  }
  node.hang(best, other, around(box, node.box(best)));
  pool.free_node(child);
  drop_lane(node, c);
}

// Whether the box may be smaller without this point. Where all share omega_i, that stays.
bool on_border(const Node& node, std::size_t c, const Point& p) noexcept {
  const std::array<float, kAxes> x{p.x_i, p.y_i, p.x_o, p.y_o};
  for (std::size_t a = node.is_shared(c) ? 2 : 0; a < kAxes; ++a) {
    if (x[a] == node.lo[a][c] || x[a] == node.hi[a][c]) {
      return true;
    }
  }
  return false;
}

bool erase_in_leaf(Pool& pool, Node& node, std::size_t c, const Point& p, std::uint32_t id) {
  const Leaf leaf = node.leaf(c);
  // Without a way out in the middle the compiler compares several at a time.
  const std::uint32_t* ids = leaf.ids();
  std::uint32_t present = 0;
  for (std::size_t k = 0; k < leaf.count; ++k) {
    present += ids[k] == id ? 1U : 0U;
  }
  if (present == 0) {
    return false;
  }
  for (std::size_t k = 0; k < leaf.count; ++k) {
    if (leaf.ids()[k] != id || !(leaf.point(k) == p)) {
      continue;
    }
    if (leaf.count == 1) {
      pool.free_leaf(leaf);
      drop_lane(node, c);
      return true;
    }
    leaf.put(k, leaf.point(leaf.count - 1), leaf.ids()[leaf.count - 1]);
    const Leaf smaller = resized(pool, node, c, leaf.count - 1, leaf.shared);
    if (on_border(node, c, p)) {
      const Box box = box_of(smaller);
      node.set_box(c, box);
      if (!leaf.shared && shares_incidence(box)) {
        (void)resized(pool, node, c, smaller.count, true);
      }
    }
    if (smaller.count < kLeafLow) {
      merge_leaf(pool, node, c);
    }
    return true;
  }
  return false;
}

// NOLINTNEXTLINE(misc-no-recursion): as deep as the tree.
bool erase_below(Pool& pool, Node& node, const Point& p, std::uint32_t id) {
  for (std::uint32_t around = children_around(node, p); around != 0; around &= around - 1) {
    const auto c = static_cast<std::size_t>(std::countr_zero(around));
    if (node.is_leaf(c)) {
      if (erase_in_leaf(pool, node, c, p, id)) {
        return true;
      }
      continue;
    }
    Node* child = node.node(c);
    if (!erase_below(pool, *child, p, id)) {
      continue;
    }
    if (child->children == 0) {
      pool.free_node(child);
      drop_lane(node, c);
    } else if (child->children == 1) {
      copy_lane(*child, 0, node, c);
      pool.free_node(child);
    } else {
      if (on_border(node, c, p)) {
        node.hang(c, child, box_of(*child));
      }
      if (child->children < kNodeLow) {
        merge_node(pool, node, c);
      }
    }
    return true;
  }
  return false;
}

// NOLINTNEXTLINE(misc-no-recursion): as deep as the tree.
void find_below(const Node& node, const Point& p, auto& visit) {
  for (std::uint32_t around = children_around(node, p); around != 0; around &= around - 1) {
    const auto c = static_cast<std::size_t>(std::countr_zero(around));
    if (!node.is_leaf(c)) {
      find_below(*node.node(c), p, visit);
      continue;
    }
    const Leaf leaf = node.leaf(c);
    for (std::size_t k = 0; k < leaf.count; ++k) {
      if (leaf.point(k) == p) {
        visit(leaf.ids()[k]);
      }
    }
  }
}

// Boxes of a tree that changes point by point come to overlap, and its leaves stand half empty. Once
// in a while all is built anew, for some 60 ns per change, so that searches stay as fast as in a
// tree built in bulk.
void renew(Tree& tree) {
  constexpr std::size_t kFewChanges = 512;
  if (++tree.changes > tree.size / 2 + kFewChanges) {
    rebuild(tree, Fill::kGrown);
  }
}

}  // namespace

void insert(Tree& tree, const Point& point, std::uint32_t id) {
  if (tree.root == nullptr) {
    Node* root = tree.pool.new_node();
    root->children = 1;
    Entries entries;
    entries.put(point, id);
    hang_leaf(tree.pool, *root, 0, entries, std::array<std::uint8_t, 1>{0});
    tree.root = root;
    tree.size = 1;
    tree.levels = 1;
    return;
  }
  ++tree.size;
  Way way;
  Node* node = tree.root;
  for (way.depth = 0;; ++way.depth) {
    const std::size_t c = nearest_child(*node, point);
    way.node[way.depth] = node;
    way.lane[way.depth] = c;
    if (node->is_leaf(c)) {
      break;
    }
    node->set_shared(c, node->is_shared(c) && has_incidence(*node, c, point));
    widen(*node, c, point);
    node = node->node(c);
  }
  const std::size_t c = way.lane[way.depth];
  const std::size_t count = node->points[c];
  if (count < kLeafCapacity) {
    const bool shared = node->is_shared(c) && has_incidence(*node, c, point);
    resized(tree.pool, *node, c, count + 1, shared).put(count, point, id);
    widen(*node, c, point);
  } else {
    split_leaf(tree, way, point, id);
  }
  renew(tree);
}

bool erase(Tree& tree, const Point& point, std::uint32_t id) {
  if (tree.root == nullptr || !erase_below(tree.pool, *tree.root, point, id)) {
    return false;
  }
  if (--tree.size == 0) {
    tree = Tree{};
    return true;
  }
  while (tree.root->children == 1 && !tree.root->is_leaf(0)) {
    Node* root = tree.root;
    tree.root = root->node(0);
    --tree.levels;
    tree.pool.free_node(root);
  }
  renew(tree);
  return true;
}

void find_at(const Tree& tree, const Point& point, std::vector<std::uint32_t>& out) {
  if (tree.root != nullptr) {
    const auto visit = [&](std::uint32_t id) { out.push_back(id); };
    find_below(*tree.root, point, visit);
  }
}

bool has(const Tree& tree, const Point& point, std::uint32_t id) noexcept {
  bool found = false;
  if (tree.root != nullptr) {
    const auto visit = [&](std::uint32_t other) { found |= other == id; };
    find_below(*tree.root, point, visit);
  }
  return found;
}

}  // namespace scatter::search
