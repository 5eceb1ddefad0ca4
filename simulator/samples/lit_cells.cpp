#include "simulator/samples/lit_cells.h"

#include <algorithm>
#include <cmath>

namespace scatter::simulator {
namespace {

/// Parts of an edge cell's side that are looked at.
constexpr int kParts = 8;
constexpr double kLeastCosine = 0.01;

struct Ellipse {
  double along_x, along_y;       ///< Unit vector of the long axis.
  double longer_mm, shorter_mm;  ///< Half axes.

  /// 1 on the edge.
  [[nodiscard]] double reach(double x_mm, double y_mm) const noexcept {
    return std::hypot((x_mm * along_x + y_mm * along_y) / longer_mm,
                      (y_mm * along_x - x_mm * along_y) / shorter_mm);
  }
};

Ellipse ellipse_of(const Footprint& footprint) noexcept {
  const reflectance::Direction& w = footprint.omega_i;
  const double sine = std::hypot(w.x, w.y);
  const double half = 0.5 * footprint.diameter_mm;
  return {.along_x = sine > 0 ? w.x / sine : 1.0,
          .along_y = sine > 0 ? w.y / sine : 0.0,
          .longer_mm = half / std::max(w.z, kLeastCosine),
          .shorter_mm = half};
}

/// Share of the cell about (x, y) that lies inside.
double inside(const Ellipse& ellipse, double x_mm, double y_mm, double cell_mm) noexcept {
  const double reach = ellipse.reach(x_mm, y_mm);
  // Reach changes by at most 1 / shorter_mm per mm, and the corners are half a diagonal away.
  const double margin = std::sqrt(0.5) * cell_mm / ellipse.shorter_mm;
  if (reach <= 1 - margin) {
    return 1;
  }
  if (reach >= 1 + margin) {
    return 0;
  }
  int hits = 0;
  for (int k = 0; k < kParts * kParts; ++k) {
    const double dx = ((k % kParts + 0.5) / kParts - 0.5) * cell_mm;
    const double dy = ((k / kParts + 0.5) / kParts - 0.5) * cell_mm;
    hits += ellipse.reach(x_mm + dx, y_mm + dy) < 1 ? 1 : 0;
  }
  return static_cast<double>(hits) / (kParts * kParts);
}

std::size_t wrapped(std::int64_t index, std::size_t side) noexcept {
  const auto n = static_cast<std::int64_t>(side);
  return static_cast<std::size_t>((index % n + n) % n);
}

}  // namespace

std::vector<LitCell> lit_cells(std::size_t side, double extent_mm, const Place& middle,
                               const Footprint& footprint) {
  const Ellipse ellipse = ellipse_of(footprint);
  const double cell_mm = extent_mm / static_cast<double>(side);
  // In cells, columns to the right and rows down.
  const double column = middle.u * static_cast<double>(side);
  const double row = middle.v * static_cast<double>(side);
  const double reach_x =
      std::hypot(ellipse.longer_mm * ellipse.along_x, ellipse.shorter_mm * ellipse.along_y);
  const double reach_y =
      std::hypot(ellipse.longer_mm * ellipse.along_y, ellipse.shorter_mm * ellipse.along_x);
  const auto first = [&](double at, double reach) {
    return static_cast<std::int64_t>(std::floor(at - reach / cell_mm));
  };
  const auto last = [&](double at, double reach) {
    return static_cast<std::int64_t>(std::floor(at + reach / cell_mm));
  };
  std::vector<LitCell> cells;
  double sum = 0;
  for (std::int64_t j = first(row, reach_y); j <= last(row, reach_y); ++j) {
    const double y_mm = (row - (static_cast<double>(j) + 0.5)) * cell_mm;
    for (std::int64_t i = first(column, reach_x); i <= last(column, reach_x); ++i) {
      const double x_mm = (static_cast<double>(i) + 0.5 - column) * cell_mm;
      const double weight = inside(ellipse, x_mm, y_mm, cell_mm);
      if (weight > 0) {
        cells.push_back({static_cast<std::uint32_t>(wrapped(j, side) * side + wrapped(i, side)), weight});
        sum += weight;
      }
    }
  }
  if (cells.empty()) {  // A spot smaller than the parts of a cell.
    return {{static_cast<std::uint32_t>(wrapped(static_cast<std::int64_t>(std::floor(row)), side) * side +
                                        wrapped(static_cast<std::int64_t>(std::floor(column)), side)),
             1.0}};
  }
  for (LitCell& cell : cells) {
    cell.weight /= sum;
  }
  return cells;
}

std::vector<LitCell> all_cells(std::size_t side) {
  std::vector<LitCell> cells(side * side);
  for (std::size_t k = 0; k < cells.size(); ++k) {
    cells[k] = {static_cast<std::uint32_t>(k), 1.0 / static_cast<double>(cells.size())};
  }
  return cells;
}

}  // namespace scatter::simulator
