// The marks of a firmware slot: how far its image has come. A log in the slot's last erase unit that is only
// ever added to; the last good mark says where the image stands.
//
// Mark: offset size
//            0    4 magic "OSMK"
//            4    1 kind: 1 ready, 2 tried, 3 confirmed, 4 reverted
//            5    3 zero
//            8    4 number: of a confirmation, rising over both slots; else 0
//           12    4 CRC-32C of bytes 0..11
// All little endian. Each mark takes a whole place (SlotLayout::place_bytes, the rest erased) and is written
// twice, read back, and tried again in the next place when it did not take. A power cut can leave cells that
// read differently next time; so whoever finds a mark with only one good copy writes the second before it
// acts on it, and a decision against an image is marked, too (reverted), before it is acted on.
#pragma once

#include <cstdint>

#include "firmware/ports/ports.h"

namespace scatter::firmware {

enum class MarkKind : std::uint8_t {
  kNone = 0,
  kReady = 1,      ///< The body was verified; try it at the next boot.
  kTried = 2,      ///< A trial was begun.
  kConfirmed = 3,  ///< Keep it.
  kReverted = 4,   ///< The trial ended without a confirmation.
};

struct Marks {
  MarkKind last = MarkKind::kNone;
  std::uint32_t number = 0;  ///< Of the last mark.
  std::uint8_t copies = 0;   ///< Good copies of the last mark, at most 2.
  bool any = false;          ///< Something was written here, good or not.
};

/// Cost: kMarkPlaces short reads.
[[nodiscard]] Marks read_marks(Flash& slot) noexcept;

/// Adds two copies of a mark. False when not even one reads back: the marks stand as before.
/// Worst case: kMarkPlaces programs.
[[nodiscard]] bool write_mark(Flash& slot, MarkKind kind, std::uint32_t number = 0) noexcept;

/// Completes a last mark of one copy. False: the unit takes no more; the one copy stands.
[[nodiscard]] bool repair_marks(Flash& slot, Marks& marks) noexcept;

}  // namespace scatter::firmware
