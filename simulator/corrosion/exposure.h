// Maps of exposure for two forms of corrosion that are not uniform.
#pragma once

#include "host_sdk/error/error.h"
#include "simulator/corrosion/growth_options.h"
#include "simulator/corrosion/map.h"

namespace scatter::corrosion {

/// Distance [mm] of the middle of each of a mask's cells to the nearest edge of a cell whose value is at
/// least 0.5: the exact distance to the middle of that cell less half a cell, not below 0; 0 inside. Infinite
/// when there is no such cell. Shape     as mask, which spans a sheet of extent_mm x extent_mm; its cells
/// need not be square. Cost      O(cells). Source    Felzenszwalb and Huttenlocher 2012, "Distance transforms
/// of sampled functions", section 2; on a
///           torus over three copies of each row.
[[nodiscard]] Map distance_to(const Map& mask, double extent_mm, Border border);

/// Differential aeration: less oxygen gets below a cover, and metal corrodes most beside it.
struct AerationOptions {
  double covered = 0.02;  ///< Exposure inside, 0..1.
  double edge_gain = 3;   ///< What the edge has more than the open, 0..1000.
  double reach_mm = 2;    ///< Distance over which that falls to 1 / e, > 0..10000.
};

/// Galvanic contact: the less noble metal corrodes most beside the nobler one, which is spared.
struct GalvanicOptions {
  /// Gain at the contact where both metals have the same area, 0..1000. It grows with the cathode's area and
  /// falls with the anode's.
  double contact_gain = 3;
  double reach_mm = 3;  ///< Distance over which the gain falls to 1 / e, > 0..10000: the electrolyte's reach.
};

/// Exposure: `covered` where cover is at least 0.5, 1 + edge_gain exp(-distance / reach_mm) elsewhere.
/// Errors    kInvalidArgument names the parameter, what it is and its range.
/// Source    Merillou et al. 2001 as the thesis reports it; the shape is corrosion.md 1.11.
[[nodiscard]] Result<Map> aeration_exposure(const Map& cover, double extent_mm, Border border,
                                            const AerationOptions& options = {});

/// Exposure: 0 where contact (with the nobler metal) is at least 0.5, 1 + gain exp(-distance / reach_mm)
/// elsewhere; gain = contact_gain * area of contact / area of the rest. Errors    kInvalidArgument names the
/// parameter, what it is and its range; also when no metal is left to corrode.
[[nodiscard]] Result<Map> galvanic_exposure(const Map& contact, double extent_mm, Border border,
                                            const GalvanicOptions& options = {});

/// Product of two exposures, at the larger width and height of the two where one of them is a constant.
/// Errors    kInvalidArgument when sizes differ and neither is a constant.
[[nodiscard]] Result<Map> product(const Map& first, const Map& second);

}  // namespace scatter::corrosion
