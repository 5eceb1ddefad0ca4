// Particles that fall onto a grid and stay: how thickness maps grow.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/random/stream.h"

namespace scatter::corrosion {

/// How a layer thickens.
enum class Deposition : std::uint8_t {
  kSteady = 0,     ///< Everywhere at its own rate, without particles; see seed_field.h for the rates.
  kRandom = 1,     ///< A particle stays where it fell: columns know nothing of each other.
  kRelaxed = 2,    ///< It moves to the lowest of its column and the four beside it, which evens pits.
  kBallistic = 3,  ///< It sticks where it first touches, h = max(h + 1, neighbours): correlated and porous.
};

/// "steady", "random", "relaxed", "ballistic".
[[nodiscard]] std::string_view name(Deposition deposition) noexcept;
/// Errors: kInvalidArgument lists the names.
[[nodiscard]] Result<Deposition> deposition_named(std::string_view name);

/// Draws places with given weights, each draw in constant time.
/// Source    Vose 1991, "A linear algorithm for generating random numbers with a given distribution".
class FallPlaces {
 public:
  /// Errors  kInvalidArgument when a weight is negative or not finite, or all are 0, or there are none or
  /// more
  ///         than 2^32.
  [[nodiscard]] static Result<FallPlaces> make(std::span<const float> weights);

  /// A place; those of weight 0 are never drawn. Uses two words of the stream.
  [[nodiscard]] std::size_t draw(simulator::RandomStream& stream) const noexcept {
    const std::uint32_t place = stream.below(static_cast<std::uint32_t>(slots_.size()));
    const Slot& slot = slots_[place];
    return stream.bits() < slot.keep ? place : slot.other;
  }

 private:
  /// `keep` of 2^32 draws stay; a place of weight 0 keeps none, one that always stays is its own `other`.
  struct Slot {
    std::uint32_t keep;
    std::uint32_t other;
  };
  explicit FallPlaces(std::vector<Slot> slots) : slots_(std::move(slots)) {}
  std::vector<Slot> slots_;
};

/// Columns of particles on a grid that closes on itself in both directions; height 1 is a line of columns.
///
/// Heights are whole particles. Never kSteady.
/// Source    Barabasi and Stanley 1995, "Fractal concepts in surface growth": random deposition (ch. 4), with
///           surface relaxation after Family 1986 (ch. 5), ballistic deposition after Vold 1959 (ch. 2, 8).
class Deposit {
 public:
  Deposit(std::size_t width, std::size_t height, Deposition kind);

  /// Lets one particle fall on column `place`. Relaxed: ties among lower neighbours are drawn from the
  /// stream. Returns by how many particles the columns' heights rose in all (more than 1 only for
  /// kBallistic).
  std::uint32_t drop(std::size_t place, simulator::RandomStream& stream) noexcept;

  [[nodiscard]] std::span<const std::uint32_t> heights() const noexcept { return heights_; }
  /// Particles that fell.
  [[nodiscard]] std::uint64_t particles() const noexcept { return particles_; }
  /// Sum of all heights: particles and, for kBallistic, the pores between them.
  [[nodiscard]] std::uint64_t volume() const noexcept { return volume_; }

 private:
  std::size_t width_;
  std::size_t height_;
  Deposition kind_;
  std::vector<std::uint32_t> heights_;
  std::uint64_t particles_ = 0;
  std::uint64_t volume_ = 0;
};

}  // namespace scatter::corrosion
