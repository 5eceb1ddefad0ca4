// A corroded sheet of metal at one age.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace scatter::corrosion {

/// What has become of a cell. Numbers are the thesis's and part of the written files.
enum class CellState : std::uint8_t {
  kUntouched = 0,
  kThreatened = 1,  ///< Touches corroded metal, or a late seed waits there.
  kSpreading = 2,   ///< Corroded, with a neighbour that is not.
  kDeepening = 3,   ///< Corroded all round; only goes deeper.
  kHole = 4,        ///< Nothing left.
};

/// The state of every cell, row major, first row at the top. All that shows a corroded sheet (colour, height,
/// normals, regimes, scattering) is made from one of these, so they always match.
/// Threads   immutable once made.
struct Sheet {
  std::size_t side = 0;  ///< Cells along each side.
  double extent_mm = 0;  ///< Length of each side.
  double thickness_mm = 0;
  double age_years = 0;
  bool toroidal = true;

  std::vector<float> height;  ///< Share of the thickness left, 0..1; openings 0.
  std::vector<CellState> state;
  /// Age [years] at which each cell began to corrode; infinite where it has not, up to the oldest age of the
  /// run. A cell has been rusting for age_years - birth years. Shared by all ages of one run.
  std::shared_ptr<const std::vector<float>> birth_years;

  double target_g_per_m2 = 0;     ///< What the law asks for.
  double mass_loss_g_per_m2 = 0;  ///< What is gone, summed over the heights.
  double corroded_fraction = 0;   ///< Cells of state 2, 3, 4 that were metal, of all that were metal.
  double state3_fraction = 0;
  double hole_fraction = 0;  ///< State 4; openings do not count.
  std::uint64_t events = 0;  ///< Cells reached by rust, and hits that deepened one (Mode::kThesis).
  bool exhausted = false;    ///< The sheet was used up, or all that may corrode was, before the target.

  [[nodiscard]] std::size_t cells() const noexcept { return side * side; }
  [[nodiscard]] double cell_mm() const noexcept { return extent_mm / static_cast<double>(side); }
};

/// BLAKE2b-128 of heights and states, 32 hexadecimal digits: equal for equal sheets on every machine.
[[nodiscard]] std::string hash(const Sheet& sheet);

}  // namespace scatter::corrosion
