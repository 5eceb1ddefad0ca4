// Which side of the sample is lit.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/descriptor.h"

namespace scatter::measurement {

/// Whether sources above the sample or those of the transmission module light it.
enum class Geometry { kReflection, kTransmission };

/// The head stands below the sample.
[[nodiscard]] bool is_transmission(const protocol::Illumination& illumination) noexcept;

/// Indices of the illuminations of one geometry, ascending.
[[nodiscard]] std::vector<std::uint8_t> illuminations_of(const protocol::Descriptor& descriptor,
                                                         Geometry geometry);

}  // namespace scatter::measurement
