// Everything that decides how a sheet corrodes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "simulator/corrosion/corrosivity.h"
#include "simulator/corrosion/map.h"

namespace scatter::corrosion {

/// How rust spreads.
enum class Mode : std::uint8_t {
  kThesis,    ///< Cell by cell, at random, as the thesis has it (event_growth.h). Depends on the grid.
  kPhysical,  ///< A front that moves and a surface that deepens behind it (front_growth.h). Converges with
              ///< the grid.
};

/// What lies beyond the border of the sheet.
enum class Border : std::uint8_t {
  kToroidal,  ///< Its other side: the sheet tiles without a seam.
  kClamped,   ///< Nothing.
};

/// Of Mode::kThesis only.
struct EventOptions {
  double bite = 0.05;  ///< Share of the thickness lost per hit where material is 0.5; > 0..1.
  bool conversion_removes =
      false;  ///< A cell also loses metal when its last neighbour corrodes (the pseudocode).
};

/// Of Mode::kPhysical only. Fields are random, isotropic and the same on every grid (random_field.h); sigma
/// is the standard deviation of the logarithm of what they multiply.
struct FrontOptions {
  /// Depth gained [mm] while the front moves 1 mm, where all maps are neutral.
  double depth_per_spread = 0.08;
  double skin_um = 5;            ///< Depth lost soon after the front arrives.
  double front_sigma = 1.1;      ///< Of the front's speed.
  double front_length_mm = 4;    ///< Correlation length of the speed; shorter scales to the finest.
  double front_roughness = 0.3;  ///< Of the speed: FieldSpectrum::roughness, small is ragged.
  double pit_sigma = 0.6;        ///< Of the rate of deepening.
  double pit_length_mm = 0.8;    ///< The same for the rate of deepening.
  double pit_roughness = 0.8;    ///< The same for the rate of deepening.
  double finest_mm = 0.05;       ///< Nothing varies at random on shorter scales (waves of 2 pi times it).
};

struct GrowthOptions {
  Mode mode = Mode::kPhysical;
  Corrosivity corrosivity = Corrosivity::kMedium;
  Law law = Law::kThesis;
  double age_years = 25;  ///< The oldest age that will be asked for; clamped to 0..100 with a note.
  std::uint32_t starting_points = 30;  ///< 1..cells of the grid.
  std::size_t side = 1024;             ///< Cells along each side, 8..16384.
  double extent_mm = 50;               ///< Length of each side, 0.1..10000.
  double thickness_mm = 1;             ///< 0.001..1000.
  std::uint64_t seed = 1;
  Border border = Border::kToroidal;

  /// 0 dark = vulnerable (scratches), 1 white = protected (grease); susceptibility = 1 - surface.
  Map surface{};
  /// 0 dark = poor metal that pits, 1 white = good metal on which rust spreads; removal = 1 - material.
  Map material{};
  /// Multiplies the susceptibility and the rate of deepening, >= 0, 1 = in the open; see exposure.h.
  Map exposure{1, 1, {1.0F}};
  /// Below 0.5: a hole that was there from the start; it neither corrodes nor counts as lost metal.
  Map opening{1, 1, {1.0F}};

  double least_susceptibility = 1e-3;  ///< What white surface is taken for; 0 makes white a mask, 0..1.
  /// Late seeds that fall on the whole sheet per 1000 g/m^2 of mean loss, drawn by susceptibility, Poisson in
  /// the mass; those that fall on rust do nothing. Left out: as many as there are starting points.
  std::optional<double> late_points{};
  double reserve = 0;  ///< Share of the sheet's metal that is never taken, 0..1.

  EventOptions events{};
  FrontOptions front{};
};

/// Of the whole sheet, before it corrodes [g/m^2].
[[nodiscard]] double metal_g_per_m2(const GrowthOptions& options) noexcept;
/// What the law asks for after `years`, but never more than the sheet holds less the reserve [g/m^2].
[[nodiscard]] double attainable_loss_g_per_m2(const GrowthOptions& options, double years) noexcept;
/// max(1 - surface, least_susceptibility) * exposure on the grid; 0 in openings (see openings_of in cells.h).
[[nodiscard]] std::vector<float> susceptibility_of(const GrowthOptions& options,
                                                   std::span<const std::uint8_t> opening);
/// Late seeds per 1000 g/m^2, given or by default.
[[nodiscard]] double late_points_of(const GrowthOptions& options) noexcept;
/// Errors    kInvalidArgument names the parameter, what it is and its range. Changes ages out of range and
/// adds a
///           note that says so.
[[nodiscard]] Status settle(GrowthOptions& options, std::vector<std::string>& notes);

}  // namespace scatter::corrosion
