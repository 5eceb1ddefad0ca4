#include "simulator/corrosion/front_replay.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "host_sdk/simd/vector_clones.h"
#include "simulator/corrosion/corrosivity.h"

// This file is compiled without contraction to fused multiply-add (CMakeLists.txt), so that the loops below
// give the same bits for every instruction set.

namespace scatter::corrosion {
namespace {

/// A cell's mark: how much it adds to the counts of corroded (low half) and of enclosing (high half) cells.
constexpr std::uint8_t kRust = 0x11;
constexpr std::uint8_t kOpen = 0x10;
constexpr std::uint8_t kAllEnclosing = 0x90;

struct Deepening {
  float high = 0;  ///< Tau as the sum of two floats, so that the way from a late birth is exact.
  float low = 0;
  float skin = 0;
  float per_width = 0;
};

SCATTER_VECTOR_CLONES
void deepen_row(const Deepening& at, const float* births, const float* rates, std::size_t count,
                float* heights, std::uint8_t* marks) noexcept {
  const auto [high, low, skin, per_width] = at;
  for (std::size_t i = 0; i < count; ++i) {
    const float way = (high - births[i]) + low;
    const float since = way > 0 ? way : 0;
    const float share = since * per_width;
    const float lost = skin * (share < 1 ? share : 1) + rates[i] * since;
    const float height = 1 - lost;
    heights[i] = height > 0 ? height : 0;
  }
  for (std::size_t i = 0; i < count; ++i) {
    marks[i] = (high - births[i]) + low >= 0 ? kRust : std::uint8_t{0};
  }
}

/// Sum of what is gone, in double.
SCATTER_VECTOR_CLONES
double lost_in_row(const float* heights, std::size_t count) noexcept {
  std::array<double, 16> sums{};
  std::size_t i = 0;
  for (; i + sums.size() <= count; i += sums.size()) {
    for (std::size_t k = 0; k < sums.size(); ++k) {
      sums[k] += static_cast<double>(1 - heights[i + k]);
    }
  }
  double total = 0;
  for (; i < count; ++i) {
    total += static_cast<double>(1 - heights[i]);
  }
  for (const double sum : sums) {
    total += sum;
  }
  return total;
}

SCATTER_VECTOR_CLONES
void add_rows(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
              std::size_t count, std::uint8_t* sums) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    sums[i] = static_cast<std::uint8_t>(above[i] + here[i] + below[i]);
  }
}

/// sums, marks: from the cell beside the first one on.
SCATTER_VECTOR_CLONES
void states_of_row(const std::uint8_t* sums, const std::uint8_t* marks, const float* heights,
                   std::size_t count, std::uint8_t* states) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    states[i] = heights[i] <= 0 ? std::uint8_t{4} : std::uint8_t{0};
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto around = static_cast<std::uint8_t>(sums[i] + sums[i + 1] + sums[i + 2]);
    const std::uint8_t metal = (around & 0x0FU) != 0 ? 1 : 0;
    const std::uint8_t rust = (around & 0xF0U) == kAllEnclosing ? 3 : 2;
    const std::uint8_t state = marks[i + 1] == kRust ? rust : metal;
    states[i] = states[i] > state ? states[i] : state;
  }
}

struct Counts {
  std::uint32_t corroded = 0;
  std::uint32_t deepening = 0;
  std::uint32_t holes = 0;
};

SCATTER_VECTOR_CLONES
Counts count_row(const std::uint8_t* states, std::size_t count) noexcept {
  // Eight states in a word: a set second bit is state 2 or 3, a set third one is 4, the two lowest are 3.
  constexpr std::uint64_t kOnes = 0x0101010101010101;
  const auto sum_of_bytes = [](std::uint64_t bytes) {
    constexpr std::uint64_t kEvery2nd = 0x00FF00FF00FF00FF;
    return static_cast<std::uint32_t>(
        (((bytes & kEvery2nd) + ((bytes >> 8U) & kEvery2nd)) * 0x0001000100010001U) >> 48U);
  };
  Counts total;
  std::size_t i = 0;
  while (i + 8 <= count) {
    const std::size_t end =
        std::min(i + std::size_t{255} * 8, count - count % 8);  // as far as a byte can count
    std::uint64_t rusty = 0;
    std::uint64_t deepening = 0;
    std::uint64_t holes = 0;
    for (; i < end; i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, states + i, sizeof word);
      rusty += (word >> 1U) & kOnes;
      deepening += (word >> 1U) & word & kOnes;
      holes += (word >> 2U) & kOnes;
    }
    total.corroded += sum_of_bytes(rusty) + sum_of_bytes(holes);
    total.deepening += sum_of_bytes(deepening);
    total.holes += sum_of_bytes(holes);
  }
  for (; i < count; ++i) {
    total.corroded += states[i] >= 2 ? 1 : 0;
    total.deepening += states[i] == 3 ? 1 : 0;
    total.holes += states[i] == 4 ? 1 : 0;
  }
  return total;
}

}  // namespace

FrontReplay::FrontReplay(const FrontHistory& history, const GrowthOptions& options,
                         std::shared_ptr<const std::vector<float>> birth_years)
    : history_(history),
      border_(options.border),
      metal_cells_(history.births.size() -
                   static_cast<std::size_t>(
                       std::count(history.opening.begin(), history.opening.end(), std::uint8_t{1}))),
      marks_((options.side + 2) * options.side),
      beyond_(options.side + 2, kOpen),
      sums_(options.side + 2) {
  sheet_.side = options.side;
  sheet_.extent_mm = options.extent_mm;
  sheet_.thickness_mm = options.thickness_mm;
  sheet_.toroidal = options.border == Border::kToroidal;
  sheet_.birth_years = std::move(birth_years);
  sheet_.height.resize(history.births.size());
  sheet_.state.resize(history.births.size());
}

void FrontReplay::deepen(std::size_t y, double tau) {
  const std::size_t side = sheet_.side;
  const auto high = static_cast<float>(tau);
  const Deepening at{.high = high,
                     .low = static_cast<float>(tau - static_cast<double>(high)),
                     .skin = static_cast<float>(history_.law.skin),
                     .per_width = static_cast<float>(1 / history_.law.width)};
  std::uint8_t* const marks = marks_.data() + y * (side + 2);
  float* const heights = sheet_.height.data() + y * side;
  deepen_row(at, history_.births.data() + y * side, history_.rates.data() + y * side, side, heights,
             marks + 1);
  lost_ += lost_in_row(heights, side);
  if (!history_.opening.empty()) {
    const std::uint8_t* const opening = history_.opening.data() + y * side;
    for (std::size_t x = 0; x < side; ++x) {
      heights[x] = opening[x] != 0 ? 0 : heights[x];
      marks[x + 1] = opening[x] != 0 ? kOpen : marks[x + 1];
    }
  }
  marks[0] = border_ == Border::kClamped ? kOpen : marks[side];
  marks[side + 1] = border_ == Border::kClamped ? kOpen : marks[1];
}

const std::uint8_t* FrontReplay::marks(std::ptrdiff_t y) const {
  const auto side = static_cast<std::ptrdiff_t>(sheet_.side);
  if (border_ == Border::kClamped && (y < 0 || y >= side)) {
    return beyond_.data();
  }
  return marks_.data() + ((y + side) % side) * (side + 2);
}

void FrontReplay::find_states(std::size_t y) {
  const std::size_t side = sheet_.side;
  const auto row = static_cast<std::ptrdiff_t>(y);
  auto* const states = reinterpret_cast<std::uint8_t*>(sheet_.state.data() + y * side);
  add_rows(marks(row - 1), marks(row), marks(row + 1), side + 2, sums_.data());
  states_of_row(sums_.data(), marks(row), sheet_.height.data() + y * side, side, states);
  const Counts counts = count_row(states, side);
  corroded_ += counts.corroded;
  deepening_ += counts.deepening;
  holes_ += counts.holes;
}

Sheet& FrontReplay::show(double tau) {
  lost_ = 0;
  corroded_ = 0;
  deepening_ = 0;
  holes_ = 0;
  const std::size_t side = sheet_.side;
  // States of a row follow once the next one is known; those of the first need the last.
  deepen(side - 1, tau);
  const double last = lost_;
  lost_ = 0;
  deepen(0, tau);
  for (std::size_t y = 0; y + 1 < side; ++y) {
    if (y + 2 < side) {
      deepen(y + 1, tau);
    }
    find_states(y);
  }
  find_states(side - 1);
  lost_ += last;
  for (const WaitingSeed& seed : history_.late) {
    CellState& state = sheet_.state[seed.cell];
    if (static_cast<double>(seed.since) <= tau && state == CellState::kUntouched) {
      state = CellState::kThreatened;
    }
  }
  const std::uint64_t open = sheet_.cells() - metal_cells_;
  const double share = 1 / static_cast<double>(metal_cells_);
  sheet_.corroded_fraction = static_cast<double>(corroded_ - open) * share;
  sheet_.state3_fraction = static_cast<double>(deepening_) * share;
  sheet_.hole_fraction = static_cast<double>(holes_ - open) * share;
  sheet_.mass_loss_g_per_m2 = lost_ * share * sheet_.thickness_mm * 1000 * kSteelGramsPerSquareMetrePerUm;
  sheet_.events = corroded_ - open;
  return sheet_;
}

}  // namespace scatter::corrosion
