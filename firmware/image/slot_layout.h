// Where things lie in a firmware slot: header, body, and the marks in its last erase unit.
#pragma once

#include <algorithm>
#include <cstdint>

#include "firmware/ports/ports.h"
#include "protocol/image_header.h"

namespace scatter::firmware {

/// A mark on flash [B]; see marks.h.
inline constexpr std::uint32_t kMarkBytes = 16;
/// Places for marks in a slot.
inline constexpr std::uint32_t kMarkPlaces = 64;

struct SlotLayout {
  Flash::Geometry flash;
  std::uint32_t slot_bytes = 0;
  std::uint32_t body_capacity = 0;  ///< Largest body [B].
  std::uint32_t marks_offset = 0;   ///< Start of the last erase unit.
  std::uint32_t place_bytes = 0;    ///< One place for a mark: whole program granules.
  /// False: no firmware slot can be kept on flash of this geometry (erase units of 4096 B and more, at least
  /// two; granules of 1 to 64 B, a power of two).
  bool usable = false;
};

[[nodiscard]] inline SlotLayout layout_of(Flash& flash) noexcept {
  SlotLayout layout;
  const Flash::Geometry g = flash.geometry();
  const std::uint32_t granule = g.program_bytes;
  layout.flash = g;
  layout.usable = granule >= 1 && granule <= 64 && (granule & (granule - 1)) == 0 && g.unit_bytes >= 4096 &&
                  g.unit_bytes % 64 == 0 && g.units >= 2 && g.units <= 0x4000'0000 / g.unit_bytes;
  if (layout.usable) {
    layout.slot_bytes = g.unit_bytes * g.units;
    layout.marks_offset = layout.slot_bytes - g.unit_bytes;
    layout.body_capacity = layout.marks_offset - protocol::kImageBodyOffset;
    layout.place_bytes = std::max(kMarkBytes, granule);
  }
  return layout;
}

}  // namespace scatter::firmware
