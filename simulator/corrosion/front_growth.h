// Mode::kPhysical: a front that spreads and a surface that deepens behind it.
#pragma once

#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "simulator/corrosion/growth.h"

namespace scatter::corrosion {

/// The history of a sheet as two numbers per cell: how far a front in neutral surroundings had come when rust
/// reached the cell (O / R of Gu et al. 2006), and how fast the cell deepens since (R).
///
/// docs/corrosion.md, "Physical mode", has the model and its reasons. `options` have been settled; `notes` go
/// into the result. Errors   kInvalidArgument when there are more starting points than cells that may
/// corrode; kAborted when
///          stopped.
/// Memory   about 40 bytes per cell while it runs, 12 afterwards.
/// Cost     docs/corrosion.md; one thread.
[[nodiscard]] Result<std::shared_ptr<const Growth>> grow_front(GrowthOptions options,
                                                               std::vector<std::string> notes,
                                                               const Growth::Progress& progress,
                                                               const std::stop_token& stop);

}  // namespace scatter::corrosion
