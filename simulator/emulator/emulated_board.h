// The board mps2_an500 under QEMU with the optical bench: an instrument whose firmware runs on a Cortex-M7.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/emulator/bench_service.h"
#include "simulator/emulator/board_state.h"
#include "simulator/emulator/qemu_process.h"
#include "simulator/emulator/serial_relay.h"
#include "simulator/instrument/instrument_options.h"
#include "simulator/instrument/served_device.h"

namespace scatter::simulator {

struct EmulatedBoardOptions {
  /// Sample, seed, profile, references, module, calibration=session|none, faults readout and led. Its clock
  /// says whether frames take their time (real) or come as soon as they are computed (virtual); the
  /// firmware's own clock always runs with the computer's.
  InstrumentOptions instrument{};
  std::filesystem::path bootloader{};  ///< ELF; see find_firmware().
  std::filesystem::path firmware{};    ///< .scfw that production puts into a fresh state; empty: none.
  std::filesystem::path state{};       ///< Folder that keeps memory and EEPROM; empty: forgotten at the end.
  bool eeprom = true;                  ///< False: the chip is missing.
  bool factory_set = true;             ///< False: production forgot it.
  BenchConduct conduct{};
};

struct FirmwareFiles {
  std::filesystem::path bootloader;
  std::filesystem::path firmware;
};
/// The files that `./run firmware` leaves, found from the running program: in firmware/ beside it or beside
/// one of the folders above it. `firmware`, when given, names the .scfw; then the bootloader is looked for
/// beside it first. Errors    kNotFound.
[[nodiscard]] Result<FirmwareFiles> find_firmware(const std::filesystem::path& firmware = {});

/// Threads: one (the server's); start() from the same, because QEMU ends with the thread that started it.
class EmulatedBoard final : public ServedDevice {
 public:
  static constexpr std::chrono::milliseconds kBootTimeout{30'000};

  /// Powers the board on and waits for its first sign of life.
  /// Errors    kInvalidArgument: options that only the virtual board has; those of QemuProcess::start,
  ///           BoardState::open, VirtualBoard::make; kDeadlineExceeded: nothing boots.
  [[nodiscard]] static Result<std::unique_ptr<EmulatedBoard>> start(const EmulatedBoardOptions& options);
  ~EmulatedBoard() override;

  void attach() override;
  void detach() override;
  [[nodiscard]] bool attached() const override { return relay_.attached(); }
  [[nodiscard]] std::size_t host_write(std::span<const std::byte> bytes) override;
  [[nodiscard]] std::size_t writable() override { return relay_.writable(); }
  [[nodiscard]] std::size_t host_read(std::span<std::byte> out) override { return relay_.host_read(out); }
  [[nodiscard]] std::size_t readable() override { return relay_.readable(); }
  [[nodiscard]] Result<std::uint64_t> run_ready() override;
  [[nodiscard]] std::uint64_t now_us() const override;
  [[nodiscard]] ClockMode clock_mode() const override { return ClockMode::kReal; }
  void advance_to(std::uint64_t) override {}
  void add_waits(std::vector<pollfd>& files) override;

  /// QEMU's process: SIGKILL is a power cut. From any thread.
  [[nodiscard]] pid_t process_id() const noexcept { return process_id_; }
  /// From any thread.
  void conduct(const BenchConduct& conduct) { bench_->conduct(conduct); }
  /// Takes the sample away and puts another one there; done when it returns. From any thread, not while the
  /// board measures.
  void put(std::shared_ptr<const Sample> sample) { bench_->put(std::move(sample)); }

  struct Statistics {
    BackplaneBench::Statistics bench;
    SerialRelay::Counters relay;
  };
  [[nodiscard]] Statistics statistics() const { return {bench_->statistics(), relay_.counters()}; }
  [[nodiscard]] std::span<std::byte> shared_memory() noexcept { return state_.shared_memory(); }
  /// The raw line, for whoever wants to send what is no frame. Not while somebody serves the board.
  [[nodiscard]] FileDescriptor& uart0() noexcept { return process_.uart0(); }

 private:
  EmulatedBoard(std::unique_ptr<VirtualBoard> board, BoardState state, QemuProcess process);
  [[nodiscard]] Status wait_for_boot();
  [[nodiscard]] Status check_alive();
  [[nodiscard]] bool pump();
  [[nodiscard]] bool take_boots();

  std::unique_ptr<VirtualBoard> board_;
  BoardState state_;
  QemuProcess process_;
  pid_t process_id_;
  std::unique_ptr<BenchService> bench_;
  SerialRelay relay_;
  std::uint64_t heard_host_us_ = 0;
  bool line_closed_ = false;       ///< UART0: QEMU is ending.
  bool bootloader_spoke_ = false;  ///< Of a start whose firmware has not spoken yet.
  std::chrono::steady_clock::time_point checked_{};
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

}  // namespace scatter::simulator
