// The firmware's image: the instrument over this board's parts.
#include <array>
#include <cstddef>
#include <new>
#include <span>

#include <build_version.h>
#include "firmware/backplane/shared_memory.h"
#include "firmware/boards/mps2_an500/backplane_line.h"
#include "firmware/boards/mps2_an500/bench_optics.h"
#include "firmware/boards/mps2_an500/devices.h"
#include "firmware/boards/mps2_an500/eeprom.h"
#include "firmware/boards/mps2_an500/factory_memory.h"
#include "firmware/boards/mps2_an500/i2c_bus.h"
#include "firmware/boards/mps2_an500/image_verifier.h"
#include "firmware/boards/mps2_an500/sleep.h"
#include "firmware/boards/mps2_an500/slots.h"
#include "firmware/boards/mps2_an500/startup.h"
#include "firmware/boards/mps2_an500/thermometers.h"
#include "firmware/core/instrument.h"
#include "firmware/core/serial_link.h"

extern "C" const std::byte __code_start[];  // NOLINT(bugprone-reserved-identifier): linker script.

namespace scatter::firmware::mps2_an500 {
namespace {

[[nodiscard]] std::uint8_t running_slot() noexcept {
  const auto code = reinterpret_cast<std::uintptr_t>(__code_start);
  return code >= Slots::address_of(1) ? 1 : 0;
}

[[nodiscard]] std::span<const std::byte> frame_memory() noexcept {
  const auto* frame =
      reinterpret_cast<const std::byte*>(backplane::kSharedMemoryAddress + backplane::kFrameOffset);
  return {frame, backplane::kFrameBytes};
}

// The longest wire frame on a serial line.
constexpr std::size_t kWireFrameBytes = protocol::kFrameOverhead + protocol::kMaxSerialPayload;

constinit SerialLink host_link{host_uart};
constinit BackplaneLine bench_line{bench_uart};
constinit FactoryMemory factory;
constinit Thermometers thermometers;
constinit Eeprom eeprom;

/// Memory for an object that is made when the board is ready for it, and that lives for ever.
template <typename T>
class Later {
 public:
  template <typename... Arguments>
  T& make(Arguments&&... arguments) noexcept {
    return *new (bytes_) T(static_cast<Arguments&&>(arguments)...);
  }

 private:
  alignas(T) std::byte bytes_[sizeof(T)];
};
constinit Later<BenchOptics> optics_memory{};
constinit Later<Slots> slots_memory{};
constinit Later<Ports> ports_memory{};
constinit Later<InstrumentCore> instrument_memory{};

// The core's memory for this carrier. Pixels on their way lie apart: the RAM budget counts them apart.
constinit std::array<std::byte, kWireFrameBytes> decoder_bytes{};
constinit std::array<std::byte, protocol::ReplyCache::kMaxSlots * kWireFrameBytes> reply_bytes{};
[[gnu::section(".frame_bands")]] alignas(8) constinit std::array<std::byte, kWireFrameBytes> stream_bytes{};
[[gnu::section(".frame_bands")]] constinit std::array<std::uint16_t, kMaxRowPixels> band_pixels{};

}  // namespace
}  // namespace scatter::firmware::mps2_an500

void run_image() noexcept {
  namespace board = scatter::firmware::mps2_an500;
  using scatter::firmware::InstrumentCore;
  using scatter::firmware::Ports;
  using scatter::firmware::Step;
  board::start_devices();
  board::board_watchdog.kick();
  board::name_running_image(board::kFirmwareBuildId, 0);
  board::I2cBus::recover();
  board::thermometers.start();
  board::factory.start();

  board::BenchOptics& optics = board::optics_memory.make(board::bench_line, board::board_clock,
                                                         board::factory.descriptor(), board::frame_memory());
  board::Slots& slots = board::slots_memory.make(board::running_slot());
  Ports& ports = board::ports_memory.make(
      Ports{.clock = board::board_clock,
            .link = board::host_link,
            .sensor = optics,
            .illuminator = optics,
            .monitor = optics,
            .thermometer = board::thermometers,
            .watchdog = board::board_watchdog,
            .reset = board::board_reset,
            .flash = board::eeprom,
            .factory = board::factory,
            .reference_stage = board::factory.descriptor().reference_stage != 0 ? &optics : nullptr,
            .image_slots = board::image_verifier() != nullptr ? &slots : nullptr,
            .verifier = board::image_verifier(),
            .build_id = board::kFirmwareBuildId});
  InstrumentCore& instrument = board::instrument_memory.make(
      ports, scatter::firmware::InstrumentMemory{.decoder = board::decoder_bytes,
                                                 .stream = board::stream_bytes,
                                                 .replies = board::reply_bytes,
                                                 .band = board::band_pixels});
  board::name_running_image(board::kFirmwareBuildId, instrument.boot_count());
  optics.announce(board::reset_reason(), false);
  for (;;) {
    bool worked = optics.poll();
    const Step step = instrument.poll();
    board::host_link.pump();
    worked = worked || step.did_work;
    if (board::board_reset.wanted()) {
      board::restart();
    }
    if (!worked) {
      board::sleep_until(board::board_clock, step.wake_at_us);
    }
  }
}
