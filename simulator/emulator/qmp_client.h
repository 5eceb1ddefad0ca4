// Speaks QMP, QEMU's control protocol: one JSON object per line.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/instrument/listener.h"

namespace scatter::simulator {

/// Threads: one.
class QmpClient {
 public:
  QmpClient() = default;
  /// `socket`: connected to QEMU's `-mon mode=control`.
  explicit QmpClient(FileDescriptor socket) : socket_(std::move(socket)) {}

  /// Waits for the greeting and ends the negotiation.
  /// Errors    kDeadlineExceeded; kDisconnected: QEMU is gone; kDataLoss: it does not speak QMP.
  [[nodiscard]] Status negotiate(std::chrono::milliseconds timeout);
  /// Executes a command whose arguments are a JSON object, or "" for none.
  /// Errors    as negotiate(); kInternal: QEMU refuses, with its words.
  [[nodiscard]] Status execute(std::string_view command, std::string_view arguments,
                               std::chrono::milliseconds timeout);
  /// Sets a TMP105's temperature. `device`: its id; `millidegrees`: of Celsius.
  [[nodiscard]] Status set_temperature(std::string_view device, std::int64_t millidegrees);

 private:
  [[nodiscard]] Result<std::string> read_line(std::chrono::steady_clock::time_point deadline);

  FileDescriptor socket_;
  std::string held_;  ///< Received after the last line; at most kLongestLine.
};

}  // namespace scatter::simulator
