#include "simulator/corrosion/starting_points.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "simulator/corrosion/draws.h"

namespace scatter::corrosion {

Places::Places(std::span<const float> weights, std::size_t side) : weights_(weights), side_(side) {
  if (weights.size() == 1) {
    count_ = weights[0] > 0 ? side * side : 0;
    return;
  }
  rows_.resize(side);
  double sum = 0;
  for (std::size_t y = 0; y < side; ++y) {
    double row = 0;
    for (const float weight : weights.subspan(y * side, side)) {
      row += static_cast<double>(weight);
      count_ += weight > 0 ? 1 : 0;
    }
    sum += row;
    rows_[y] = sum;
  }
}

std::uint32_t Places::at(double u, double v) const noexcept {
  if (rows_.empty()) {
    const auto cells = static_cast<double>(side_);
    return static_cast<std::uint32_t>(v * cells) * static_cast<std::uint32_t>(side_) +
           static_cast<std::uint32_t>(u * cells);
  }
  const auto found = std::upper_bound(rows_.begin(), rows_.end(), v * rows_.back());
  // Rounding may put v * sum at the sum itself; then it is the last row that has a weight.
  const auto row = found != rows_.end() ? found : std::lower_bound(rows_.begin(), rows_.end(), rows_.back());
  const auto y = static_cast<std::size_t>(row - rows_.begin());
  const std::span<const float> weights = weights_.subspan(y * side_, side_);
  // Summed once more rather than from rows_, whose differences are rounded.
  double line = 0;
  for (const float weight : weights) {
    line += static_cast<double>(weight);
  }
  const double wanted = u * line;
  double sum = 0;
  std::size_t last = 0;
  for (std::size_t x = 0; x < side_; ++x) {
    if (weights[x] > 0) {
      sum += static_cast<double>(weights[x]);
      last = x;
      if (sum > wanted) {
        break;
      }
    }
  }
  return static_cast<std::uint32_t>(y * side_ + last);
}

Result<std::vector<std::uint32_t>> draw_starting_points(std::span<const float> weights, std::size_t side,
                                                        std::uint64_t seed, std::uint32_t count) {
  // Drawing again until the cell is free costs ever more as the free ones get rare. Leaving the taken ones
  // out of the sums draws from the same distribution.
  constexpr std::uint32_t kAttemptsBeforeSummingAgain = 32;
  std::vector<float> reduced;
  Places places(weights, side);
  if (count > places.count()) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("starting_points: {} are more than the {} cells that may corrode", count, places.count()),
        fmt::format("give 1 to {}", std::max<std::size_t>(places.count(), 1)));
  }
  std::vector<std::uint32_t> points;
  points.reserve(count);
  std::vector<bool> taken(side * side);
  for (std::uint32_t k = 0; k < count; ++k) {
    const simulator::RandomKey key = key_of(seed, Draw::kStartingPoint, k);
    for (std::uint32_t attempt = 0;; ++attempt) {
      if (attempt == kAttemptsBeforeSummingAgain) {
        if (weights.size() == 1) {
          reduced.assign(side * side, weights[0]);
        } else {
          reduced.assign(weights.begin(), weights.end());
        }
        for (const std::uint32_t point : points) {
          reduced[point] = 0;
        }
        places = Places(reduced, side);
      }
      const auto words = key.block(attempt);
      const std::uint32_t cell = places.at(unit_of(words[0], words[1]), unit_of(words[2], words[3]));
      if (!taken[cell]) {
        taken[cell] = true;
        points.push_back(cell);
        break;
      }
    }
  }
  return points;
}

LateSeeds::LateSeeds(const Places& places, std::uint64_t seed, double per_1000_g_per_m2)
    : places_(&places),
      seed_(seed),
      mean_gap_g_per_m2_(per_1000_g_per_m2 > 0 && places.count() > 0
                             ? 1000 / per_1000_g_per_m2
                             : std::numeric_limits<double>::infinity()) {
  advance();
}

void LateSeeds::advance() {
  if (std::isinf(mean_gap_g_per_m2_)) {
    next_.mass_g_per_m2 = mean_gap_g_per_m2_;
    return;
  }
  const simulator::RandomKey key = key_of(seed_, Draw::kLateSeed, drawn_++);
  const auto where = key.block(0);
  const auto when = key.block(1);
  next_.mass_g_per_m2 -= mean_gap_g_per_m2_ * std::log1p(-unit_of(when[0], when[1]));
  next_.cell = places_->at(unit_of(where[0], where[1]), unit_of(where[2], where[3]));
  next_.wait = unit_of(when[2], when[3]);
}

}  // namespace scatter::corrosion
