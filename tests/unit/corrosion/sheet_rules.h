// What holds of every sheet, cell by cell, in plain words.
#pragma once

#include <fmt/core.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "simulator/corrosion/cells.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::corrosion {

/// The first broken rule of corrosion.md 5.1, check 12 (and check 6: a hole is where nothing is left), or
/// nothing. `waiting` counts the late seeds that wait: threatened cells that touch no rust.
inline std::string broken_rule(const Sheet& sheet, std::size_t* waiting = nullptr) {
  const auto side = static_cast<std::uint32_t>(sheet.side);
  const Border border = sheet.toroidal ? Border::kToroidal : Border::kClamped;
  std::size_t untouching = 0;
  for (std::uint32_t cell = 0; cell < sheet.cells(); ++cell) {
    const CellState state = sheet.state[cell];
    CellState least = CellState::kHole;
    CellState most = CellState::kUntouched;
    visit_neighbours(cell, side, border, [&](std::uint32_t other) {
      least = std::min(least, sheet.state[other]);
      most = std::max(most, sheet.state[other]);
    });
    if ((state == CellState::kHole) != (sheet.height[cell] <= 0)) {
      return fmt::format("cell {}: state {} at height {}", cell, static_cast<int>(state), sheet.height[cell]);
    }
    if (state == CellState::kSpreading && least == CellState::kUntouched) {
      return fmt::format("cell {} spreads, but a neighbour is not threatened", cell);
    }
    if (state == CellState::kSpreading && least >= CellState::kSpreading) {
      return fmt::format("cell {} spreads, but has nowhere to", cell);
    }
    if (state == CellState::kDeepening && least < CellState::kSpreading) {
      return fmt::format("cell {} only deepens, but a neighbour has not corroded", cell);
    }
    if (state <= CellState::kThreatened && sheet.height[cell] != 1) {
      return fmt::format("cell {} has not corroded, but lost metal", cell);
    }
    untouching += state == CellState::kThreatened && most < CellState::kSpreading ? 1 : 0;
  }
  if (waiting != nullptr) {
    *waiting = untouching;
  }
  return {};
}

}  // namespace scatter::corrosion
