// Compiled once per instruction set (Highway); the best that the processor has is taken at run time.
// Contraction to fused operations is off in this file: distances are the same on every machine.
#include "host_sdk/reflectance/search/traverse.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "host_sdk/reflectance/search/traverse.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "host_sdk/reflectance/search/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace scatter::search::HWY_NAMESPACE {
namespace {

template <std::size_t kCapacity>
std::size_t few(const Tree& tree, const Point& query, std::size_t k, Neighbor* out) {
  Step steps[kMostLevels];
  FewNearest<kCapacity> nearest(k);
  walk(tree.root, query, nearest, steps);
  return nearest.give(k, out);
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
  if (tree.root != nullptr && k >= 1 && k <= 32) {
    if (k <= 8) {
      Rows<8>(tree, queries, k, out).answer(count);
    } else if (k <= 16) {
      Rows<16>(tree, queries, k, out).answer(count);
    } else {
      Rows<32>(tree, queries, k, out).answer(count);
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
  enter<false, false>(spread(p), node, 0, 0, step);
  return step.left;
}

std::size_t nearest_child_impl(const Node& node, const Point& p) {
  Step step;
  return enter<true, false>(spread(p), node, 0, kInfinity, step);
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
