// QEMU as a child process that emulates the board mps2_an500.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <string>

#include "host_sdk/error/error.h"
#include "simulator/emulator/qmp_client.h"
#include "simulator/instrument/listener.h"

namespace scatter::simulator {

/// What lies in the emulated board.
struct QemuFiles {
  std::filesystem::path kernel;         ///< ELF at address 0: the bootloader.
  std::filesystem::path shared_memory;  ///< 16 MiB, see firmware/backplane/shared_memory.h.
  std::filesystem::path eeprom{};       ///< 32 KiB; empty: the board has none.
};

/// Lines are pairs of sockets, so nothing of the process is left in the file system. The process dies with
/// this object, and with the thread that started it, whatever ends that. Threads: one, but uart() lines may
/// be given to others.
class QemuProcess {
 public:
  static constexpr std::string_view kProgram = "qemu-system-arm";
  static constexpr std::size_t kEepromBytes = 32 * 1024;

  /// Starts with the processor halted; resume() lets it run. The thermometers are "sensor" and "led_board".
  /// Errors    kNotFound: QEMU is not installed; kFailedPrecondition: it ended at once, with its words;
  ///           kDeadlineExceeded; kUnavailable: the system refuses.
  [[nodiscard]] static Result<QemuProcess> start(const QemuFiles& files);
  QemuProcess(QemuProcess&& other) noexcept;
  QemuProcess& operator=(QemuProcess&& other) noexcept;
  /// Kills it and waits for its end.
  ~QemuProcess();

  /// Both non-blocking. UART0 is the host's link, UART1 the backplane.
  [[nodiscard]] FileDescriptor& uart0() noexcept { return uart0_; }
  [[nodiscard]] FileDescriptor& uart1() noexcept { return uart1_; }
  [[nodiscard]] QmpClient& control() noexcept { return control_; }
  [[nodiscard]] Status resume();

  [[nodiscard]] pid_t id() const noexcept { return id_; }
  /// Becomes readable when the process has ended; for poll().
  [[nodiscard]] int ended_descriptor() const noexcept { return ended_.number(); }
  /// Errors    kDisconnected when it has ended: how, and its last words.
  [[nodiscard]] Status check();
  /// SIGKILL: to the emulated board a power cut.
  void kill() noexcept;

 private:
  QemuProcess() = default;
  [[nodiscard]] std::string last_words() const;

  pid_t id_ = -1;
  int exit_status_ = 0;  ///< As of waitpid(), once id_ is -1 again.
  FileDescriptor ended_;
  FileDescriptor words_;  ///< Its standard error: a file in memory.
  FileDescriptor uart0_;
  FileDescriptor uart1_;
  QmpClient control_;
};

}  // namespace scatter::simulator
