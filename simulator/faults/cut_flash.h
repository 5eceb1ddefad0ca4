// Flash memory stricter than hardware, whose power can be cut at any operation.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "firmware/ports/ports.h"

namespace scatter::simulator {

/// What a cut leaves of the operation that it interrupts.
enum class CutKind : std::uint8_t {
  kBefore,      ///< Nothing happened.
  kTornPrefix,  ///< Program: some first bytes are there, one byte lacks some of its bits. Erase: some first
                ///< bytes.
  kHalfErased,  ///< Every cell is somewhere between old and new, for good.
  kAfter,       ///< It was finished.
  kUnstable,    ///< The cells of the operation read as old or new: all old, all new, or each its own way,
                ///< drawn again at each power-on.
  kTrap,        ///< Reading any cell of the operation fails until it is erased.
};
inline constexpr std::uint8_t kCutKinds = 6;

struct PowerCut {
  std::uint64_t operation = 0;  ///< Counted from 0 over programs and erases since the last arm().
  CutKind kind = CutKind::kBefore;
  std::uint32_t detail = 0;  ///< Seed of what is random about it.
};

/// One part of flash or several that share a supply: give them the same Supply.
class Supply {
 public:
  /// Cuts at the given operation; counts operations from now on.
  void arm(const PowerCut& cut) noexcept {
    cut_ = cut;
    operations_ = 0;
    armed_ = true;
    lost_ = false;
  }
  /// No cut; counts operations from now on.
  void disarm() noexcept {
    operations_ = 0;
    armed_ = false;
    lost_ = false;
  }
  /// The power went: nothing that the firmware does has any effect until power_on(). Throw its RAM away.
  [[nodiscard]] bool lost() const noexcept { return lost_; }
  [[nodiscard]] std::uint64_t operations() const noexcept { return operations_; }
  [[nodiscard]] std::uint64_t power_ons() const noexcept { return power_ons_; }
  /// Power comes back: disarms, and unstable cells are drawn anew.
  void power_on() noexcept {
    disarm();
    ++power_ons_;
  }

 private:
  friend class CutFlash;
  PowerCut cut_;
  std::uint64_t operations_ = 0;
  std::uint64_t power_ons_ = 0;
  bool armed_ = false;
  bool lost_ = false;
};

/// Programming a cell that is not erased, an unaligned range or one outside the part is a violation: a
/// correct firmware leaves violations() at 0. A cell that a cut left unstable counts as erased while it reads
/// so; programming it either makes it sound or, just as often, fails and leaves the granule unreadable, as
/// flash with error correction does: who reads back and goes on to another place survives both.
///
/// Copies share their cells until one changes them: a copy costs about 16 bytes per kilobyte.
/// Threads: one per object; copies are independent.
class CutFlash final : public firmware::Flash {
 public:
  CutFlash(Geometry geometry, Supply& supply);
  /// The same cells on another supply.
  CutFlash(const CutFlash& other, Supply& supply);

  [[nodiscard]] Geometry geometry() noexcept override { return geometry_; }
  [[nodiscard]] bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override;
  [[nodiscard]] bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool erase(std::uint32_t unit) noexcept override;

  [[nodiscard]] std::uint64_t violations() const noexcept { return violations_; }
  /// Of the first violation, for people; "" when there was none.
  [[nodiscard]] const std::string& violation() const noexcept { return violation_; }
  [[nodiscard]] std::uint64_t erases(std::uint32_t unit) const { return erases_.at(unit); }

  /// Wear and rot, for tests: the unit can no longer be erased nor programmed; bits flip; reads trap.
  void wear_out(std::uint32_t unit);
  /// The unit programs without complaint and leaves some bits of the first byte unprogrammed.
  void weaken(std::uint32_t unit);
  void rot(std::uint32_t offset, std::uint8_t flipped_bits);
  void trap(std::uint32_t offset, std::uint32_t length);
  /// Puts these bytes there, whatever was there before.
  void overwrite(std::uint32_t offset, std::span<const std::byte> bytes);

 private:
  static constexpr std::uint32_t kPageBytes = 1024;
  enum class CellState : std::uint8_t { kSound, kUnstable, kTrapping };
  struct Cell {
    std::byte value{0xFF};
    CellState state = CellState::kSound;
    std::byte alternative{0xFF};  ///< Of an unstable cell: what it reads as otherwise.
    std::uint32_t seed = 0;       ///< Of an unstable cell: names the cut that left it.
  };
  using Bytes = std::array<std::byte, kPageBytes>;
  using Cells = std::array<Cell, kPageBytes>;
  /// Neither: erased. `sound`: every cell is sound. `cells`: some are not.
  struct Page {
    std::shared_ptr<const Bytes> sound;
    std::shared_ptr<const Cells> cells;
  };

  [[nodiscard]] std::uint32_t bytes() const noexcept { return geometry_.unit_bytes * geometry_.units; }
  [[nodiscard]] bool inside(std::uint32_t offset, std::size_t length) const noexcept;
  [[nodiscard]] Cell cell(std::uint32_t offset) const noexcept;
  /// What the cell reads as in this power-on; nothing for a trapping one is told here.
  [[nodiscard]] std::byte reading(const Cell& cell, std::uint32_t offset) const noexcept;
  /// Calls change(cell, index in the range) for every cell of the range.
  template <typename Change>
  void edit(std::uint32_t offset, std::size_t length, Change&& change);
  /// Sound cells with value(index in the range).
  template <typename Value>
  void set(std::uint32_t offset, std::size_t length, Value&& value);
  void set_erased(std::uint32_t offset, std::uint32_t length);
  /// True: go on. False: the power is gone, or goes now (`cut_now`).
  [[nodiscard]] bool begin_operation(bool& cut_now) noexcept;
  void break_program(std::uint32_t offset, std::span<const std::byte> wanted);
  void break_erase(std::uint32_t offset);
  void violate(std::string what) noexcept;

  Geometry geometry_;
  Supply* supply_;
  std::vector<Page> pages_;
  std::vector<std::uint64_t> erases_;
  std::vector<bool> worn_;
  std::vector<bool> weak_;
  std::uint64_t violations_ = 0;
  std::string violation_;
};

}  // namespace scatter::simulator
