#include "tests/reference/full_scan_corrosion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "simulator/corrosion/corrosivity.h"
#include "simulator/corrosion/map.h"

namespace scatter::reference {

using corrosion::Border;

FullScanCorrosion::FullScanCorrosion(const corrosion::GrowthOptions& options)
    : options_(options),
      side_(options.side),
      height_(side_ * side_, 1.0),
      state_(side_ * side_, 0),
      random_(options.seed) {
  const std::vector<float> surface = corrosion::on_grid(options.surface, side_);
  const std::vector<float> material = corrosion::on_grid(options.material, side_);
  const std::vector<float> exposure = corrosion::on_grid(options.exposure, side_);
  const std::vector<float> opening = corrosion::on_grid(options.opening, side_);
  std::size_t metal = 0;
  for (std::size_t i = 0; i < state_.size(); ++i) {
    const double s = std::max(1.0 - static_cast<double>(surface[i]), options.least_susceptibility);
    const double m = 1.0 - static_cast<double>(material[i]);
    scratches_.push_back(
        static_cast<std::uint32_t>(std::lround(65535 * s * static_cast<double>(exposure[i]))));
    structure_.push_back(
        static_cast<std::uint32_t>(std::lround(65535 * m * static_cast<double>(exposure[i]))));
    drop_.push_back(options.events.bite * 2 * m);
    if (opening[i] < 0.5F) {
      state_[i] = 4;
      height_[i] = 0;
      scratches_[i] = 0;
    } else {
      ++metal;
    }
  }
  const double whole = options.thickness_mm * 7800;
  cell_g_per_m2_ = whole / static_cast<double>(metal);
  target_ = std::min(corrosion::mass_loss_g_per_m2(options.corrosivity, options.law, options.age_years),
                     whole * (1 - options.reserve));
}

template <typename Visit>
void FullScanCorrosion::around(std::size_t x, std::size_t y, Visit&& visit) const {
  for (std::size_t b = 0; b < 3; ++b) {
    for (std::size_t a = 0; a < 3; ++a) {
      // One more than the neighbour's column and row, so that 0 lies before the first.
      const std::size_t column = x + a;
      const std::size_t row = y + b;
      if (a == 1 && b == 1) {
        continue;
      }
      if (options_.border == Border::kClamped && (column == 0 || row == 0 || column > side_ || row > side_)) {
        continue;
      }
      visit((row + side_ - 1) % side_ * side_ + (column + side_ - 1) % side_);
    }
  }
}

bool FullScanCorrosion::enclosed(std::size_t x, std::size_t y) const {
  if (x > 0 && y > 0 && x + 1 < side_ && y + 1 < side_) {
    const std::uint8_t* const s = state_.data() + y * side_ + x;
    const auto n = static_cast<std::ptrdiff_t>(side_);
    return s[-1] >= 2 && s[1] >= 2 && s[-n] >= 2 && s[n] >= 2 && s[-n - 1] >= 2 && s[-n + 1] >= 2 &&
           s[n - 1] >= 2 && s[n + 1] >= 2;
  }
  bool all = true;
  around(x, y, [&](std::size_t other) { all = all && state_[other] >= 2; });
  return all;
}

void FullScanCorrosion::remove(std::size_t cell) {
  const double before = height_[cell];
  // The product rounds bites to a 2^-24th; without a margin the last hit of a hole would fall to either side.
  const double after = before - drop_[cell] < 1e-6 ? 0 : before - drop_[cell];
  height_[cell] = after;
  removed_ += (before - after) * cell_g_per_m2_;
}

void FullScanCorrosion::reach(std::size_t cell) {
  ++events_;
  if (state_[cell] == 1) {
    sum1_ -= scratches_[cell];
  }
  state_[cell] = 2;
  around(cell % side_, cell / side_, [&](std::size_t other) {
    if (state_[other] == 0) {
      state_[other] = 1;
      sum1_ += scratches_[other];
    }
  });
  remove(cell);
  if (height_[cell] <= 0) {
    state_[cell] = 4;
  }
}

void FullScanCorrosion::convert(std::size_t cell) {
  state_[cell] = 3;
  if (options_.events.conversion_removes) {
    remove(cell);
  }
  if (height_[cell] <= 0) {
    state_[cell] = 4;
  } else {
    sum3_ += structure_[cell];
  }
}

std::size_t FullScanCorrosion::draw_place() {
  std::vector<double> lines(side_, 0);
  double sum = 0;
  for (std::size_t y = 0; y < side_; ++y) {
    for (std::size_t x = 0; x < side_; ++x) {
      lines[y] += scratches_[y * side_ + x];
    }
    sum += lines[y];
  }
  std::uniform_real_distribution<double> unit;
  double r = unit(random_) * sum;
  std::size_t y = 0;
  while (y + 1 < side_ && r >= lines[y]) {
    r -= lines[y++];
  }
  r = unit(random_) * lines[y];
  std::size_t x = 0;
  while (x + 1 < side_ && r >= scratches_[y * side_ + x]) {
    r -= scratches_[y * side_ + x++];
  }
  return y * side_ + x;
}

void FullScanCorrosion::pass() {
  ++passes_;
  std::uniform_int_distribution<std::uint64_t> in1(0, sum1_ > 0 ? sum1_ - 1 : 0);
  std::uniform_int_distribution<std::uint64_t> in3(0, sum3_ > 0 ? sum3_ - 1 : 0);
  const std::uint64_t wanted1 = in1(random_);
  const std::uint64_t wanted3 = in3(random_);
  const std::size_t none = state_.size();
  std::size_t reached = none;
  std::size_t deepened = none;
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  converting_.clear();
  for (std::size_t y = 0; y < side_; ++y) {
    for (std::size_t x = 0; x < side_; ++x) {
      const std::size_t cell = y * side_ + x;
      switch (state_[cell]) {
        case 1:
          if (reached == none) {
            a += scratches_[cell];
            reached = a > wanted1 ? cell : none;
          }
          break;
        case 2:
          if (enclosed(x, y)) {
            converting_.push_back(cell);
          }
          break;
        case 3:
          if (deepened == none) {
            b += structure_[cell];
            deepened = b > wanted3 ? cell : none;
          }
          break;
        default:
          break;
      }
    }
  }
  // Drawn from what was there before the scan, changed after it.
  if (reached != none) {
    reach(reached);
  }
  for (const std::size_t cell : converting_) {
    convert(cell);
  }
  if (deepened != none && removed_ < target_) {
    ++events_;
    remove(deepened);
    if (height_[deepened] <= 0) {
      state_[deepened] = 4;
      sum3_ -= structure_[deepened];
    }
  }
}

void FullScanCorrosion::try_late_seeds() {
  const double gap = 1000 / options_.late_points.value_or(options_.starting_points);
  std::exponential_distribution<double> exponential;
  if (passes_ == 0) {
    late_at_ = std::isinf(gap) ? gap : gap * exponential(random_);
  }
  while (removed_ >= late_at_) {
    const std::size_t cell = draw_place();
    if (state_[cell] == 0) {
      state_[cell] = 1;
      sum1_ += scratches_[cell];
    }
    late_at_ += gap * exponential(random_);
  }
}

void FullScanCorrosion::run() {
  if (target_ <= 0) {
    return;
  }
  try_late_seeds();
  for (std::uint32_t points = 0; points < options_.starting_points && removed_ < target_;) {
    const std::size_t cell = draw_place();
    if (state_[cell] < 2) {
      reach(cell);
      ++points;
    }
  }
  while (removed_ < target_) {
    const double before = removed_;
    const std::uint64_t events_before = events_;
    pass();
    try_late_seeds();
    if (removed_ <= before && events_ == events_before && converting_.empty()) {
      break;
    }
  }
}

}  // namespace scatter::reference
