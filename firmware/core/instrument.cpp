#include "firmware/core/instrument.h"

#include <algorithm>

namespace scatter::firmware {
namespace {

[[nodiscard]] std::uint64_t earlier(std::uint64_t a, std::uint64_t b) noexcept {
  if (a == 0 || b == 0) {
    return std::max(a, b);  // 0 = nothing scheduled.
  }
  return std::min(a, b);
}

}  // namespace

InstrumentCore::InstrumentCore(Ports& ports, const InstrumentMemory& memory) noexcept
    : ports_(ports),
      reader_(ports.clock, ports.link, output_, memory.decoder, received_),
      output_(ports.link, memory.stream),
      events_(ports.clock, output_),
      state_(ports.flash, ports.factory.descriptor()),
      acquisition_(ports, output_, events_, memory.band),
      dispatcher_(ports, output_, events_, acquisition_, state_, reader_.counters(), memory.replies) {
  state_.mount();
}

bool InstrumentCore::follow_link() noexcept {
  const RequestReader::Change change = reader_.follow_link();
  if (change == RequestReader::Change::kDetached) {
    dispatcher_.link_closed();
    output_.clear();
  }
  return change != RequestReader::Change::kNone;
}

bool InstrumentCore::receive() noexcept {
  return reader_.receive([this](const protocol::Frame& frame) { dispatcher_.on_frame(frame); },
                         [this](const protocol::FrameHeader& header) { dispatcher_.on_refused(header); });
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
  if (reader_.connected()) {
    step.did_work = output_.pump() || step.did_work;
    step.did_work = receive() || step.did_work;
  }
  const Step run = acquisition_.step();
  const Step rest = dispatcher_.poll();
  if (reader_.connected()) {
    step.did_work = output_.pump() || step.did_work;
  }
  step.did_work = step.did_work || run.did_work || rest.did_work;
  step.wake_at_us = earlier(now + kLongestSleepUs, earlier(run.wake_at_us, rest.wake_at_us));
  step.wake_at_us = earlier(step.wake_at_us, reader_.gives_up_at_us(now));
  dispatcher_.took(static_cast<std::uint32_t>(ports_.clock.now_us() - now));
  return step;
}

}  // namespace scatter::firmware
