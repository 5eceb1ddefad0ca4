// Distributions on the unit square that are bilinear between nodes, and the warps that they define.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/shared_floats.h"

namespace scatter::reflectance {

/// Tables of one size, each bilinear between its nodes: node (row, column) stands at
/// (x, y) = (column / (width - 1), row / (height - 1)).
struct BilinearTables {
  std::size_t width = 0;   ///< At least 2.
  std::size_t height = 0;  ///< At least 2.
  SharedFloats values;     ///< [table][row][column]

  [[nodiscard]] std::size_t size() const noexcept { return width * height; }
};

/// Mix of up to four tables; weights are 0..1 and sum to 1.
struct TableMix {
  std::array<std::size_t, 4> table{};
  std::array<double, 4> weight{};
  std::size_t count = 0;
};

/// Position on the unit square.
struct SquarePoint {
  double x = 0;
  double y = 0;
};

/// The four nodes around a point and their shares.
struct BilinearCell {
  std::size_t node = 0;  ///< Of the corner with the smaller x and y.
  double x = 0;          ///< Place in the cell, 0..1.
  double y = 0;
};

/// Cell of a point; the point is clamped to the square.
[[nodiscard]] BilinearCell cell_at(std::size_t width, std::size_t height, const SquarePoint& at) noexcept;

/// Value of one table. values: its first node; all `width * height` nodes follow.
[[nodiscard]] inline double bilinear(const float* values, std::size_t width,
                                     const BilinearCell& cell) noexcept {
  const float* v = values + cell.node;
  const double low = (1 - cell.x) * static_cast<double>(v[0]) + cell.x * static_cast<double>(v[1]);
  const double high =
      (1 - cell.x) * static_cast<double>(v[width]) + cell.x * static_cast<double>(v[width + 1]);
  return (1 - cell.y) * low + cell.y * high;
}

/// Warps uniform points into points distributed as a mix of normalised tables, and back: first the
/// row (marginal of y), then the place in it (conditional of x).
///
/// Threads   const functions may be called from any number of threads.
/// Cost      one walk over the tables to build; a few reads per `invert`, two binary searches per
///           `sample`.
/// Source    Dupuy and Jakob 2018, section 4.3 (bilinear interpolants instead of constant cells).
class BilinearWarp {
 public:
  /// A table that is 0 everywhere has density 0.
  /// Range   values.size() is a multiple of the tables' size.
  /// Errors  kInvalidArgument: a value that is negative or not finite, with its place.
  [[nodiscard]] static Result<BilinearWarp> make(BilinearTables tables);

  [[nodiscard]] const BilinearTables& tables() const noexcept { return tables_; }
  [[nodiscard]] std::size_t count() const noexcept { return scale_.size(); }

  /// Probability per unit area of the square at a point.
  [[nodiscard]] double density(const SquarePoint& at, const TableMix& mix) const noexcept;
  /// The uniform point that `sample` takes to `at`. Rows without density give x = 0.
  [[nodiscard]] SquarePoint invert(const SquarePoint& at, const TableMix& mix) const noexcept;
  /// The point whose cumulated shares are `uniform`.
  [[nodiscard]] SquarePoint sample(const SquarePoint& uniform, const TableMix& mix) const noexcept;

 private:
  explicit BilinearWarp(BilinearTables tables);
  /// Sum of the cells of one row of one table before a column.
  [[nodiscard]] double cells_before(std::size_t table_row, std::size_t column) const noexcept;
  /// The same, mixed.
  [[nodiscard]] double row_up_to(std::size_t row, std::size_t column, const TableMix& mix) const noexcept;
  [[nodiscard]] double rows_up_to(std::size_t row, const TableMix& mix) const noexcept;
  [[nodiscard]] double value(std::size_t row, std::size_t column, const TableMix& mix) const noexcept;

  BilinearTables tables_;
  std::size_t blocks_ = 0;  ///< Per row.
  /// [table][row][block]: sum of the cells of a row before each block of cells; the last entry is
  /// that of all. A cell is the mean of its two nodes. Blocks, because sums at every node in double
  /// would cost more to write than the file costs to read, and in float they are not exact enough.
  std::shared_ptr<const double[]> conditional_;
  std::vector<double> marginal_;  ///< [table][row]: sum of the rows of cells before it.
  std::vector<double> scale_;     ///< [table]: 1 / sum of all cells; 0 where that is 0.
};

}  // namespace scatter::reflectance
