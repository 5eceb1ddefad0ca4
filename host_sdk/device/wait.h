// How long to wait and who may cut it short: the last parameter of everything that waits.
#pragma once

#include <chrono>
#include <stop_token>

namespace scatter::device {

/// Time on a transport's own clock: real for sockets, virtual for simulators and recordings.
/// The zero is the transport's choice; only differences mean something.
struct TransportClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<TransportClock>;
  static constexpr bool is_steady = true;
};
using Duration = std::chrono::nanoseconds;
using TimePoint = TransportClock::time_point;

/// Every wait ends: at the latest when `timeout` has passed on the transport's clock
/// (kDeadlineExceeded), within 20 ms of `stop` being requested (kAborted).
/// A timeout of zero or less means "what is there already"; there is no infinite wait.
struct Wait {
  Duration timeout = std::chrono::seconds(5);
  std::stop_token stop = {};
};

}  // namespace scatter::device
