// The cells as Mode::kThesis works on them: a byte of neighbourhood each.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "simulator/corrosion/cells.h"
#include "simulator/corrosion/event_setup.h"

namespace scatter::corrosion {

/// Sets of the nine cells around one: bit 3 * row + column, rows from above, columns from the left.
struct Around {
  std::uint32_t threatened;
  std::uint32_t enclosed;
};

/// Who has corroded and who is next to it.
///
/// A cell's byte counts the neighbours that enclose it (corroded, open or beyond a clamped border) in its low
/// four bits. Three rows of three bytes change with an event; they are read and written as three words.
class EventCells {
 public:
  explicit EventCells(const EventSetup& setup)
      : setup_(&setup),
        side_(setup.side),
        bytes_(std::size_t{setup.side} * setup.side + sizeof(std::uint32_t)) {
    for (std::uint32_t i = 0; i < side_; ++i) {
      for (const std::uint32_t cell : {i, (side_ - 1) * side_ + i, i * side_, i * side_ + side_ - 1}) {
        bytes_[cell] |= kBorder;
      }
    }
    if (setup.border == Border::kClamped) {
      for (std::uint32_t cell = 0; cell < side_ * side_; ++cell) {
        if ((bytes_[cell] & kBorder) != 0) {
          std::uint32_t there = 0;
          visit_neighbours(cell, side_, Border::kClamped, [&](std::uint32_t) { ++there; });
          bytes_[cell] = static_cast<std::uint8_t>(bytes_[cell] + 8 - there);
        }
      }
    }
    for (std::uint32_t cell = 0; cell < setup.opening.size(); ++cell) {
      if (setup.opening[cell] != 0) {
        bytes_[cell] |= kKnown;
        visit_neighbours(cell, side_, setup.border, [&](std::uint32_t other) { ++bytes_[other]; });
      }
    }
    for (std::uint32_t row = 0; row < 3; ++row) {
      for (std::uint32_t column = 0; column < 3; ++column) {
        offset_[3 * row + column] = (row - 1) * side_ + column - 1;
      }
    }
  }

  [[nodiscard]] bool corroded(std::uint32_t cell) const noexcept { return (bytes_[cell] & kCorroded) != 0; }
  /// Threatened, corroded or open.
  [[nodiscard]] bool known(std::uint32_t cell) const noexcept { return (bytes_[cell] & kKnown) != 0; }
  [[nodiscard]] bool enclosed(std::uint32_t cell) const noexcept { return (bytes_[cell] & kCount) == 8; }

  void fetch(std::uint32_t cell) const noexcept {
    const std::uint8_t* const here = bytes_.data() + cell;
    __builtin_prefetch(here, 1);
    __builtin_prefetch(here - (cell >= side_ ? side_ : 0), 1);
    __builtin_prefetch(here + side_, 1);
  }

  /// A late seed begins to wait.
  void threaten(std::uint32_t cell) noexcept { bytes_[cell] |= kKnown; }

  [[nodiscard]] bool at_border(std::uint32_t cell) const noexcept { return (bytes_[cell] & kBorder) != 0; }

  /// A cell inside the border has corroded: who of the nine cells around it, itself included, is threatened
  /// for the first time, and who has corroded and has no neighbour left to spread to.
  Around corrode_inside(std::uint32_t cell) noexcept {
    std::uint8_t* const at = bytes_.data() + cell - 1;
    std::uint32_t above = load(at - side_) + 0x010101U;
    std::uint32_t here = load(at) + 0x010001U;
    std::uint32_t below = load(at + side_) + 0x010101U;
    here |= static_cast<std::uint32_t>(kCorroded | kKnown) << 8U;
    const std::uint32_t new_above = ~above & 0x404040U;
    const std::uint32_t new_here = ~here & 0x404040U;
    const std::uint32_t new_below = ~below & 0x404040U;
    store(at - side_, above | new_above);
    store(at, here | new_here);
    store(at + side_, below | new_below);
    // A count of 8 is bit 3, which beside kCorroded, bit 5, says that all around have corroded; nobody comes
    // to it twice.
    return {.threatened = three(new_above >> 6U) | three(new_here >> 6U) << 3U | three(new_below >> 6U) << 6U,
            .enclosed = three((above & above << 2U) >> 5U) | three((here & here << 2U) >> 5U) << 3U |
                        three((below & below << 2U) >> 5U) << 6U};
  }
  /// The same for a cell at the border: threatened(other), enclosed(other).
  template <typename Threatened, typename Enclosed>
  void corrode_at_border(std::uint32_t cell, Threatened&& threatened, Enclosed&& enclosed) {
    bytes_[cell] |= kCorroded | kKnown;
    visit_neighbours(cell, side_, setup_->border, [&](std::uint32_t other) {
      const std::uint8_t byte = ++bytes_[other];
      if ((byte & kKnown) == 0) {
        bytes_[other] |= kKnown;
        threatened(other);
      } else if ((byte & kCorroded) != 0 && (byte & kCount) == 8) {
        enclosed(other);
      }
    });
    if ((bytes_[cell] & kCount) == 8) {
      enclosed(cell);
    }
  }
  /// Either of them.
  template <typename Threatened, typename Enclosed>
  void corrode(std::uint32_t cell, Threatened&& threatened, Enclosed&& enclosed) {
    if (at_border(cell)) {
      corrode_at_border(cell, threatened, enclosed);
      return;
    }
    const Around around = corrode_inside(cell);
    for (std::uint32_t found = around.threatened; found != 0; found &= found - 1) {
      threatened(cell + offset_[std::countr_zero(found)]);
    }
    for (std::uint32_t found = around.enclosed; found != 0; found &= found - 1) {
      enclosed(cell + offset_[std::countr_zero(found)]);
    }
  }

 private:
  static constexpr std::uint8_t kCount = 0x0F;
  static constexpr std::uint8_t kCorroded = 0x20;
  static constexpr std::uint8_t kKnown = 0x40;
  static constexpr std::uint8_t kBorder = 0x80;

  static std::uint32_t load(const std::uint8_t* at) noexcept {
    std::uint32_t word = 0;
    std::memcpy(&word, at, sizeof word);
    return word;
  }
  static void store(std::uint8_t* at, std::uint32_t word) noexcept { std::memcpy(at, &word, sizeof word); }

  /// Bits 0, 8 and 16 side by side.
  static std::uint32_t three(std::uint32_t bits) noexcept {
    return ((bits & 0x010101U) * 0x010204U >> 16U) & 7U;
  }

  const EventSetup* setup_;
  std::uint32_t side_;
  std::vector<std::uint8_t> bytes_;  ///< One word longer than there are cells.
  std::uint32_t offset_[9] = {};     ///< From a cell to the one of a bit; wraps around below zero.
};

}  // namespace scatter::corrosion
