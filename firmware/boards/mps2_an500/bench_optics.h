// Sensor, LEDs, monitor and stage of a board that has none: the simulated bench on the backplane is all of
// them.
#pragma once

#include <cstdint>
#include <span>

#include "firmware/boards/mps2_an500/backplane_line.h"
#include "firmware/boards/mps2_an500/board_clock.h"
#include "firmware/ports/ports.h"
#include "protocol/descriptor.h"

namespace scatter::firmware::mps2_an500 {

/// Commands are checked here and sent; what the bench answers comes through poll(). A bench that does not
/// answer leaves the state as it is: the core's own time limits name that.
///
/// A frame counts as ready when the bench says so AND exposure and readout have passed on the board's clock:
/// the bench may be faster than light.
class BenchOptics final : public Sensor, public Illuminator, public Monitor, public ReferenceStage {
 public:
  /// `frame` is the shared memory that the bench draws into.
  constexpr BenchOptics(BackplaneLine& line, BoardClock& clock, const protocol::Descriptor& descriptor,
                        std::span<const std::byte> frame) noexcept
      : line_(line), clock_(clock), descriptor_(descriptor), frame_(frame) {}

  /// Tells the bench that the board started: LEDs off, exposure cancelled.
  void announce(protocol::ResetReason reason, bool bootloader) noexcept;
  /// Takes what the bench says. Once per turn of the main loop; true when something came.
  bool poll() noexcept;

  [[nodiscard]] bool trigger(const SensorSettings& settings) noexcept override;
  [[nodiscard]] SensorState state() noexcept override;
  [[nodiscard]] std::uint64_t ready_at_us() noexcept override;
  /// Also checks the frame's CRC-32C when the last row is read.
  [[nodiscard]] bool read_rows(std::uint16_t first, std::uint16_t count,
                               std::span<std::uint16_t> out) noexcept override;
  void release() noexcept override;

  [[nodiscard]] bool light(std::uint8_t illumination) noexcept override;
  [[nodiscard]] std::uint32_t reading_uv() noexcept override { return monitor_uv_; }

  [[nodiscard]] bool move_to(protocol::Target target) noexcept override;
  [[nodiscard]] bool moving() noexcept override { return moving_; }
  /// The bench tells when; unknown before.
  [[nodiscard]] std::uint64_t settled_at_us() noexcept override { return 0; }

 private:
  void take(const backplane::Ready& ready) noexcept;
  void take(const backplane::Fault& fault) noexcept;

  BackplaneLine& line_;
  BoardClock& clock_;
  const protocol::Descriptor& descriptor_;
  std::span<const std::byte> frame_;

  SensorSettings settings_;
  SensorState state_ = SensorState::kIdle;
  std::uint32_t number_ = 0;
  std::uint64_t due_us_ = 0;  // End of exposure and readout.
  std::uint32_t monitor_uv_ = 0;
  std::uint32_t wanted_crc_ = 0;
  std::uint32_t crc_ = 0;
  std::uint16_t next_row_ = 0;
  bool readout_failed_ = false;
  bool moving_ = false;
  std::uint8_t target_ = 0;
};

}  // namespace scatter::firmware::mps2_an500
