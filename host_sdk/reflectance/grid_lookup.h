// Fast interpolation in grids: the evaluation of GridBrdf and SpecularGridBrdf, by SIMD chosen at
// run time. What cannot go the fast way is handed back to the grid's own scalar code.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/cell_table.h"

namespace scatter::reflectance {

/// Instead of an origin: which nodes are in use hangs on the last bits, and the origin on the nodes; the
/// scalar code decides.
inline constexpr Origin kAskScalar = static_cast<Origin>(255);
/// Distance from a node, in steps, and from an axis's end, at which float arithmetic leaves the origin
/// to the scalar code.
inline constexpr double kUnsureInFloat = 2e-4;
inline constexpr double kUnsureAngle = 3e-6;  ///< [rad]

/// Part that one block (an incidence at a rotation) has in the answer for one omega_i.
struct BlockShare {
  std::uint32_t block = 0;
  double cos_turn = 1;  ///< Turns the mirror direction of omega_i into that of the block.
  double sin_turn = 0;
  double column_offset = 0;  ///< Added to the column position (azimuth of the block's light).
  double weight = 1;
};

/// All that depends on omega_i alone.
struct IncidenceShares {
  Origin origin = Origin::kMeasured;  ///< kInvalid: omega_i is below the horizon.
  double cos_phi = 1;                 ///< Azimuth of the light.
  double sin_phi = 0;
  std::size_t count = 0;
  std::array<BlockShare, 4> blocks;
};

/// Incidences in one plane, by increasing theta_i. For many at once each quantity is kept in float,
/// padded to a whole register; for one at a time all of an incidence in double.
struct IncidenceAxis {
  struct Incidence {
    double theta = 0;  ///< [rad]
    double cosine = 1;
    double sine = 0;
    double inverse_gap = 0;
    double column_offset = 0;
  };
  static constexpr std::size_t kPadding = 16;
  std::size_t count = 0;     ///< 0: no such axis.
  std::vector<float> theta;  ///< [rad]
  std::vector<float> cosine;
  std::vector<float> sine;
  std::vector<float> inverse_gap;  ///< 1 / (theta of the next - this) [1/rad]; 0 at the last.
  std::vector<float> column_offset;
  std::vector<Incidence> one_by_one;
  double same_angle = 0;      ///< [rad] nearer than this is the incidence itself.
  double normal_cos_phi = 1;  ///< Azimuth taken for light from the normal.
  double normal_sin_phi = 0;

  /// Angles [rad] ascend; column offsets as in BlockShare.
  void set(std::span<const double> angles, std::span<const double> column_offsets);
};

/// Equal steps in theta_o (rows) and phi_o (columns) about the normal.
struct NormalLookup {
  CellTable table;
  IncidenceAxis incidences;  ///< Empty: pairs go through IncidenceShares one by one.
  bool transmits = false;
  double lowest_z = 0;  ///< Outgoing directions must be above this.
  double row_per_rad = 0;
  double column_per_rad = 0;
  double last_row = 0;
  double column_count = 0;
  double same_node = 0;  ///< Share of a step.
};

/// An axis of angles cut into steps: equal ones are calculated, others searched from a guess.
struct AngleAxis {
  std::vector<double> nodes;  ///< [rad]
  bool open_low = false;      ///< Angles below the first node can occur.
  bool open_high = false;     ///< Angles above the last node can occur.
  bool equal_steps = false;
  double per_rad = 0;
  std::vector<std::uint32_t> guess;  ///< Last node at or below each of equal slices of the axis.
  double guess_per_rad = 0;

  void set(std::vector<double> angles);
};

/// Azimuth (rows) and radial angle (columns) about the mirror direction.
struct SpecularLookup {
  CellTable table;
  IncidenceAxis incidences;  ///< Empty: as for NormalLookup.
  bool transmits = false;
  bool folded = false;    ///< Azimuths beyond pi are mirrored.
  bool periodic = false;  ///< The last row stands for the first one.
  AngleAxis azimuth;
  AngleAxis radial;
  double same_angle = 0;  ///< [rad] nearer than this to a node is the node.
};

/// Values at one omega_i, in double; f_per_sr as in Brdf::eval_batch.
/// Shape    origin.size() == omega_o.size(), wanted or not.
void look_up(const NormalLookup& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
             std::span<double> f_per_sr, std::span<Origin> origin) noexcept;
void look_up(const SpecularLookup& grid, const IncidenceShares& incidence, std::span<const Direction> omega_o,
             std::span<double> f_per_sr, std::span<Origin> origin) noexcept;
/// Values at one pair, in double; f_per_sr has one value per channel.
[[nodiscard]] Origin look_up_one(const NormalLookup& grid, const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> f_per_sr) noexcept;
[[nodiscard]] Origin look_up_one(const SpecularLookup& grid, const Direction& omega_i,
                                 const Direction& omega_o, std::span<double> f_per_sr) noexcept;
/// Values at pairs, in float: those of directions at most 1e-6 rad off.
void look_up_pairs(const NormalLookup& grid, std::span<const Direction> omega_i,
                   std::span<const Direction> omega_o, std::span<double> f_per_sr,
                   std::span<Origin> origin) noexcept;
void look_up_pairs(const SpecularLookup& grid, std::span<const Direction> omega_i,
                   std::span<const Direction> omega_o, std::span<double> f_per_sr,
                   std::span<Origin> origin) noexcept;

}  // namespace scatter::reflectance
