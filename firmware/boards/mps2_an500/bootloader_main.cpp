// The bootloader's image: starts the firmware that firmware/boot chooses, or serves rescue mode.
#include <cstddef>
#include <cstdint>
#include <new>

#include <build_version.h>
#include "firmware/boards/mps2_an500/backplane_line.h"
#include "firmware/boards/mps2_an500/bench_optics.h"
#include "firmware/boards/mps2_an500/devices.h"
#include "firmware/boards/mps2_an500/factory_memory.h"
#include "firmware/boards/mps2_an500/image_verifier.h"
#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/sleep.h"
#include "firmware/boards/mps2_an500/slots.h"
#include "firmware/boards/mps2_an500/startup.h"
#include "firmware/boot/boot_decision.h"
#include "firmware/boot/rescue.h"
#include "firmware/core/serial_link.h"

namespace scatter::firmware::mps2_an500 {
namespace {

constinit SerialLink host_link{host_uart};
constinit BackplaneLine bench_line{bench_uart};
constinit FactoryMemory factory;
constinit Slots slots{ImageSlots::kCount};
alignas(Rescue) constinit std::byte rescue_memory[sizeof(Rescue)]{};

/// Hands the processor to the image in `slot`, as a reset would: its stack, its vectors, no interrupt
/// waiting.
[[noreturn]] void start_image(std::uint8_t slot) noexcept {
  constexpr std::uint32_t kDisableAll = 0xE000'E180;
  constexpr std::uint32_t kUnpendAll = 0xE000'E280;
  constexpr std::uint32_t kVectorTable = 0xE000'ED08;
  asm volatile("cpsid i" ::: "memory");
  write_register(kDisableAll, 0xFFFF'FFFF);
  write_register(kUnpendAll, 0xFFFF'FFFF);
  // From here on an image that hangs is reset, and the next boot knows that it was tried.
  BoardWatchdog::start();
  unprotect_memory();
  const std::uint32_t body = Slots::address_of(slot) + protocol::kImageBodyOffset;
  write_register(kVectorTable, body);
  barrier();
  const std::uint32_t stack = read_register(body);
  const std::uint32_t entry = read_register(body + 4);
  asm volatile("msr msp, %0\n bx %1" ::"r"(stack), "r"(entry) : "memory");
  for (;;) {
  }
}

[[noreturn]] void serve_rescue() noexcept {
  start_devices();
  BoardWatchdog::start();
  name_running_image(kBootloaderBuildId, 0);
  BenchOptics optics(bench_line, board_clock, factory.descriptor(), {});
  const RescuePorts ports{
      .clock = board_clock,
      .link = host_link,
      .watchdog = board_watchdog,
      .reset = board_reset,
      .slots = slots,
      .verifier = *image_verifier(),
      .product = factory.provisioned() ? factory.descriptor().product.str() : kBoardProduct,
      .serial = factory.descriptor().serial.str(),
      .build_id = kBootloaderBuildId};
  auto& rescue = *new (rescue_memory) Rescue(ports);
  optics.announce(reset_reason(), true);
  for (;;) {
    (void)optics.poll();
    const Step step = rescue.poll();
    host_link.pump();
    if (board_reset.wanted()) {
      restart();
    }
    if (!step.did_work) {
      sleep_until(board_clock, step.wake_at_us);
    }
  }
}

}  // namespace
}  // namespace scatter::firmware::mps2_an500

void run_image() noexcept {
  namespace board = scatter::firmware::mps2_an500;
  using scatter::firmware::BootDecision;
  board::begin_boot();
  board::factory.start();
  const std::string_view product =
      board::factory.provisioned() ? board::factory.descriptor().product.str() : board::kBoardProduct;
  const BootDecision decision =
      scatter::firmware::decide(board::slots, *board::image_verifier(), product, board::reset_reason());
  if (decision.action == BootDecision::Action::kRun) {
    board::start_image(decision.slot);
  }
  board::serve_rescue();
}
