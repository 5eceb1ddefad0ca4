// A host that says exactly what a check wants, well formed or not, and keeps every frame that comes back.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "host_sdk/device/conformance/subject.h"
#include "host_sdk/device/transport.h"
#include "protocol/frame.h"
#include "protocol/link_decoder.h"
#include "protocol/session.h"

namespace scatter::conformance {

using Bytes = std::vector<std::byte>;

/// A frame of the device.
struct Received {
  protocol::FrameHeader header;
  Bytes bytes;  ///< The whole frame.
  device::TimePoint at;

  /// Views lie in `bytes`.
  template <protocol::Message M>
  [[nodiscard]] std::optional<M> as() const {
    const auto parsed = protocol::parse_frame(bytes);
    return parsed.frame ? parsed.frame->as<M>() : std::nullopt;
  }
  [[nodiscard]] bool is_control() const noexcept { return header.channel == protocol::Channel::kControl; }
  /// A reply that says that another comes.
  [[nodiscard]] bool is_pending() const;
};

/// Threads  one. Every wait is bounded and ends within 20 ms of a stop request.
class WireProbe {
 public:
  /// Opens the carrier; says nothing yet.
  [[nodiscard]] static Result<WireProbe> open(Subject& subject);
  /// Opens and says HELLO; a device that is busy with an earlier connection is asked again for 3 s.
  [[nodiscard]] static Result<WireProbe> greet(Subject& subject);

  /// HELLO with a new nonce. Errors  as ask().
  [[nodiscard]] Result<protocol::HelloReply> hello(Subject& subject, protocol::Hello message = {});
  [[nodiscard]] std::uint16_t nonce() const noexcept { return nonce_; }
  void set_nonce(std::uint16_t nonce) noexcept { nonce_ = nonce; }
  [[nodiscard]] std::uint16_t next_correlation() noexcept {
    return ++correlation_ == 0 ? ++correlation_ : correlation_;
  }

  [[nodiscard]] protocol::FrameHeader header(protocol::Channel channel, std::uint16_t correlation) noexcept;
  template <protocol::Message M>
  [[nodiscard]] Bytes frame_of(const M& message, std::uint16_t correlation,
                               protocol::Channel channel = protocol::Channel::kControl) {
    Bytes out(protocol::kMaxFrameBytes);
    out.resize(protocol::write_message(std::span(out), header(channel, correlation), message));
    return out;
  }
  /// A frame with any id and payload.
  [[nodiscard]] Bytes raw_frame(protocol::FrameHeader header, std::span<const std::byte> payload) const;
  [[nodiscard]] Status write(std::span<const std::byte> bytes);

  /// Everything that comes until nothing has come for `quiet`, at most for 5 s.
  [[nodiscard]] Result<std::vector<Received>> collect(
      std::chrono::milliseconds quiet = std::chrono::milliseconds(250));
  /// The next frame. Errors  kDeadlineExceeded.
  [[nodiscard]] Result<Received> next(device::TimePoint deadline);
  /// The reply to `correlation` that is not PENDING; everything else that comes is passed over.
  [[nodiscard]] Result<Received> reply_to(std::uint16_t correlation,
                                          std::chrono::milliseconds limit = std::chrono::seconds(5));

  /// A request and its reply. Sent again after 250 ms, then twice as long each time up to 2 s, as hosts
  /// do; given up after 8 s.
  /// Errors  the status that the device gave; kDataLoss: the reply is another message.
  template <protocol::Message Reply, protocol::Message Request>
  [[nodiscard]] Result<Reply> ask(const Request& request) {
    const std::uint16_t correlation = next_correlation();
    const Result<Received> got = exchange(frame_of(request, correlation), correlation);
    if (!got) {
      return std::unexpected(got.error());
    }
    last_ = *got;
    if (const auto reply = last_.as<Reply>()) {
      return *reply;
    }
    return std::unexpected(refusal(Request::kName));
  }
  /// The reply's status; kOk when the reply is anything but a status_reply.
  [[nodiscard]] Result<protocol::StatusCode> status_of(const Bytes& request_frame, std::uint16_t correlation);
  template <protocol::Message Request>
  [[nodiscard]] Result<protocol::StatusCode> status_of(const Request& request) {
    const std::uint16_t correlation = next_correlation();
    return status_of(frame_of(request, correlation), correlation);
  }
  [[nodiscard]] Result<protocol::DeviceStatus> status() {
    return ask<protocol::DeviceStatus>(protocol::GetStatus{});
  }

  /// Of every frame received so far, in order.
  [[nodiscard]] const std::vector<protocol::FrameHeader>& seen() const noexcept { return seen_; }
  [[nodiscard]] const Received& last_reply() const noexcept { return last_; }
  [[nodiscard]] device::TimePoint now() const { return transport_->now(); }
  [[nodiscard]] std::uint64_t unix_time_us() const { return transport_->system_time_unix_ns() / 1000; }

 private:
  WireProbe(std::unique_ptr<device::Transport> transport, std::stop_token stop);
  [[nodiscard]] Result<Received> exchange(const Bytes& frame, std::uint16_t correlation);
  [[nodiscard]] Error refusal(std::string_view request) const;

  std::unique_ptr<device::Transport> transport_;
  std::stop_token stop_;
  std::uint16_t nonce_ = 1;
  std::uint16_t correlation_ = 0;
  protocol::SequenceCounters sequence_;
  std::unique_ptr<Bytes> decoder_buffer_;
  protocol::LinkDecoder decoder_;
  std::vector<Received> waiting_;  ///< Received, not handed out; oldest first from taken_.
  std::size_t taken_ = 0;
  std::vector<protocol::FrameHeader> seen_;
  Received last_;
};

}  // namespace scatter::conformance
