// Flash memory stricter than hardware, whose power can be cut at any operation.
#pragma once

#include <cstddef>
#include <cstdint>
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
  kHalfErased,  ///< Erase: every cell is somewhere between old and erased. Program: as kTornPrefix.
  kAfter,       ///< It was finished.
  kUnstable,    ///< Every cell of the operation reads as old or new, drawn again at each power-on.
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
/// correct firmware leaves violations() at 0. Threads: one.
class CutFlash final : public firmware::Flash {
 public:
  CutFlash(Geometry geometry, Supply& supply);

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
  void rot(std::uint32_t offset, std::uint8_t flipped_bits);
  void trap(std::uint32_t offset, std::uint32_t length);

 private:
  enum class Cell : std::uint8_t { kSound, kUnstable, kTrapping };
  [[nodiscard]] bool begin_operation(bool& cut_now) noexcept;
  void break_off(std::uint32_t offset, std::span<const std::byte> wanted, bool erasing) noexcept;
  void violate(std::string what) noexcept;

  Geometry geometry_;
  Supply& supply_;
  std::vector<std::byte> cells_;
  std::vector<std::byte> alternative_;  ///< Of unstable cells: what they read as otherwise.
  std::vector<Cell> states_;
  std::vector<std::uint64_t> erases_;
  std::vector<bool> worn_;
  std::uint64_t violations_ = 0;
  std::string violation_;
};

}  // namespace scatter::simulator
