#include "simulator/corrosion/front_march.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

namespace scatter::corrosion {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();
/// Cells this far from a seed get the time along the straight line, so that the wrong curvature which
/// stencils see near a point does not spread.
constexpr int kSeedRadius = 3;
/// The straight line is trusted where slowness around the seed varies by no more than this.
constexpr float kSeedContrast = 3;

/// Times are not negative, so that their bits are in their order.
std::uint32_t key_of(float time) {
  return std::bit_cast<std::uint32_t>(time);
}

}  // namespace

std::size_t RadixQueue::bucket(std::uint32_t key) const noexcept {
  return static_cast<std::size_t>(std::bit_width(key ^ last_));
}

void RadixQueue::push(Entry entry) {
  least_ = size_ == 0 ? entry.key : std::min(least_, entry.key);
  buckets_[bucket(entry.key)].push_back(entry);
  ++size_;
}

bool RadixQueue::has_below(std::uint32_t limit) {
  if (size_ == 0 || least_ >= limit) {
    return false;
  }
  if (!buckets_[0].empty()) {
    return last_ < limit;
  }
  std::size_t from = 1;
  while (buckets_[from].empty()) {
    ++from;
  }
  std::vector<Entry>& entries = buckets_[from];
  least_ = entries[0].key;
  for (const Entry& entry : entries) {
    least_ = std::min(least_, entry.key);
  }
  if (least_ >= limit) {
    return false;
  }
  last_ = least_;
  for (const Entry& entry : entries) {
    buckets_[bucket(entry.key)].push_back(entry);
  }
  entries.clear();
  return true;
}

RadixQueue::Entry RadixQueue::pop() {
  const Entry entry = buckets_[0].back();
  buckets_[0].pop_back();
  --size_;
  return entry;
}

FrontMarch::FrontMarch(std::vector<float> slowness, std::size_t side, double cell_mm, Border border)
    : slowness_(std::move(slowness)),
      times_(slowness_.size(), kNever),
      side_(side),
      cell_mm_(static_cast<float>(cell_mm)),
      toroidal_(border == Border::kToroidal) {}

void FrontMarch::offer(std::size_t cell, std::uint32_t x, std::uint32_t y, float time) {
  const float at = std::max(time, now_);
  if (at < times_[cell]) {
    times_[cell] = at;
    queue_.push({key_of(at), (y << 16U) | x});
  }
}

void FrontMarch::start(std::uint32_t cell, float time) {
  const auto side = static_cast<int>(side_);
  const int x0 = static_cast<int>(cell) % side;
  const int y0 = static_cast<int>(cell) / side;
  const float own = slowness_[cell];
  if (own == kNever || times_[cell] <= now_) {
    return;
  }
  const int radius = std::min(kSeedRadius, (side - 1) / 2);
  // Visits the cells around that exist, with their distance in cells.
  const auto around = [&](auto&& visit) {
    for (int dy = -radius; dy <= radius; ++dy) {
      for (int dx = -radius; dx <= radius; ++dx) {
        const int x = (x0 + dx + side) % side;
        const int y = (y0 + dy + side) % side;
        if (toroidal_ || (x == x0 + dx && y == y0 + dy)) {
          visit(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y),
                std::sqrt(static_cast<float>(dx * dx + dy * dy)));
        }
      }
    }
  };
  float least = own;
  float most = own;
  around([&](std::uint32_t x, std::uint32_t y, float) {
    least = std::min(least, slowness_[y * side_ + x]);
    most = std::max(most, slowness_[y * side_ + x]);
  });
  const bool even = most <= kSeedContrast * least;
  around([&](std::uint32_t x, std::uint32_t y, float distance) {
    const std::size_t at = y * side_ + x;
    if (times_[at] > now_ && (distance == 0 || even)) {
      offer(at, x, y, time + distance * cell_mm_ * (own + slowness_[at]) / 2);
    }
  });
}

/// Time at the middle of `around` from the known neighbours along two directions at right angles; `cost` is
/// slowness times the length of a step.
template <typename Around>
float FrontMarch::solve(const Around& around, Step first, Step second, float cost) const {
  struct Side {
    float known = kNever;  ///< Nearer neighbour's time.
    float value = 0;       ///< The derivative is root * (T - value) / step.
    float weight = 1;      ///< root^2
  };
  const auto upwind = [&](Step step) {
    const auto value = [&](int k) {
      const float time = around(k * step.x, k * step.y);
      return time <= now_ ? time : kNever;
    };
    const float ahead = value(1);
    const float behind = value(-1);
    Side side;
    side.known = std::min(ahead, behind);
    side.value = side.known;
    if (side.known < kNever) {
      const float further = value(ahead <= behind ? 2 : -2);
      if (further <= side.known) {
        side.value = side.known + (side.known - further) / 3;
        side.weight = 2.25F;
      }
    }
    return side;
  };
  const Side a = upwind(first);
  const Side b = upwind(second);
  // From one direction alone, to first order: what lies behind says nothing when the front comes from the
  // side.
  const float single = std::min(a.known, b.known) + cost;
  if (a.known == kNever || b.known == kNever) {
    return single;
  }
  // a.weight (T - a.value)^2 + b.weight (T - b.value)^2 = cost^2, as seen from a.value.
  const float gap = b.value - a.value;
  const float sum = a.weight + b.weight;
  const float root = sum * cost * cost - a.weight * b.weight * gap * gap;
  if (root < 0) {
    return single;
  }
  const float time = a.value + (b.weight * gap + std::sqrt(root)) / sum;
  return time >= std::max(a.known, b.known) ? time : single;
}

void FrontMarch::spread_inside(std::uint32_t x, std::uint32_t y) {
  const auto stride = static_cast<std::ptrdiff_t>(side_);
  const auto go = [&](int dx, int dy, Step first, Step second, float length) {
    const std::size_t cell =
        (y + static_cast<std::uint32_t>(dy)) * side_ + (x + static_cast<std::uint32_t>(dx));
    if (times_[cell] <= now_ || slowness_[cell] == kNever) {
      return;
    }
    const float* const middle = times_.data() + cell;
    const auto around = [middle, stride](int i, int j) { return middle[i + j * stride]; };
    offer(cell, x + static_cast<std::uint32_t>(dx), y + static_cast<std::uint32_t>(dy),
          solve(around, first, second, slowness_[cell] * length));
  };
  const float across = cell_mm_ * std::numbers::sqrt2_v<float>;
  go(-1, 0, {1, 0}, {0, 1}, cell_mm_);
  go(1, 0, {1, 0}, {0, 1}, cell_mm_);
  go(0, -1, {1, 0}, {0, 1}, cell_mm_);
  go(0, 1, {1, 0}, {0, 1}, cell_mm_);
  go(-1, -1, {1, 1}, {1, -1}, across);
  go(1, -1, {1, 1}, {1, -1}, across);
  go(-1, 1, {1, 1}, {1, -1}, across);
  go(1, 1, {1, 1}, {1, -1}, across);
}

void FrontMarch::spread_at_border(std::uint32_t x, std::uint32_t y) {
  const auto side = static_cast<int>(side_);
  const auto outside = [side](int i) { return i < 0 || i >= side; };
  const auto wrapped = [side](int i) { return (i + side) % side; };
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      int nx = static_cast<int>(x) + dx;
      int ny = static_cast<int>(y) + dy;
      if ((dx == 0 && dy == 0) || (!toroidal_ && (outside(nx) || outside(ny)))) {
        continue;
      }
      nx = wrapped(nx);
      ny = wrapped(ny);
      const std::size_t cell = static_cast<std::size_t>(ny) * side_ + static_cast<std::size_t>(nx);
      if (times_[cell] <= now_ || slowness_[cell] == kNever) {
        continue;
      }
      const auto around = [&](int i, int j) {
        if (!toroidal_ && (outside(nx + i) || outside(ny + j))) {
          return kNever;
        }
        return times_[static_cast<std::size_t>(wrapped(ny + j)) * side_ +
                      static_cast<std::size_t>(wrapped(nx + i))];
      };
      const bool along_axis = dx == 0 || dy == 0;
      const float length = along_axis ? cell_mm_ : cell_mm_ * std::numbers::sqrt2_v<float>;
      const float time = along_axis ? solve(around, {1, 0}, {0, 1}, slowness_[cell] * length)
                                    : solve(around, {1, 1}, {1, -1}, slowness_[cell] * length);
      offer(cell, static_cast<std::uint32_t>(nx), static_cast<std::uint32_t>(ny), time);
    }
  }
}

std::span<const std::uint32_t> FrontMarch::advance(float limit) {
  reached_.clear();
  const auto inside = [this](std::uint32_t i) { return i >= 3 && i + 4 <= side_; };
  while (queue_.has_below(key_of(limit))) {
    const RadixQueue::Entry entry = queue_.pop();
    const std::uint32_t x = entry.value & 0xFFFFU;
    const std::uint32_t y = entry.value >> 16U;
    const std::size_t cell = y * side_ + x;
    if (key_of(times_[cell]) != entry.key) {
      continue;  // reached earlier, by a better way
    }
    now_ = times_[cell];
    reached_.push_back(static_cast<std::uint32_t>(cell));
    if (inside(x) && inside(y)) {
      spread_inside(x, y);
    } else {
      spread_at_border(x, y);
    }
  }
  return reached_;
}

}  // namespace scatter::corrosion
