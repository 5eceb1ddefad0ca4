// The carrier between host and virtual board: two bounded byte queues, with the plan's link faults.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "firmware/ports/ports.h"
#include "simulator/faults/fault_plan.h"
#include "simulator/faults/lane_faults.h"
#include "simulator/instrument/virtual_clock.h"

namespace scatter::simulator {

/// First in, first out; grows to what its user allows.
class ByteQueue {
 public:
  [[nodiscard]] std::size_t size() const noexcept { return bytes_.size() - read_; }
  [[nodiscard]] std::span<const std::byte> view() const noexcept { return std::span(bytes_).subspan(read_); }
  void push(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  void drop_front(std::size_t count);
  void clear() noexcept {
    bytes_.clear();
    read_ = 0;
  }

 private:
  std::vector<std::byte> bytes_;
  std::size_t read_ = 0;
};

/// Threads: one. Memory: the two capacities plus a few frames while faults hold some.
class VirtualLink final : public firmware::Link {
 public:
  /// Bytes that wait for the host before the device feels back-pressure.
  static constexpr std::size_t kToHostCapacity = 256 * 1024;
  static constexpr std::size_t kToDeviceCapacity = 64 * 1024;

  VirtualLink(VirtualClock& clock, const FaultPlan& plan, std::uint64_t seed);

  // The device's side.
  [[nodiscard]] std::size_t read(std::span<std::byte> out) noexcept override;
  [[nodiscard]] std::size_t write(std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool connected() noexcept override { return attached_; }

  // The host's side.
  void attach() noexcept;
  /// The carrier breaks; everything on the way is lost.
  void detach() noexcept;
  /// The device goes away: what it had sent can still be read, what it had not read is lost.
  void device_gone() noexcept;
  [[nodiscard]] bool attached() const noexcept { return attached_; }
  /// Takes as many bytes as there is room for.
  [[nodiscard]] std::size_t host_write(std::span<const std::byte> bytes);
  [[nodiscard]] std::size_t host_read(std::span<std::byte> out);
  /// Bytes that host_read() would give now.
  [[nodiscard]] std::size_t readable();
  /// Room that host_write() would find now.
  [[nodiscard]] std::size_t writable();
  /// Lets what was held back for too long go on. Call whenever time has moved.
  void tick();
  /// When something changes by itself [us since power-on]: a stall ends, a held frame goes on.
  [[nodiscard]] std::optional<std::uint64_t> next_event_us() const noexcept;

  [[nodiscard]] const FaultCounts& fault_counts(Direction direction) const noexcept {
    return lane(direction).faults.counts();
  }

 private:
  struct Lane {
    ByteQueue queue;
    LaneFaults faults;  ///< Its counting edge is the host's.
  };

  [[nodiscard]] const Lane& lane(Direction direction) const noexcept {
    return lanes_[static_cast<std::size_t>(direction)];
  }
  [[nodiscard]] Lane& lane(Direction direction) noexcept {
    return lanes_[static_cast<std::size_t>(direction)];
  }
  /// How many of `wanted` bytes may cross now.
  [[nodiscard]] std::size_t allowed(Lane& lane, std::size_t wanted);
  /// Counts bytes that crossed; breaks the link where the plan says so.
  void crossed(Lane& lane, std::size_t count);
  void carry(Lane& lane, std::span<const std::byte> bytes);

  VirtualClock& clock_;
  std::array<Lane, 2> lanes_;
  std::vector<std::byte> scratch_;
  bool attached_ = false;
};

}  // namespace scatter::simulator
