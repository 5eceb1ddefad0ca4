// One conversation with a device: HELLO, requests with replies, events, stream traffic.
// Internal to this wing: programs use Device.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "host_sdk/device/device.h"
#include "host_sdk/device/transport.h"
#include "protocol/link_decoder.h"
#include "protocol/session.h"

namespace scatter::device {

/// Gets the traffic that belongs to a run, in the order of arrival, while anybody pumps.
class WireSink {
 public:
  virtual void on_stream(const protocol::Frame& frame, std::uint64_t host_time_unix_ns) = 0;
  /// Events, and the replies Started and RunReport.
  virtual void on_message(const protocol::Frame& frame, std::uint64_t host_time_unix_ns) = 0;

 protected:
  ~WireSink() = default;
};

/// Gets replies to requests that it sent itself.
class ReplySink {
 public:
  /// True when the reply was for it.
  virtual bool on_reply(const protocol::Frame& frame) = 0;

 protected:
  ~ReplySink() = default;
};

/// Error for a status that the device gave: its code, its text, the code's remedy.
[[nodiscard]] Error device_error(std::string_view request, const protocol::StatusReply& reply);

/// Promises:
/// - a request is executed at most once: repetitions carry the same correlation id, at 250 ms, then
///   twice as long each time up to 2 s, which is also the pace after PENDING;
/// - every call ends at its deadline on the transport's clock, or 20 ms after a stop request;
/// - stream and event frames that arrive while somebody waits for a reply go to the sink at once;
/// - frames of other sessions are discarded and counted; nothing a device sends grows memory.
/// Threads  one.
class Session {
 public:
  /// Says HELLO. Errors  see Device::open.
  [[nodiscard]] static Result<std::unique_ptr<Session>> open(std::unique_ptr<Transport> transport,
                                                             const OpenOptions& options, TimePoint deadline);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  [[nodiscard]] const protocol::HelloReply& hello() const noexcept { return hello_; }
  [[nodiscard]] Transport& transport() noexcept { return *transport_; }
  [[nodiscard]] TimePoint now() const { return transport_->now(); }
  /// When the bytes that are, or were last, handed around had come; costs no look at the clock.
  [[nodiscard]] TimePoint arrived() const noexcept { return arrived_; }

  /// Sends a request and waits for its reply. A view in the reply is valid until the next call.
  template <typename Reply, typename Request>
  [[nodiscard]] Result<Reply> request(const Request& message, const Wait& wait) {
    return request<Reply>(message, now() + wait.timeout, wait.stop);
  }
  template <typename Reply, typename Request>
  [[nodiscard]] Result<Reply> request(const Request& message, TimePoint deadline,
                                      const std::stop_token& stop) {
    const auto size = protocol::encode(message, std::span(request_payload_));
    if (!size) {
      return fail(ErrorCode::kInvalidArgument, std::string(Request::kName) + ": too long for the wire",
                  "shorten the argument");
    }
    const Status done = exchange(Request::kId, Request::kName, *size, Reply::kId, deadline, stop);
    if (!done) {
      return std::unexpected(done.error());
    }
    const auto reply = protocol::decode<Reply>(std::span<const std::byte>(reply_));
    if (!reply) {
      return malformed(Request::kName);
    }
    return *reply;
  }

  /// Sends a message that has no reply, on the event channel.
  template <typename Message>
  [[nodiscard]] Status notify(const Message& message, TimePoint deadline, const std::stop_token& stop) {
    const std::size_t size =
        protocol::write_message(std::span(send_), next_header(protocol::Channel::kEvent, 0), message);
    return transport_->write(std::span<const std::byte>(send_).first(size), deadline, stop);
  }

  /// Reads what is there, waiting for the first byte until `until`, and hands it around.
  /// kDeadlineExceeded when nothing came.
  [[nodiscard]] Status pump(TimePoint until, const std::stop_token& stop);

  /// At most one; null takes it away. The sink outlives its registration.
  void set_sink(WireSink* sink) noexcept { sink_ = sink; }
  [[nodiscard]] WireSink* sink() const noexcept { return sink_; }

  /// Who may have requests under way beside the one that request() waits for; null takes it away.
  void set_reply_sink(ReplySink* sink) noexcept { reply_sink_ = sink; }
  /// The correlation id for a new request.
  [[nodiscard]] std::uint16_t next_correlation() noexcept;
  /// Sends a request, or sends it again with the same correlation id; does not wait for the reply.
  [[nodiscard]] Status send_request(protocol::MessageId id, std::uint16_t correlation,
                                    std::span<const std::byte> payload, TimePoint deadline,
                                    const std::stop_token& stop);

  /// Run id of the last run that this session knows of; stale stream frames are not after it.
  std::optional<std::uint32_t> last_run;

  /// Says HELLO again with another nonce: tells whether and why the device restarted.
  [[nodiscard]] Result<protocol::HelloReply> renew(TimePoint deadline, const std::stop_token& stop);

  [[nodiscard]] std::vector<DeviceEvent> take_events();
  [[nodiscard]] LinkStatistics statistics() const;
  void close() noexcept;
  [[nodiscard]] bool closed() const noexcept { return closed_; }

 private:
  Session(std::unique_ptr<Transport> transport, const OpenOptions& options);
  [[nodiscard]] Status say_hello(TimePoint deadline, const std::stop_token& stop);
  /// The payload lies in request_payload_; the reply's is left in reply_.
  [[nodiscard]] Status exchange(protocol::MessageId id, std::string_view name, std::size_t payload_size,
                                protocol::MessageId expected, TimePoint deadline,
                                const std::stop_token& stop);
  [[nodiscard]] Status settle(std::string_view name, protocol::MessageId expected);
  [[nodiscard]] static std::unexpected<Error> malformed(std::string_view request);
  [[nodiscard]] protocol::FrameHeader next_header(protocol::Channel channel,
                                                  std::uint16_t correlation) noexcept;
  /// The status in reply_; nullopt when it is another message or unreadable.
  [[nodiscard]] std::optional<protocol::StatusReply> held_status() const;
  [[nodiscard]] bool holds_pending() const;
  void note_arrival();
  void on_frame(const protocol::Frame& frame);
  void on_control(const protocol::Frame& frame);
  void on_event(const protocol::Frame& frame);

  std::unique_ptr<Transport> transport_;
  std::string host_name_;
  std::string build_id_;
  std::uint16_t nonce_ = 0;
  bool closed_ = false;
  protocol::HelloReply hello_;
  WireSink* sink_ = nullptr;
  ReplySink* reply_sink_ = nullptr;

  std::vector<std::byte> decoder_buffer_;
  std::array<std::byte, protocol::kMaxFrameBytes> send_;
  std::array<std::byte, protocol::kMaxPayload> request_payload_;
  protocol::LinkDecoder decoder_;
  protocol::SequenceCounters sequence_;
  std::uint16_t last_correlation_ = 0;

  // The request that is waited for.
  bool saying_hello_ = false;
  std::uint16_t waiting_for_ = 0;  ///< Correlation; 0 = none.
  protocol::MessageId expected_id_ = protocol::MessageId::kStatusReply;
  protocol::MessageId reply_id_ = protocol::MessageId::kStatusReply;
  bool replied_ = false;
  std::optional<std::uint8_t> other_major_;  ///< Frames of this wire major came as answers to HELLO.
  std::vector<std::byte> reply_;

  TimePoint arrived_{};
  std::uint64_t arrived_unix_ns_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint64_t stale_ = 0;
  std::uint64_t copied_bytes_ = 0;
  std::deque<DeviceEvent> events_;
};

}  // namespace scatter::device
