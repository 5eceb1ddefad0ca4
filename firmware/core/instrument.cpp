#include "firmware/core/instrument.h"

#include <algorithm>

namespace scatter::firmware {
namespace {

// Requests handled per poll: more would let a chatty host starve the sensor.
constexpr int kRequestsPerPoll = 4;
// A frame that stops arriving for this long is broken [us].
constexpr std::uint64_t kFrameSilenceUs = 1'000'000;

[[nodiscard]] std::uint64_t earlier(std::uint64_t a, std::uint64_t b) noexcept {
  if (a == 0 || b == 0) {
    return std::max(a, b);  // 0 = nothing scheduled.
  }
  return std::min(a, b);
}

}  // namespace

InstrumentCore::InstrumentCore(Ports& ports, const InstrumentMemory& memory) noexcept
    : ports_(ports),
      decoder_(memory.decoder),
      output_(ports.link, memory.stream),
      events_(ports.clock, output_),
      state_(ports.flash, ports.factory.descriptor()),
      acquisition_(ports, output_, events_, memory.band),
      dispatcher_(ports, output_, events_, acquisition_, state_, decoder_.counters(), memory.replies) {
  state_.mount();
}

bool InstrumentCore::follow_link() noexcept {
  const bool connected = ports_.link.connected();
  if (connected == connected_) {
    return false;
  }
  connected_ = connected;
  if (!connected) {
    dispatcher_.link_closed();
    output_.clear();
  }
  decoder_.reset();
  unread_ = {};
  decoder_has_more_ = false;
  return true;
}

void InstrumentCore::handle(const protocol::ParseResult& result) noexcept {
  if (result.frame) {
    dispatcher_.on_frame(*result.frame);
  } else if (protocol::is_refused(result.status)) {
    dispatcher_.on_refused(result.header);
  }
}

bool InstrumentCore::receive() noexcept {
  const std::uint64_t now = ports_.clock.now_us();
  bool did_work = false;
  if (unread_.empty()) {
    const std::size_t count = std::min(ports_.link.read(received_), received_.size());
    unread_ = std::span<const std::byte>(received_).first(count);
    if (count > 0) {
      heard_at_us_ = now;
      did_work = true;
    }
  }
  for (int i = 0; i < kRequestsPerPoll && (!unread_.empty() || decoder_has_more_); ++i) {
    if (!output_.has_control_room()) {
      break;  // The host reads its replies before it gets more.
    }
    const protocol::ParseResult result = decoder_.next(unread_);
    decoder_has_more_ = result.status != protocol::ParseStatus::kNeedMore;
    did_work = true;
    handle(result);
  }
  if (decoder_.buffered() > 0 && unread_.empty() && !decoder_has_more_ &&
      now >= heard_at_us_ + kFrameSilenceUs) {
    did_work = true;
    decoder_.give_up([this](const protocol::Frame& frame) {
      if (output_.has_control_room()) {  // Else it is as lost as the frame around it; the host asks again.
        dispatcher_.on_frame(frame);
      }
    });
  }
  return did_work;
}

Step InstrumentCore::poll() noexcept {
  ports_.watchdog.kick();
  const std::uint64_t now = ports_.clock.now_us();
  Step step;
  if (dispatcher_.rebooting()) {
    step.wake_at_us = now + kLongestSleepUs;
    return step;
  }
  step.did_work = follow_link();
  if (connected_) {
    step.did_work = output_.pump() || step.did_work;
    step.did_work = receive() || step.did_work;
  }
  const Step run = acquisition_.step();
  const Step rest = dispatcher_.poll();
  if (connected_) {
    step.did_work = output_.pump() || step.did_work;
  }
  step.did_work = step.did_work || run.did_work || rest.did_work;
  step.wake_at_us = earlier(now + kLongestSleepUs, earlier(run.wake_at_us, rest.wake_at_us));
  if (decoder_.buffered() > 0) {
    step.wake_at_us = earlier(step.wake_at_us, std::max(heard_at_us_ + kFrameSilenceUs, now + 1));
  }
  dispatcher_.took(static_cast<std::uint32_t>(ports_.clock.now_us() - now));
  return step;
}

}  // namespace scatter::firmware
