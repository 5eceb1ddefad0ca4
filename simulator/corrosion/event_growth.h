// Mode::kThesis: rust that spreads and deepens cell by cell, at random.
#pragma once

#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/growth.h"

namespace scatter::corrosion {

/// The process of corrosion.md 1.3 to 1.6, with the resolutions of 1.10: one cell of width and one of depth
/// per pass, each by its weight, at the cost of a few dozen nanoseconds whatever the size of the grid.
///
/// `options` must be settled (growth_options.h).
/// Errors  kInvalidArgument names starting_points when fewer cells may corrode; kResourceExhausted when the
///         bites are so small that the log would not end; kAborted when stopped. May throw std::bad_alloc.
/// Cost    even maps: 20 ns per event at 256 x 256 cells, 31 at 2048 x 2048; uneven maps: 90 and 150.
///         4 bytes per event and 4 more per cell reached; at() costs about as much as the run with even maps.
[[nodiscard]] Result<std::shared_ptr<const Growth>> grow_events(GrowthOptions options,
                                                                std::vector<std::string> notes,
                                                                const Growth::Progress& progress,
                                                                const std::stop_token& stop);

}  // namespace scatter::corrosion
