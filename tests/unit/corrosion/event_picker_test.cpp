#include "simulator/corrosion/event_picker.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "simulator/corrosion/draws.h"

namespace scatter::corrosion {
namespace {

/// 99.9 % quantile of chi squared. Source: Wilson and Hilferty 1931.
double chi_squared_limit(double degrees) {
  const double t = 2 / (9 * degrees);
  return degrees * std::pow(1 - t + 3.0902 * std::sqrt(t), 3);
}

/// Adds and takes out cells for a while, so that lists have grown and shrunk, and then counts picks.
template <typename Picker>
void check_shares(Picker& picker, const std::vector<std::uint16_t>& weights) {
  const auto no_hint = [](std::uint32_t) {};
  std::mt19937 random(5);
  std::vector<std::uint8_t> in(weights.size());
  for (int change = 0; change < 20000; ++change) {
    const auto cell = static_cast<std::uint32_t>(random() % weights.size());
    if (in[cell] == 0 && random() % 2 == 0 && weights[cell] != 0) {
      picker.add(cell);
      in[cell] = 1;
    } else if (!picker.empty()) {
      const Pick pick = picker.pick(no_hint);
      REQUIRE(in[pick.cell] == 1);
      picker.remove(pick);
      in[pick.cell] = 0;
    }
  }
  for (std::uint32_t cell = 0; cell < weights.size(); ++cell) {
    if (in[cell] == 0 && cell % 3 != 0) {
      picker.add(cell);
      in[cell] = weights[cell] != 0 ? 1 : 0;
    }
  }
  double sum = 0;
  for (std::size_t cell = 0; cell < weights.size(); ++cell) {
    sum += in[cell] != 0 ? weights[cell] : 0;
  }
  constexpr int kPicks = 400000;
  std::vector<int> found(weights.size());
  for (int i = 0; i < kPicks; ++i) {
    ++found[picker.pick(no_hint).cell];
  }
  // Rare cells share a bin.
  double value = 0;
  double rare_found = 0;
  double rare_expected = 0;
  int bins = 0;
  for (std::size_t cell = 0; cell < weights.size(); ++cell) {
    const double expected = in[cell] != 0 ? weights[cell] / sum * kPicks : 0;
    if (expected == 0) {
      REQUIRE(found[cell] == 0);
    } else if (expected < 20) {
      rare_found += found[cell];
      rare_expected += expected;
    } else {
      value += (found[cell] - expected) * (found[cell] - expected) / expected;
      ++bins;
    }
  }
  if (rare_expected > 0) {
    value += (rare_found - rare_expected) * (rare_found - rare_expected) / rare_expected;
    ++bins;
  }
  INFO(bins << " bins");
  CHECK(bins > 100);
  CHECK(value < chi_squared_limit(bins - 1));
}

TEST_CASE("Picker: cells are picked in proportion to their weights, of every size and within one octave") {
  std::mt19937 random(2);
  std::vector<std::uint16_t> octaves(400);
  std::vector<std::uint16_t> narrow(400);
  for (std::size_t i = 0; i < octaves.size(); ++i) {
    octaves[i] = static_cast<std::uint16_t>(random() % 65536 >> random() % 6);
    narrow[i] = static_cast<std::uint16_t>(16384 + random() % 16384);
  }
  octaves[7] = 0;
  octaves[8] = 1;
  octaves[10] = 65535;
  for (const auto& weights : {octaves, narrow}) {
    WeightedPicker picker(key_of(1, Draw::kEvents, 0), weights);
    check_shares(picker, weights);
  }
}

TEST_CASE("Picker: cells of one weight are picked alike") {
  EvenPicker picker(key_of(2, Draw::kEvents, 0), 400);
  check_shares(picker, std::vector<std::uint16_t>(400, 1));
}

TEST_CASE("Picker: what is added around a cell are the cells of the set, row by row") {
  for (std::uint32_t set = 0; set < 512; ++set) {
    CellList list(100);
    list.add_around(50, 10, set);
    std::vector<std::uint32_t> expected;
    for (std::uint32_t bit = 0; bit < 9; ++bit) {
      if ((set >> bit & 1U) != 0) {
        expected.push_back(50 + 10 * (bit / 3) - 10 + bit % 3 - 1);
      }
    }
    REQUIRE(std::vector<std::uint32_t>(list.data(), list.data() + list.size()) == expected);
  }
}

}  // namespace
}  // namespace scatter::corrosion
