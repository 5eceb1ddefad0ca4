// A corroded sheet between its cells.
#pragma once

#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::corrosion {

/// The thesis's limits between metal, rust and hole (corrosion.md 1.8), of LookRule::kByHeight.
inline constexpr float kMetalFromHeight = 0.99F;
inline constexpr float kRustFromHeight = 0.07F;

[[nodiscard]] Regime regime_of_height(float height) noexcept;

struct Place {
  float height = 1;  ///< Share of the thickness left, bilinear.
  float rust = 0;    ///< Share of rust against metal, bilinear over corroded cells.
  Rgb albedo{};      ///< Of the layers at this height; in their convex hull.
  Regime regime = Regime::kMetal;
};

/// The sheet at (u, v): shares of the extent, u to the right, v down, (0, 0) the top left corner of the first
/// cell. Exact in the middle of each cell. Beyond 0..1 a toroidal sheet repeats, a clamped one goes on as its
/// border. Regime    kByState: a hole where the nearest cell is one (an isolated one keeps its size, which a
/// limit on the
///           bilinear height would shrink to a hundredth), rust where its share is 0.5 or more. kByHeight:
///           the thesis's limits.
/// Source    corrosion.md 1.7, 1.8 and 1.10 rows 19-21.
[[nodiscard]] Place evaluate(const Sheet& sheet, const AppearanceOptions& options, double u,
                             double v) noexcept;

}  // namespace scatter::corrosion
