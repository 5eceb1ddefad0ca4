// Byte pipes to instruments, and the registry that makes them from URIs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/device/uri.h"
#include "host_sdk/device/wait.h"
#include "host_sdk/error/error.h"

namespace scatter::device {

/// Something about a carrier that a person should know although it works.
struct Notice {
  std::string what;    ///< "the instrument is on a 12 Mb/s bus".
  std::string remedy;  ///< One imperative phrase.
};

/// Transfers of a carrier that failed and that it went on after. All zero for carriers that have no
/// transfers.
struct CarrierStatistics {
  std::uint64_t stalls = 0;     ///< The device halted an endpoint; the halt was cleared.
  std::uint64_t overflows = 0;  ///< The device sent more than was asked for; those bytes are lost.
  std::uint64_t errors = 0;     ///< No handshake, wrong checksum or toggle, after the hardware's own retries.
};

/// A byte pipe in both directions with a clock of its own. Used from one thread.
/// Every call ends at its deadline and within 20 ms of a stop request.
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  virtual ~Transport() = default;

  /// Waits for bytes and lends them: at least one, in the order of arrival, valid until the next receive() or
  /// close(); write() leaves them alone. Carriers with transfers lend the buffer that the system filled.
  /// Errors  kDeadlineExceeded, kAborted (stop requested), kDisconnected (the other side is gone, and
  ///         everything that it sent before was lent).
  [[nodiscard]] virtual Result<std::span<const std::byte>> receive(TimePoint deadline,
                                                                   const std::stop_token& stop) = 0;

  /// Hands over all of `bytes`. After an error it is unknown how many went out.
  /// Errors  as receive().
  [[nodiscard]] virtual Status write(std::span<const std::byte> bytes, TimePoint deadline,
                                     const std::stop_token& stop) = 0;

  /// The transport's clock; virtual clocks move only inside receive() and write().
  [[nodiscard]] virtual TimePoint now() const = 0;

  /// Unix time [ns] on the same clock, for recordings; virtual clocks have a fixed start.
  [[nodiscard]] virtual std::uint64_t system_time_unix_ns() const = 0;

  /// Ends both directions; later calls give kDisconnected. Idempotent.
  virtual void close() noexcept = 0;

  /// What a person should know about the carrier; more may come while it is used.
  [[nodiscard]] virtual std::vector<Notice> notices() const { return {}; }
  [[nodiscard]] virtual CarrierStatistics statistics() const { return {}; }
};

/// One URI scheme and how to open it.
struct Scheme {
  using Open = std::function<Result<std::unique_ptr<Transport>>(const Uri& uri, const Wait& wait)>;
  std::string name;     ///< "tcp"
  std::string example;  ///< "tcp:127.0.0.1:7000"
  std::string summary;  ///< One phrase for `scatter list`.
  Open open;
};

/// The schemes a program knows. Build once, then read from any thread.
class TransportRegistry {
 public:
  /// tcp:, unix: and replay:.
  TransportRegistry();

  /// Adds a scheme, or replaces the one with the same name.
  void add(Scheme scheme);
  [[nodiscard]] std::span<const Scheme> schemes() const noexcept { return schemes_; }

  /// Opens the carrier only; no byte of the protocol is exchanged yet.
  /// Errors  kInvalidArgument: not a URI, or an unknown scheme (the message lists the known ones);
  ///         kUnimplemented: usb: and serial:, which are reserved; others by the scheme.
  [[nodiscard]] Result<std::unique_ptr<Transport>> open(std::string_view uri, const Wait& wait = {}) const;

 private:
  std::vector<Scheme> schemes_;
};

}  // namespace scatter::device
