#include "host_sdk/reflectance/bilinear_warp.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host_sdk/memory/shared_block.h"
#include "host_sdk/reflectance/warp_sums.h"

namespace scatter::reflectance {
namespace {

/// Place t in 0..1 where the integral of the line from a to b over 0..t reaches `part`.
double place_in_line(double a, double b, double part) noexcept {
  if (part <= 0) {
    return 0;
  }
  // (b - a) / 2 t^2 + a t = part, in the form that does not cancel.
  const double root = std::sqrt(std::max(0.0, a * a + 2 * (b - a) * part));
  const double divisor = a + root;
  return divisor > 0 ? std::min(1.0, 2 * part / divisor) : 1.0;
}

}  // namespace

BilinearCell cell_at(std::size_t width, std::size_t height, const SquarePoint& at) noexcept {
  const double x = std::clamp(at.x, 0.0, 1.0) * static_cast<double>(width - 1);
  const double y = std::clamp(at.y, 0.0, 1.0) * static_cast<double>(height - 1);
  const std::size_t column = std::min(static_cast<std::size_t>(x), width - 2);
  const std::size_t row = std::min(static_cast<std::size_t>(y), height - 2);
  return {row * width + column, x - static_cast<double>(column), y - static_cast<double>(row)};
}

BilinearWarp::BilinearWarp(BilinearTables tables) : tables_(std::move(tables)) {}

Result<BilinearWarp> BilinearWarp::make(BilinearTables tables) {
  BilinearWarp warp(std::move(tables));
  const SharedFloats& values = warp.tables_.values;
  const std::size_t height = warp.tables_.height;
  const std::size_t rows = values.size() / warp.tables_.width;
  const std::size_t blocks = warp_blocks(warp.tables_.width);
  const auto sums = shared_block<double>(rows * blocks);
  if (!sum_rows({values.data(), values.size()}, warp.tables_.width, sums.get())) {
    const auto wrong = std::ranges::find_if(values, [](float v) { return !std::isfinite(v) || v < 0; });
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("value {} is {}, expected a finite number of at least 0", wrong - values.begin(), *wrong),
        "export the material again");
  }
  warp.marginal_.resize(rows);
  warp.scale_.reserve(rows / height);
  for (std::size_t table = 0; table < rows / height; ++table) {
    double sum = 0;
    double last = 0;
    for (std::size_t r = table * height; r < (table + 1) * height; ++r) {
      const double next = sums[(r + 1) * blocks - 1];
      sum += r == table * height ? 0 : 0.5 * (last + next);
      last = next;
      warp.marginal_[r] = sum;
    }
    warp.scale_.push_back(sum > 0 ? 1 / sum : 0);
  }
  warp.blocks_ = blocks;
  warp.conditional_ = sums;
  return warp;
}

double BilinearWarp::cells_before(std::size_t table_row, std::size_t column) const noexcept {
  const float* v = tables_.values.data() + table_row * tables_.width;
  const std::size_t block = column / kWarpBlock;
  const std::size_t first = block * kWarpBlock;
  double nodes = 0.5 * (static_cast<double>(v[column]) - static_cast<double>(v[first]));
  for (std::size_t node = first; node < column; ++node) {
    nodes += static_cast<double>(v[node]);
  }
  return conditional_[table_row * blocks_ + block] + nodes;
}

double BilinearWarp::value(std::size_t row, std::size_t column, const TableMix& mix) const noexcept {
  double sum = 0;
  for (std::size_t k = 0; k < mix.count; ++k) {
    const std::size_t table = mix.table[k];
    sum += mix.weight[k] * scale_[table] *
           static_cast<double>(tables_.values[(table * tables_.height + row) * tables_.width + column]);
  }
  return sum;
}

double BilinearWarp::row_up_to(std::size_t row, std::size_t column, const TableMix& mix) const noexcept {
  double sum = 0;
  for (std::size_t k = 0; k < mix.count; ++k) {
    const std::size_t table = mix.table[k];
    sum += mix.weight[k] * scale_[table] * cells_before(table * tables_.height + row, column);
  }
  return sum;
}

double BilinearWarp::rows_up_to(std::size_t row, const TableMix& mix) const noexcept {
  double sum = 0;
  for (std::size_t k = 0; k < mix.count; ++k) {
    const std::size_t table = mix.table[k];
    sum += mix.weight[k] * scale_[table] * marginal_[table * tables_.height + row];
  }
  return sum;
}

double BilinearWarp::density(const SquarePoint& at, const TableMix& mix) const noexcept {
  const BilinearCell cell = cell_at(tables_.width, tables_.height, at);
  double sum = 0;
  for (std::size_t k = 0; k < mix.count; ++k) {
    const std::size_t table = mix.table[k];
    sum += mix.weight[k] * scale_[table] *
           bilinear(tables_.values.data() + table * tables_.size(), tables_.width, cell);
  }
  // The sums are over cells; the square has this many.
  return sum * static_cast<double>((tables_.width - 1) * (tables_.height - 1));
}

SquarePoint BilinearWarp::invert(const SquarePoint& at, const TableMix& mix) const noexcept {
  const std::size_t width = tables_.width;
  const BilinearCell cell = cell_at(width, tables_.height, at);
  const std::size_t row = cell.node / width;
  const std::size_t column = cell.node % width;
  // Along the row at y: nodes, sums up to the cell and over the whole row are linear in y.
  double left = 0;
  double right = 0;
  double before = 0;
  double low = 0;
  double high = 0;
  double rows_before = 0;
  for (std::size_t k = 0; k < mix.count; ++k) {
    const std::size_t table = mix.table[k];
    const double weight = mix.weight[k] * scale_[table];
    const std::size_t table_row = table * tables_.height + row;
    const float* v = tables_.values.data() + table * tables_.size() + cell.node;
    const auto between = [&](double a, double b) { return weight * ((1 - cell.y) * a + cell.y * b); };
    left += between(static_cast<double>(v[0]), static_cast<double>(v[width]));
    right += between(static_cast<double>(v[1]), static_cast<double>(v[width + 1]));
    before += between(cells_before(table_row, column), cells_before(table_row + 1, column));
    low += weight * conditional_[(table_row + 1) * blocks_ - 1];
    high += weight * conditional_[(table_row + 2) * blocks_ - 1];
    rows_before += weight * marginal_[table_row];
  }
  const double whole = (1 - cell.y) * low + cell.y * high;
  const double up_to_x = before + cell.x * (left + 0.5 * cell.x * (right - left));
  const double up_to_y = rows_before + cell.y * (low + 0.5 * cell.y * (high - low));
  return {whole > 0 ? std::clamp(up_to_x / whole, 0.0, 1.0) : 0.0, std::clamp(up_to_y, 0.0, 1.0)};
}

SquarePoint BilinearWarp::sample(const SquarePoint& uniform, const TableMix& mix) const noexcept {
  const std::size_t width = tables_.width;
  const std::size_t height = tables_.height;
  /// Last of the first count - 1 entries that does not exceed the goal.
  const auto last_below = [](std::size_t count, double goal, const auto& cumulated) {
    std::size_t low = 0;
    std::size_t high = count - 1;
    while (high - low > 1) {
      const std::size_t middle = (low + high) / 2;
      (cumulated(middle) < goal ? low : high) = middle;
    }
    return low;
  };
  const double goal_y = std::clamp(uniform.y, 0.0, 1.0) * rows_up_to(height - 1, mix);
  const std::size_t row = last_below(height, goal_y, [&](std::size_t r) { return rows_up_to(r, mix); });
  const double step_y = 1.0 / static_cast<double>(height - 1);
  const double in_y = place_in_line(row_up_to(row, width - 1, mix), row_up_to(row + 1, width - 1, mix),
                                    goal_y - rows_up_to(row, mix));
  const auto mixed = [&](const auto& f, std::size_t column) {
    return (1 - in_y) * f(row, column) + in_y * f(row + 1, column);
  };
  const auto along = [&](std::size_t c) {
    return mixed([&](std::size_t r, std::size_t k) { return row_up_to(r, k, mix); }, c);
  };
  const auto node = [&](std::size_t c) {
    return mixed([&](std::size_t r, std::size_t k) { return value(r, k, mix); }, c);
  };
  const double goal_x = std::clamp(uniform.x, 0.0, 1.0) * along(width - 1);
  const std::size_t column = last_below(width, goal_x, along);
  const double step_x = 1.0 / static_cast<double>(width - 1);
  const double in_x = place_in_line(node(column), node(column + 1), goal_x - along(column));
  return {(static_cast<double>(column) + in_x) * step_x, (static_cast<double>(row) + in_y) * step_y};
}

}  // namespace scatter::reflectance
