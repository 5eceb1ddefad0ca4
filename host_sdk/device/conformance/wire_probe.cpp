#include "host_sdk/device/conformance/wire_probe.h"

#include <algorithm>
#include <utility>

#include "host_sdk/device/session.h"
#include "protocol/schema_description.h"

namespace scatter::conformance {

using protocol::StatusCode;
using protocol::StatusReply;
using std::chrono::milliseconds;

namespace {
// As device::Session: a device must cope with exactly this.
constexpr milliseconds kFirstRepeat{250};
constexpr milliseconds kLongestRepeat{2000};
constexpr milliseconds kAnswerWithin{8000};
constexpr milliseconds kLongestCollection{5000};
// A frame whose rest has not come for this long is damaged (SPEC 2.5).
constexpr milliseconds kFramePatience{200};
}  // namespace

bool Received::is_pending() const {
  const auto status = as<StatusReply>();
  return status && status->status == StatusCode::kPending;
}

WireProbe::WireProbe(std::unique_ptr<device::Transport> transport, std::stop_token stop)
    : transport_(std::move(transport)),
      stop_(std::move(stop)),
      decoder_buffer_(std::make_unique<Bytes>(protocol::kMaxFrameBytes)),
      decoder_(*decoder_buffer_) {}

Result<WireProbe> WireProbe::open(Subject& subject) {
  auto transport = subject.carrier();
  if (!transport) {
    return std::unexpected(transport.error());
  }
  return WireProbe(std::move(*transport), subject.stop());
}

Result<WireProbe> WireProbe::greet(Subject& subject) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(3);
  for (;;) {
    auto probe = open(subject);
    Error error = probe ? Error{} : probe.error();
    if (probe) {
      const auto reply = probe->hello(subject);
      if (reply) {
        return probe;
      }
      error = reply.error();
    }
    const bool passing = error.code == ErrorCode::kBusy || error.code == ErrorCode::kDisconnected;
    if (!passing || std::chrono::steady_clock::now() >= end || !subject.pause(milliseconds(50))) {
      return std::unexpected(std::move(error));
    }
  }
}

Result<protocol::HelloReply> WireProbe::hello(Subject& subject, protocol::Hello message) {
  nonce_ = subject.next_nonce();
  sequence_.reset();
  message.schema_digest = protocol::schema_digest();
  message.host_name = std::string_view("scatter conform");
  return ask<protocol::HelloReply>(message);
}

protocol::FrameHeader WireProbe::header(protocol::Channel channel, std::uint16_t correlation) noexcept {
  protocol::FrameHeader out;
  out.channel = channel;
  out.session = nonce_;
  out.sequence = sequence_.next(channel);
  out.correlation = correlation;
  return out;
}

Bytes WireProbe::raw_frame(protocol::FrameHeader header, std::span<const std::byte> payload) const {
  Bytes out(protocol::kFrameOverhead + payload.size());
  out.resize(protocol::write_frame(std::span(out), header, payload));
  return out;
}

Status WireProbe::write(std::span<const std::byte> bytes) {
  return transport_->write(bytes, now() + kAnswerWithin, stop_);
}

Result<Received> WireProbe::next(device::TimePoint deadline) {
  while (taken_ == waiting_.size()) {
    waiting_.clear();
    taken_ = 0;
    const auto keep = [this](const protocol::Frame& frame) {
      seen_.push_back(frame.header());
      waiting_.push_back({.header = frame.header(),
                          .bytes = Bytes(frame.bytes().begin(), frame.bytes().end()),
                          .at = now()});
    };
    const bool inside = decoder_.buffered() > 0;
    const device::TimePoint until = inside ? std::min(deadline, now() + kFramePatience) : deadline;
    const auto bytes = transport_->receive(until, stop_);
    if (bytes) {
      decoder_.push(*bytes, keep);
    } else if (inside && bytes.error().code == ErrorCode::kDeadlineExceeded) {
      decoder_.give_up(keep);
    } else {
      return std::unexpected(bytes.error());
    }
    if (waiting_.empty() && now() >= deadline) {
      return fail(ErrorCode::kDeadlineExceeded, "no frame came in time", "look at the device's link");
    }
  }
  return std::move(waiting_[taken_++]);
}

Result<std::vector<Received>> WireProbe::collect(milliseconds quiet) {
  std::vector<Received> out;
  const device::TimePoint end = now() + kLongestCollection;
  while (now() < end) {
    auto frame = next(std::min(end, now() + quiet));
    if (frame) {
      out.push_back(std::move(*frame));
    } else if (frame.error().code == ErrorCode::kDeadlineExceeded) {
      break;
    } else {
      return std::unexpected(frame.error());
    }
  }
  return out;
}

Result<Received> WireProbe::reply_to(std::uint16_t correlation, milliseconds limit) {
  const device::TimePoint deadline = now() + limit;
  for (;;) {
    auto frame = next(deadline);
    // A server may refuse a host with a status that names no session (BUSY).
    const bool unasked = frame && frame->header.correlation == 0 && frame->header.session == 0;
    if (!frame || (frame->is_control() && (frame->header.correlation == correlation || unasked) &&
                   !frame->is_pending())) {
      return frame;
    }
  }
}

Result<Received> WireProbe::exchange(const Bytes& frame, std::uint16_t correlation) {
  const device::TimePoint deadline = now() + kAnswerWithin;
  milliseconds spacing = kFirstRepeat;
  for (;;) {
    const Status sent = write(frame);
    // A device in use answers BUSY and closes at once: its answer may lie here.
    if (!sent && sent.error().code != ErrorCode::kDisconnected) {
      return std::unexpected(sent.error());
    }
    auto reply = reply_to(correlation, spacing);
    spacing = std::min(2 * spacing, kLongestRepeat);
    if (reply || reply.error().code != ErrorCode::kDeadlineExceeded) {
      return reply;
    }
    if (now() >= deadline) {
      return fail(ErrorCode::kDeadlineExceeded, "a request was not answered within 8 s",
                  "look at the device's link");
    }
  }
}

Error WireProbe::refusal(std::string_view request) const {
  const auto status = last_.as<StatusReply>();
  if (!status) {
    return {ErrorCode::kDataLoss,
            std::string(request) + ": answered by message " + std::to_string(last_.header.message),
            "look at the device's replies"};
  }
  return device::device_error(request, *status);
}

Result<StatusCode> WireProbe::status_of(const Bytes& request_frame, std::uint16_t correlation) {
  auto reply = exchange(request_frame, correlation);
  if (!reply) {
    return std::unexpected(reply.error());
  }
  last_ = std::move(*reply);
  const auto status = last_.as<StatusReply>();
  return status ? status->status : StatusCode::kOk;
}

}  // namespace scatter::conformance
