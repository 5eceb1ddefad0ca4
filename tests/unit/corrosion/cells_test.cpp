#include "simulator/corrosion/cells.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <set>

#include "tests/unit/corrosion/sheet_rules.h"

namespace scatter::corrosion {
namespace {

TEST_CASE("Cells: a cell has eight neighbours, at a clamped border five, in its corner three") {
  const auto neighbours = [](std::uint32_t cell, Border border) {
    std::set<std::uint32_t> found;
    visit_neighbours(cell, 8, border, [&](std::uint32_t other) { found.insert(other); });
    return found;
  };
  CHECK(neighbours(27, Border::kClamped) == std::set<std::uint32_t>{18, 19, 20, 26, 28, 34, 35, 36});
  CHECK(neighbours(0, Border::kClamped) == std::set<std::uint32_t>{1, 8, 9});
  CHECK(neighbours(0, Border::kToroidal) == std::set<std::uint32_t>{1, 7, 8, 9, 15, 56, 57, 63});
  CHECK(neighbours(63, Border::kClamped) == std::set<std::uint32_t>{54, 55, 62});
  CHECK(neighbours(24, Border::kClamped) == std::set<std::uint32_t>{16, 17, 25, 32, 33});
  CHECK(neighbours(24, Border::kToroidal) == std::set<std::uint32_t>{16, 17, 23, 25, 31, 32, 33, 39});
}

TEST_CASE("Cells: states follow from what has corroded, whatever it is") {
  std::mt19937 random(7);
  for (const Border border : {Border::kToroidal, Border::kClamped}) {
    for (int round = 0; round < 60; ++round) {
      Sheet sheet;
      sheet.side = 8 + static_cast<std::size_t>(round) % 13;
      sheet.toroidal = border == Border::kToroidal;
      const std::size_t cells = sheet.cells();
      std::vector<std::uint8_t> corroded(cells);
      std::vector<std::uint8_t> opening(round % 3 == 0 ? 0 : cells);
      sheet.height.assign(cells, 1.0F);
      sheet.state.resize(cells);
      const unsigned density = static_cast<unsigned>(round) % 10 + 1;
      for (std::size_t i = 0; i < cells; ++i) {
        corroded[i] = random() % 10 < density ? 1 : 0;
        if (!opening.empty() && random() % 6 == 0) {
          opening[i] = 1;
          corroded[i] = 0;
          sheet.height[i] = 0;
        }
        if (corroded[i] != 0) {
          sheet.height[i] = random() % 5 == 0 ? 0.0F : 0.5F;
        }
      }
      const std::vector<std::uint32_t> late{static_cast<std::uint32_t>(random() % cells)};
      find_states(corroded, opening, sheet.height, late, sheet.side, border, sheet.state);
      for (std::uint32_t cell = 0; cell < cells; ++cell) {
        bool touches = false;
        bool enclosed = true;
        visit_neighbours(cell, static_cast<std::uint32_t>(sheet.side), border, [&](std::uint32_t other) {
          const bool open = !opening.empty() && opening[other] != 0;
          touches = touches || corroded[other] != 0;
          enclosed = enclosed && (open || corroded[other] != 0);
        });
        const CellState expected = sheet.height[cell] <= 0 ? CellState::kHole
                                   : corroded[cell] != 0
                                       ? (enclosed ? CellState::kDeepening : CellState::kSpreading)
                                   : touches || late[0] == cell ? CellState::kThreatened
                                                                : CellState::kUntouched;
        REQUIRE(sheet.state[cell] == expected);
      }
      if (opening.empty()) {
        CHECK(broken_rule(sheet) == "");
      }
    }
  }
}

TEST_CASE("Cells: openings count neither as corroded nor as holes nor as lost metal") {
  Sheet sheet;
  sheet.side = 8;
  sheet.thickness_mm = 2;
  sheet.height.assign(64, 1.0F);
  sheet.state.assign(64, CellState::kUntouched);
  std::vector<std::uint8_t> opening(64);
  for (std::size_t i = 0; i < 14; ++i) {  // 50 cells of metal are left.
    opening[i] = 1;
    sheet.height[i] = 0;
    sheet.state[i] = CellState::kHole;
  }
  sheet.height[20] = 0.5F;
  sheet.state[20] = CellState::kDeepening;
  sheet.height[21] = 0.75F;
  sheet.state[21] = CellState::kSpreading;
  sheet.height[22] = 0;
  sheet.state[22] = CellState::kHole;
  account(opening, sheet);
  CHECK(sheet.corroded_fraction == Approx(3.0 / 50));
  CHECK(sheet.state3_fraction == Approx(1.0 / 50));
  CHECK(sheet.hole_fraction == Approx(1.0 / 50));
  // 2 mm of steel are 15600 g/m^2.
  CHECK(sheet.mass_loss_g_per_m2 == Approx(15600 * 1.75 / 50));
}

}  // namespace
}  // namespace scatter::corrosion
