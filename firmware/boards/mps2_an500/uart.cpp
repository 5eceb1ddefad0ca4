#include "firmware/boards/mps2_an500/uart.h"

#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/sleep.h"

namespace scatter::firmware::mps2_an500 {
namespace {

// Offsets and bits of the CMSDK APB UART (Arm DDI 0479).
constexpr std::uint32_t kData = 0;
constexpr std::uint32_t kState = 4;
constexpr std::uint32_t kControl = 8;
constexpr std::uint32_t kInterrupt = 12;
constexpr std::uint32_t kDivider = 16;
constexpr std::uint32_t kTransmitFull = 1U << 0U;
constexpr std::uint32_t kReceiveFull = 1U << 1U;
constexpr std::uint32_t kOverruns = 3U << 2U;
constexpr std::uint32_t kBothWaysWithInterrupts = 0xF;
constexpr std::uint32_t kTransmitInterrupt = 1U << 0U;
constexpr std::uint32_t kReceiveInterrupt = 1U << 1U;
// 25 MHz / 16 = 1.5625 Mbaud, the fastest; an emulated line takes no notice.
constexpr std::uint32_t kFastest = 16;

}  // namespace

void Uart::start() noexcept {
  write_register(base_ + kDivider, kFastest);
  write_register(base_ + kState, kOverruns);
  write_register(base_ + kInterrupt, kTransmitInterrupt | kReceiveInterrupt);
  write_register(base_ + kControl, kBothWaysWithInterrupts);
  enable_irq(receive_irq_);
  enable_irq(receive_irq_ + 1);
  pend_irq(receive_irq_);  // A byte may have come while nobody listened.
}

std::size_t Uart::read(std::span<std::byte> out) noexcept {
  const std::size_t count = received_.pop(out);
  if (count > 0 && receive_stopped_.exchange(false, std::memory_order_acq_rel)) {
    pend_irq(receive_irq_);
  }
  return count;
}

std::size_t Uart::write(std::span<const std::byte> bytes) noexcept {
  const std::size_t count = to_send_.push(bytes);
  if (count < bytes.size()) {
    writer_waits_.store(true, std::memory_order_release);
  }
  pend_irq(receive_irq_ + 1);
  return count;
}

bool Uart::drained() const noexcept {
  return to_send_.used() == 0 && (read_register(base_ + kState) & kTransmitFull) == 0;
}

void Uart::on_receive() noexcept {
  write_register(base_ + kInterrupt, kReceiveInterrupt);  // First: a byte that comes now asks again.
  bool wake = false;
  for (std::uint32_t i = 0; i < kBurst && (read_register(base_ + kState) & kReceiveFull) != 0; ++i) {
    if (received_.room() == 0) {
      receive_stopped_.store(true, std::memory_order_release);
      wake = true;
      break;
    }
    const auto value = static_cast<std::byte>(read_register(base_ + kData) & 0xFFU);
    (void)received_.push(value);
    wake = wake || wake_ == Wake::kEachByte || value == std::byte{0};
  }
  if (wake || received_.used() >= kRingBytes / 2) {
    note_activity();
  }
}

void Uart::on_transmit() noexcept {
  write_register(base_ + kInterrupt, kTransmitInterrupt);
  std::uint32_t sent = 0;
  while (to_send_.used() > 0 && (read_register(base_ + kState) & kTransmitFull) == 0) {
    if (sent++ == kBurst) {
      pend_irq(receive_irq_ + 1);  // Others first.
      break;
    }
    write_register(base_ + kData, static_cast<std::uint32_t>(to_send_.pop()));
  }
  if (to_send_.room() >= kRingBytes / 2 && writer_waits_.exchange(false, std::memory_order_acq_rel)) {
    note_activity();
  }
}

}  // namespace scatter::firmware::mps2_an500
