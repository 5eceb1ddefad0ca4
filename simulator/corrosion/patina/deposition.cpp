#include "simulator/corrosion/patina/deposition.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace scatter::corrosion {
namespace {

constexpr std::array<std::string_view, 4> kNames{"steady", "random", "relaxed", "ballistic"};
constexpr double kTwo32 = 0x1p32;

/// The four columns beside `place`.
std::array<std::size_t, 4> beside(std::size_t place, std::size_t width, std::size_t height) noexcept {
  const std::size_t x = place % width;
  const std::size_t row = place - x;
  return {row + (x == 0 ? width - 1 : x - 1), row + (x + 1 == width ? 0 : x + 1),
          row == 0 ? place + (height - 1) * width : place - width,
          row == (height - 1) * width ? x : place + width};
}

}  // namespace

std::string_view name(Deposition deposition) noexcept {
  return kNames[static_cast<std::size_t>(deposition)];
}

Result<Deposition> deposition_named(std::string_view name) {
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) {
      return static_cast<Deposition>(i);
    }
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("deposition \"{}\" is unknown", name),
              "use steady, random, relaxed or ballistic");
}

Result<FallPlaces> FallPlaces::make(std::span<const float> weights) {
  if (weights.empty() || weights.size() > std::numeric_limits<std::uint32_t>::max()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("there are {} places to fall on, expected 1..2^32 - 1", weights.size()),
                "give a rate for each cell");
  }
  double sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!(weights[i] >= 0) || !std::isfinite(weights[i])) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("rate: cell {} is {}, expected 0 or more", i, weights[i]),
                  "give finite rates that are not negative");
    }
    sum += weights[i];
  }
  if (!(sum > 0)) {
    return fail(ErrorCode::kInvalidArgument, "rate: all cells are 0, expected one above 0",
                "let at least one cell grow");
  }
  const std::size_t n = weights.size();
  const double scale = static_cast<double>(n) / sum;
  std::vector<double> share(n);
  std::vector<std::uint32_t> small;
  std::vector<std::uint32_t> large;
  for (std::size_t i = 0; i < n; ++i) {
    share[i] = weights[i] * scale;
    (share[i] < 1 ? small : large).push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<Slot> slots(n);
  while (!small.empty() && !large.empty()) {
    const std::uint32_t poor = small.back();
    small.pop_back();
    const std::uint32_t rich = large.back();
    slots[poor] = {static_cast<std::uint32_t>(share[poor] * kTwo32), rich};
    share[rich] -= 1 - share[poor];
    if (share[rich] < 1) {
      large.pop_back();
      small.push_back(rich);
    }
  }
  // What is left has a share of 1 up to rounding and gives to itself; a place of weight 0 that rounding left
  // over gives all to a place that has some.
  const auto fullest = static_cast<std::uint32_t>(std::ranges::max_element(weights) - weights.begin());
  for (const std::vector<std::uint32_t>* rest : {&small, &large}) {
    for (const std::uint32_t i : *rest) {
      slots[i] = weights[i] > 0 ? Slot{std::numeric_limits<std::uint32_t>::max(), i} : Slot{0, fullest};
    }
  }
  return FallPlaces(std::move(slots));
}

Deposit::Deposit(std::size_t width, std::size_t height, Deposition kind)
    : width_(width), height_(height), kind_(kind), heights_(width * height, 0) {}

std::uint32_t Deposit::drop(std::size_t place, simulator::RandomStream& stream) noexcept {
  ++particles_;
  std::uint32_t rise = 1;
  switch (kind_) {
    case Deposition::kSteady:
    case Deposition::kRandom:
      ++heights_[place];
      break;
    case Deposition::kRelaxed: {
      std::uint32_t lowest = heights_[place];
      std::array<std::size_t, 4> lower{};
      std::uint32_t found = 0;
      for (const std::size_t neighbour : beside(place, width_, height_)) {
        if (heights_[neighbour] < lowest) {
          lowest = heights_[neighbour];
          found = 0;
        }
        if (heights_[neighbour] == lowest && lowest < heights_[place]) {
          lower[found++] = neighbour;
        }
      }
      const std::size_t target = found == 0 ? place : found == 1 ? lower[0] : lower[stream.below(found)];
      ++heights_[target];
      break;
    }
    case Deposition::kBallistic: {
      const std::uint32_t before = heights_[place];
      std::uint32_t after = before + 1;
      for (const std::size_t neighbour : beside(place, width_, height_)) {
        after = std::max(after, heights_[neighbour]);
      }
      heights_[place] = after;
      rise = after - before;
      break;
    }
  }
  volume_ += rise;
  return rise;
}

}  // namespace scatter::corrosion
