#include "host_sdk/reflectance/estimators/hole.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace scatter::reflectance {
namespace {

/// Calls visit(neighbour, conductance) for the nodes next to one; the pole is node 0 and has a
/// neighbour per column. Conductance: length of the common side over the distance, on the unit sphere.
template <typename Visit>
void for_each_neighbor(const GridBrdf::Content& content, std::uint32_t node, const Visit& visit) {
  const auto columns = static_cast<std::uint32_t>(content.phi_count);
  const auto rows = static_cast<std::uint32_t>(content.theta_count);
  const auto between_rows = [&](std::uint32_t upper) {
    return std::sin((static_cast<double>(upper) + 0.5) * content.theta_step) * content.phi_step /
           content.theta_step;
  };
  const std::uint32_t row = node / columns;
  if (row == 0) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      visit(columns + c, between_rows(0));
    }
    return;
  }
  const std::uint32_t column = node % columns;
  visit(row == 1 ? 0 : node - columns, between_rows(row - 1));
  if (row + 1 < rows) {
    visit(node + columns, between_rows(row));
  }
  const double between_columns =
      content.theta_step / (std::sin(static_cast<double>(row) * content.theta_step) * content.phi_step);
  visit(row * columns + (column + 1) % columns, between_columns);
  visit(row * columns + (column + columns - 1) % columns, between_columns);
}

}  // namespace

std::vector<Hole> find_holes(const GridBrdf::Content& content, const std::vector<bool>& is_missing) {
  std::vector<Hole> holes;
  std::vector<bool> seen(is_missing.size(), false);
  std::vector<std::uint32_t> waiting;
  for (std::uint32_t start = 0; start < is_missing.size(); ++start) {
    // Of the pole's nodes the first stands for all.
    if (!is_missing[start] || seen[start] || (start > 0 && start < content.phi_count)) {
      continue;
    }
    Hole hole;
    seen[start] = true;
    waiting.assign(1, start);
    while (!waiting.empty()) {
      const std::uint32_t node = waiting.back();
      waiting.pop_back();
      hole.unknown.push_back(node);
      hole.reaches_last_row = hole.reaches_last_row || node / content.phi_count + 1 == content.theta_count;
      for_each_neighbor(content, node, [&](std::uint32_t next, double) {
        if (!is_missing[next]) {
          hole.rim.push_back(next);
        } else if (!seen[next]) {
          seen[next] = true;
          waiting.push_back(next);
        }
      });
    }
    std::ranges::sort(hole.unknown);
    std::ranges::sort(hole.rim);
    hole.rim.erase(std::unique(hole.rim.begin(), hole.rim.end()), hole.rim.end());
    holes.push_back(std::move(hole));
  }
  return holes;
}

void fill_hole(const GridBrdf::Content& content, const Hole& hole, std::span<float> plane) {
  const std::size_t n = hole.unknown.size();
  // The matrix in compressed rows; known neighbours go to the right-hand side.
  struct Entry {
    std::uint32_t column = 0;
    double conductance = 0;
  };
  std::vector<std::size_t> first(n + 1, 0);
  std::vector<Entry> entries;
  std::vector<double> diagonal(n, 0);
  std::vector<double> right(n, 0);
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (const std::uint32_t node : hole.rim) {
    lowest = std::min(lowest, static_cast<double>(plane[node]));
    highest = std::max(highest, static_cast<double>(plane[node]));
  }
  const double middle = (lowest + highest) / 2;
  for (std::size_t u = 0; u < n; ++u) {
    for_each_neighbor(content, hole.unknown[u], [&](std::uint32_t next, double conductance) {
      diagonal[u] += conductance;
      const auto place = std::ranges::lower_bound(hole.unknown, next);
      if (place != hole.unknown.end() && *place == next) {
        entries.push_back({static_cast<std::uint32_t>(place - hole.unknown.begin()), conductance});
      } else {
        right[u] += conductance * (static_cast<double>(plane[next]) - middle);
      }
    });
    first[u + 1] = entries.size();
  }
  // Conjugate gradients, scaled by the diagonal; the unknowns count from the middle of the rim's range.
  std::vector<double> x(n, 0);
  std::vector<double> residual = right;
  std::vector<double> scaled(n);
  std::vector<double> step(n);
  std::vector<double> image(n);
  const auto scale = [&] {
    double product = 0;
    for (std::size_t u = 0; u < n; ++u) {
      scaled[u] = residual[u] / diagonal[u];
      product += scaled[u] * residual[u];
    }
    return product;
  };
  double product = scale();
  step = scaled;
  const double enough = 1e-16 * product;
  for (std::size_t round = 0; round < 2 * n + 10 && product > enough; ++round) {
    double curvature = 0;
    for (std::size_t u = 0; u < n; ++u) {
      double sum = diagonal[u] * step[u];
      for (std::size_t e = first[u]; e < first[u + 1]; ++e) {
        sum -= entries[e].conductance * step[entries[e].column];
      }
      image[u] = sum;
      curvature += sum * step[u];
    }
    if (!(curvature > 0)) {
      break;
    }
    const double length = product / curvature;
    for (std::size_t u = 0; u < n; ++u) {
      x[u] += length * step[u];
      residual[u] -= length * image[u];
    }
    const double before = product;
    product = scale();
    for (std::size_t u = 0; u < n; ++u) {
      step[u] = scaled[u] + product / before * step[u];
    }
  }
  for (std::size_t u = 0; u < n; ++u) {
    const auto value = static_cast<float>(std::clamp(middle + x[u], lowest, highest));
    if (hole.unknown[u] == 0) {
      std::ranges::fill(plane.first(content.phi_count), value);
    } else {
      plane[hole.unknown[u]] = value;
    }
  }
}

}  // namespace scatter::reflectance
