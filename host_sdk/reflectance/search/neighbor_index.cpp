#include "host_sdk/reflectance/search/neighbor_index.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "host_sdk/reflectance/search/build.h"
#include "host_sdk/reflectance/search/edit.h"
#include "host_sdk/reflectance/search/traverse.h"

namespace scatter::search {

namespace {

bool is_finite(const Point& p) noexcept {
  // A sum with NaN or infinity times zero is NaN.
  return std::isfinite(p.x_i * 0 + p.y_i * 0 + p.x_o * 0 + p.y_o * 0);
}

constexpr std::size_t kMostPoints = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kLeastRowsPerTask = 1024;
constexpr std::size_t kTasksPerThread = 4;
constexpr std::size_t kRowsPerTask = 32768;  // Of a batch: the more, the more queries share their leaves.
constexpr const char* kRemedy = "leave out samples without a direction";

std::string not_finite(std::size_t number, const Point& p) {
  return fmt::format("neighbour index: point {} is not finite: ({}, {}, {}, {})", number, p.x_i, p.y_i, p.x_o,
                     p.y_o);
}

std::unexpected<Error> too_many() {
  return fail(ErrorCode::kInvalidArgument, fmt::format("neighbour index: more than {} points", kMostPoints),
              "thin the samples out or use several indices");
}

}  // namespace

struct NeighborIndex::State {
  Tree tree;

  // ids empty: 0, 1, 2, ...
  static Result<NeighborIndex> build(std::span<const Point> points, std::span<const std::uint32_t> ids) {
    if (points.size() > kMostPoints) {
      return too_many();
    }
    const auto bad = std::find_if_not(points.begin(), points.end(), is_finite);
    if (bad != points.end()) {
      return fail(ErrorCode::kInvalidArgument,
                  not_finite(static_cast<std::size_t>(bad - points.begin()), *bad), kRemedy);
    }
    NeighborIndex index;
    index.state_->tree = build_tree(points, ids, Fill::kEqual);
    return index;
  }
};

float distance_squared(const Point& a, const Point& b) noexcept {
  const float x_i = a.x_i - b.x_i;
  const float y_i = a.y_i - b.y_i;
  const float x_o = a.x_o - b.x_o;
  const float y_o = a.y_o - b.y_o;
  return (x_i * x_i + y_i * y_i) + (x_o * x_o + y_o * y_o);
}

NeighborIndex::NeighborIndex() : state_(std::make_unique<State>()) {}
NeighborIndex::~NeighborIndex() = default;
NeighborIndex::NeighborIndex(NeighborIndex&&) noexcept = default;
NeighborIndex& NeighborIndex::operator=(NeighborIndex&&) noexcept = default;

Result<NeighborIndex> NeighborIndex::build(std::span<const Point> points,
                                           std::span<const std::uint32_t> ids) {
  if (ids.size() != points.size()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("neighbour index: {} ids for {} points", ids.size(), points.size()),
                "give one id per point");
  }
  return State::build(points, ids);
}

Result<NeighborIndex> NeighborIndex::build(std::span<const Point> points) {
  return State::build(points, {});
}

Status NeighborIndex::add(const Point& point, std::uint32_t id) {
  if (!is_finite(point)) {
    return fail(ErrorCode::kInvalidArgument, not_finite(id, point), kRemedy);
  }
  if (size() == kMostPoints) {
    return too_many();
  }
  insert(state_->tree, point, id);
  return {};
}

bool NeighborIndex::remove(const Point& point, std::uint32_t id) {
  return erase(state_->tree, point, id);
}

void NeighborIndex::clear() noexcept {
  state_->tree = Tree{};
}

void NeighborIndex::rebuild() {
  search::rebuild(state_->tree, Fill::kEqual);
}

std::size_t NeighborIndex::size() const noexcept {
  return state_->tree.size;
}

std::size_t NeighborIndex::memory_bytes() const noexcept {
  return sizeof(*this) + sizeof(State) + state_->tree.pool.bytes();
}

std::size_t NeighborIndex::nearest(const Point& query, std::span<Neighbor> out) const noexcept {
  return nearest_one(state_->tree, query, out);
}

void NeighborIndex::within(const Point& query, float radius_squared, std::vector<Neighbor>& out) const {
  out.clear();
  collect_within(state_->tree, query, radius_squared, out);
  std::sort(out.begin(), out.end(), [](const Neighbor& a, const Neighbor& b) {
    return a.distance_squared != b.distance_squared ? a.distance_squared < b.distance_squared : a.id < b.id;
  });
}

void NeighborIndex::find(const Point& point, std::vector<std::uint32_t>& out) const {
  out.clear();
  find_at(state_->tree, point, out);
  std::sort(out.begin(), out.end());
}

bool NeighborIndex::contains(const Point& point, std::uint32_t id) const noexcept {
  return has(state_->tree, point, id);
}

Status NeighborIndex::nearest_batch(std::span<const Point> queries, std::size_t k, std::span<Neighbor> out,
                                    unsigned threads) const {
  if (out.size() != queries.size() * k) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("neighbour index: room for {} neighbours, {} queries with {} each need {}",
                            out.size(), queries.size(), k, queries.size() * k),
                "make the output as long as queries times k");
  }
  const auto rows = [&](const tbb::blocked_range<std::size_t>& range) {
    nearest_rows(state_->tree, queries.data() + range.begin(), range.size(), k,
                 out.data() + range.begin() * k);
  };
  if (threads == 1 || queries.size() <= kLeastRowsPerTask) {
    for (std::size_t begin = 0; begin < queries.size(); begin += kRowsPerTask) {
      rows({begin, std::min(begin + kRowsPerTask, queries.size())});
    }
    return {};
  }
  tbb::task_arena arena(threads == 0 ? tbb::task_arena::automatic : static_cast<int>(threads));
  const std::size_t share =
      queries.size() / (kTasksPerThread * static_cast<std::size_t>(arena.max_concurrency()));
  const std::size_t rows_per_task = std::clamp(share, kLeastRowsPerTask, kRowsPerTask);
  arena.execute(
      [&] { tbb::parallel_for(tbb::blocked_range<std::size_t>(0, queries.size(), rows_per_task), rows); });
  return {};
}

}  // namespace scatter::search
