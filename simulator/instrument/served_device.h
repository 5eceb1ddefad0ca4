// What Server serves: a device with a link of bytes and a clock. The virtual instrument is one, a board under
// an emulator another.
#pragma once

#include <poll.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/instrument/virtual_clock.h"

namespace scatter::simulator {

/// Calls never block. Threads: the server's.
class ServedDevice {
 public:
  ServedDevice() = default;
  ServedDevice(const ServedDevice&) = delete;
  ServedDevice& operator=(const ServedDevice&) = delete;
  virtual ~ServedDevice() = default;

  /// A host is plugged in; what an earlier one left on the way is gone.
  virtual void attach() = 0;
  virtual void detach() = 0;
  /// False after detach() and after the device went away by itself (a restart); what it had sent can still
  /// be read then.
  [[nodiscard]] virtual bool attached() const = 0;

  /// Takes bytes from the host, as many as writable() said there is room for.
  [[nodiscard]] virtual std::size_t host_write(std::span<const std::byte> bytes) = 0;
  [[nodiscard]] virtual std::size_t writable() = 0;
  /// Gives bytes for the host, maybe none.
  [[nodiscard]] virtual std::size_t host_read(std::span<std::byte> out) = 0;
  /// Bytes that wait for the host; 0 when none is attached.
  [[nodiscard]] virtual std::size_t readable() = 0;

  /// Does what can be done now and says when there will be more to do without the host [us on now_us()'s
  /// scale, after now_us()]. Errors: the device is gone for good; the server ends.
  [[nodiscard]] virtual Result<std::uint64_t> run_ready() = 0;
  [[nodiscard]] virtual std::uint64_t now_us() const = 0;
  [[nodiscard]] virtual ClockMode clock_mode() const = 0;
  /// Virtual clock: time moves on to `time_us`. Real clock: no effect.
  virtual void advance_to(std::uint64_t time_us) = 0;

  /// Presses the measure button, where there is one.
  virtual void press_button() {}

  /// Adds what else should wake the server from its wait.
  virtual void add_waits(std::vector<pollfd>& files) { (void)files; }
};

}  // namespace scatter::simulator
