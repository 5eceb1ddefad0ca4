#include "firmware/core/event_log.h"

namespace scatter::firmware {

void EventLog::log(Level level, const Text& text) noexcept {
  protocol::LogEvent message;
  message.level = static_cast<std::uint8_t>(level);
  message.device_time_us = clock_.now_us();
  message.text = text.str();
  event(message);
}

void EventLog::fault(protocol::FaultCode code, const Text& text) noexcept {
  last_fault_ = code;
  protocol::FaultEvent message;
  message.fault = static_cast<std::uint16_t>(code);
  message.device_time_us = clock_.now_us();
  message.text = text.str();
  event(message);
}

}  // namespace scatter::firmware
