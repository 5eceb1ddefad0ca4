// Step 8: the systematic part of the uncertainty, after the GUM (JCGM 100:2008, 5.1).
#pragma once

#include <vector>

#include "host_sdk/measurement/lanes.h"
#include "host_sdk/measurement/resampler.h"

namespace scatter::measurement {

/// Standard uncertainty [1/sr] per node and lane (index node * lanes + lane) from everything that
/// repeating the measurement does not show:
///   reference certificates   x f_w u_w and (1 - x) f_b u_b, x = (f - f_b) / (f_w - f_b)
///   linearity                f u_lin |level of sample - level of reference|, levels as share of the well
///   geometry                 gradient of f times the pointing uncertainties of camera (centre, scale
///                            growing to the edge, rotation) and source head (its theta and phi, which
///                            move a lobe as the same angles of omega_o do)
///   blur                     a third of the first-order correction for source disc and pixel
///   blind spots              difference between linear and quadratic fill
/// Contributions are taken as independent of each other and added in squares.
[[nodiscard]] std::vector<float> systematic_uncertainty(const NodeValues& nodes, const GridShape& grid,
                                                        const SampleFrame& frame, const RecordedScan& scan,
                                                        const LaneSelection& selection);

}  // namespace scatter::measurement
