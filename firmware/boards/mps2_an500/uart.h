// A serial line of the board (CMSDK APB UART): interrupts move bytes between the line and two rings, the main
// loop works on the rings. When the receive ring is full the line is left alone until there is room: an
// emulated line then waits, a real one would lose bytes (which serial framing survives).
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/boards/mps2_an500/byte_ring.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware::mps2_an500 {

/// Whether a received byte wakes the main loop at once.
enum class Wake : std::uint8_t {
  kEachByte,    ///< Short messages.
  kEndOfFrame,  ///< A zero (the end of a serial frame) or a ring half full.
};

/// A UART has no carrier detect: connected() is always true.
class Uart final : public Link {
 public:
  static constexpr std::uint32_t kRingBytes = 2048;

  /// `receive_irq` + 1 is the transmitter's interrupt.
  constexpr Uart(std::uint32_t base, std::uint32_t receive_irq, Wake wake) noexcept
      : base_(base), receive_irq_(receive_irq), wake_(wake) {}

  void start() noexcept;
  [[nodiscard]] std::size_t read(std::span<std::byte> out) noexcept override;
  [[nodiscard]] std::size_t write(std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool connected() noexcept override { return true; }
  /// Bytes that write() would take now.
  [[nodiscard]] std::size_t write_room() const noexcept { return to_send_.room(); }
  /// Every byte written has left.
  [[nodiscard]] bool drained() const noexcept;

  /// The interrupts; at most kBurst bytes each.
  void on_receive() noexcept;
  void on_transmit() noexcept;

 private:
  static constexpr std::uint32_t kBurst = 64;

  std::uint32_t base_;
  std::uint32_t receive_irq_;
  Wake wake_;
  std::atomic<bool> receive_stopped_{false};  // The ring was full: read() starts the line again.
  std::atomic<bool> writer_waits_{false};     // write() found no room: wake the loop when there is some.
  ByteRing<kRingBytes> received_;
  ByteRing<kRingBytes> to_send_;
};

}  // namespace scatter::firmware::mps2_an500
