#include "firmware/boot/rescue.h"

#include <algorithm>

#include "firmware/core/link_damage.h"
#include "protocol/message_traits.h"
#include "protocol/schema_description.h"

namespace scatter::firmware {
namespace {

using protocol::MessageId;
using protocol::StatusCode;

// A reboot waits this long for its reply to leave [us].
constexpr std::uint64_t kRebootGraceUs = 200'000;

}  // namespace

Rescue::Rescue(const RescuePorts& ports) noexcept
    : ports_(ports),
      reader_(ports_.clock, ports_.link, output_, decoder_bytes_, received_),
      output_(ports_.link),
      update_(ports_.slots, ports_.verifier, ports_.product) {}

void Rescue::follow_link() noexcept {
  if (reader_.follow_link() == RequestReader::Change::kDetached) {
    update_.cancel();
    waiting_.reset();
    session_open_ = false;
    cache_.clear();
    output_.clear();
  }
}

bool Rescue::receive() noexcept {
  return reader_.receive([this](const Frame& frame) { on_frame(frame); },
                         [this](const Header& header) {
                           if (header.channel == protocol::Channel::kControl && header.message < 0x8000) {
                             reply_status(header, StatusCode::kVersionMismatch,
                                          "unknown wire major, flag or channel");
                           }
                         });
}

void Rescue::on_frame(const Frame& frame) noexcept {
  const Header& header = frame.header();
  if (header.channel != protocol::Channel::kControl || header.message >= 0x8000) {
    return;
  }
  const bool known_session = session_open_ && header.session == output_.session();
  if (header.id() == MessageId::kHello && !known_session) {
    hello(frame);
    return;
  }
  if (!session_open_) {
    reply_status(header, StatusCode::kFailedPrecondition, "say HELLO first");
    return;
  }
  if (!known_session) {
    ++stale_frames_;
    return;
  }
  switch (cache_.admit(header)) {
    case protocol::ReplyCache::Admission::kRepeat:
      ++duplicates_;
      (void)output_.queue(cache_.reply(header));
      return;
    case protocol::ReplyCache::Admission::kUnderWay:
      ++duplicates_;
      return;
    default:
      execute(frame);
      return;
  }
}

void Rescue::execute(const Frame& frame) noexcept {
  const Header& request = frame.header();
  switch (frame.id()) {
    case MessageId::kHello:
      hello(frame);
      return;
    case MessageId::kGetStatus:
      get_status(request);
      return;
    case MessageId::kClockSync:
      if (const auto message = frame.as<protocol::ClockSync>()) {
        reply(request, protocol::ClockSynced{.host_time_us = message->host_time_us,
                                             .device_time_us = ports_.clock.now_us()});
      } else {
        reply_status(request, StatusCode::kInvalidArgument, "payload ends inside a field");
      }
      return;
    case MessageId::kFaultRecordRead:
      reply(request, ports_.reset.fault_record());
      return;
    case MessageId::kReboot:
      if (waiting_) {
        update_.cancel();
        reply_status(*waiting_, StatusCode::kAborted, "the device restarts: begin the update again");
        waiting_.reset();
      }
      reply_status(request, StatusCode::kOk, {});
      reboot_at_us_ = ports_.clock.now_us() + kRebootGraceUs;
      return;
    case MessageId::kUpdateBegin:
    case MessageId::kUpdateWrite:
    case MessageId::kUpdateFinish:
    case MessageId::kUpdateConfirm:
    case MessageId::kUpdateStatus:
      answer(request, update_.request(frame, max_payload_));
      return;
    default:
      reply_status(
          request,
          protocol::is_known(frame.id()) ? StatusCode::kFailedPrecondition : StatusCode::kUnimplemented,
          "the device is in rescue mode, no firmware could be started: flash a firmware image");
      return;
  }
}

void Rescue::hello(const Frame& frame) noexcept {
  const Header& request = frame.header();
  const auto message = frame.as<protocol::Hello>();
  if (!message) {
    reply_status(request, StatusCode::kInvalidArgument, "payload ends inside a field or a list is too long");
    return;
  }
  protocol::Offer offer;
  offer.capabilities = protocol::kCapabilityUpdate | protocol::kCapabilityRescue;
  offer.max_payload = std::min(offer.max_payload, ports_.link.max_payload());
  protocol::Negotiation result = protocol::negotiate(*message, offer, protocol::schema_digest());
  if (result.status != StatusCode::kOk) {
    reply(request, result.refusal);
    return;
  }
  update_.cancel();
  waiting_.reset();
  output_.begin_session(request.session);
  cache_.clear();
  (void)cache_.admit(request);
  session_open_ = true;
  max_payload_ = result.reply.max_payload;
  protocol::HelloReply& hello = result.reply;
  hello.build_id = ports_.build_id;
  hello.product = ports_.product;
  hello.serial = ports_.serial;
  hello.reset_reason = static_cast<std::uint8_t>(ports_.reset.reason());
  hello.device_time_us = ports_.clock.now_us();
  reply(request, hello);
}

void Rescue::get_status(const Header& request) noexcept {
  protocol::DeviceStatus status;
  status.device_time_us = ports_.clock.now_us();
  count_damage(reader_.counters(), ports_.link, status);
  status.stale_session = stale_frames_;
  status.duplicates = duplicates_;
  reply(request, status);
}

void Rescue::answer(const Header& request, const UpdateAnswer& answer) noexcept {
  if (answer.with_state) {
    reply(request, update_.state());
    return;
  }
  const bool pending = answer.status == StatusCode::kPending;
  if (pending) {
    waiting_ = request;
    promised_us_ = ports_.clock.now_us();
  }
  reply_status(request, answer.status, answer.text.str(), pending ? UpdateReceiver::kPendingMs : 0);
}

bool Rescue::go_on() noexcept {
  if (!waiting_ || !output_.has_control_room()) {
    return false;
  }
  if (const auto end = update_.poll()) {
    const Header request = *waiting_;
    waiting_.reset();
    answer(request, *end);
  } else if (ports_.clock.now_us() >= promised_us_ + UpdateReceiver::kPromiseAgainUs) {
    answer(*waiting_, {StatusCode::kPending, {}});
  }
  return true;
}

template <protocol::Message M>
void Rescue::reply(const Header& request, const M& message) noexcept {
  if (request.correlation != 0) {
    cache_.store(request,
                 output_.send(protocol::Channel::kControl, message, request.session, request.correlation));
  }
}

void Rescue::reply_status(const Header& request, StatusCode status, std::string_view text,
                          std::uint32_t pending_ms) noexcept {
  protocol::StatusReply message;
  message.status = status;
  message.request = request.message;
  message.pending_ms = pending_ms;
  message.text = text;
  reply(request, message);
}

Step Rescue::poll() noexcept {
  ports_.watchdog.kick();
  const std::uint64_t now = ports_.clock.now_us();
  Step step{.did_work = false, .wake_at_us = now + kLongestSleepUs};
  if (rebooting_) {
    return step;
  }
  follow_link();
  if (reader_.connected()) {
    step.did_work = output_.pump();
    step.did_work = receive() || step.did_work;
    step.did_work = go_on() || step.did_work;
    step.did_work = output_.pump() || step.did_work;
  }
  if (reboot_at_us_ != 0) {
    if (output_.idle() || now >= reboot_at_us_) {
      rebooting_ = true;
      ports_.reset.reboot();
      return {.did_work = true, .wake_at_us = now};
    }
    step.wake_at_us = std::min(step.wake_at_us, reboot_at_us_);
  }
  if (const std::uint64_t gives_up = reader_.gives_up_at_us(now); gives_up != 0) {
    step.wake_at_us = std::min(step.wake_at_us, gives_up);
  }
  return step;
}

}  // namespace scatter::firmware
