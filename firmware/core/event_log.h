// Log lines and faults on their way to the host's event channel, and the last fault for GetStatus.
#pragma once

#include <cstdint>

#include "firmware/core/link_output.h"
#include "firmware/core/text.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware {

class EventLog {
 public:
  enum class Level : std::uint8_t { kDebug = 0, kInfo = 1, kNotice = 2, kWarning = 3, kError = 4 };

  EventLog(Clock& clock, LinkOutput& output) noexcept : clock_(clock), output_(output) {}

  /// Events go out only while a session is open; without one they are counted as dropped.
  void open(bool session_open) noexcept { open_ = session_open; }
  void log(Level level, const Text& text) noexcept;
  void fault(protocol::FaultCode code, const Text& text) noexcept;
  /// Queues any other event message; false when there is no room or no session.
  template <protocol::Message M>
  bool event(const M& message) noexcept {
    const bool sent =
        open_ && !output_.send(protocol::Channel::kEvent, message, output_.session(), 0).empty();
    dropped_ += sent ? 0U : 1U;
    return sent;
  }
  [[nodiscard]] protocol::FaultCode last_fault() const noexcept { return last_fault_; }
  [[nodiscard]] std::uint32_t dropped() const noexcept { return dropped_; }

 private:
  Clock& clock_;
  LinkOutput& output_;
  bool open_ = false;
  protocol::FaultCode last_fault_ = protocol::FaultCode::kNone;
  std::uint32_t dropped_ = 0;
};

}  // namespace scatter::firmware
