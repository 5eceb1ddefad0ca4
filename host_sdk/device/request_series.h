// A long series of requests with several under way at once. Internal to this wing: programs use Device.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string_view>
#include <vector>

#include "host_sdk/device/session.h"
#include "host_sdk/device/wait.h"
#include "host_sdk/error/error.h"
#include "protocol/codec.h"
#include "protocol/session.h"

namespace scatter::device {

/// Requests of one kind that a status answers, sent in order, each executed at most once.
///
/// Repetitions come after 250 ms, or three times the longest time that a reply took so far, then twice as
/// long each time, up to 2 s, and 2 s after PENDING. No request but those of the series may be sent while it
/// lives. Threads  the session's.
class RequestSeries final : public ReplySink {
 public:
  /// As many as the device's reply cache surely keeps; the other half is for what a lost reply leaves behind.
  static constexpr std::size_t kMaxDepth = protocol::ReplyCache::kMaxSlots / 2;

  /// `depth` is clamped to 1..kMaxDepth. `patience` is how long a single request may remain unanswered.
  /// `done` is called for each request that the device carried out, in the order of the replies.
  RequestSeries(Session& session, std::size_t depth, Wait patience, std::function<void()> done);
  ~RequestSeries();
  RequestSeries(const RequestSeries&) = delete;
  RequestSeries& operator=(const RequestSeries&) = delete;

  /// Waits for room, then sends.
  /// Errors  that of any request of the series: the device's own, kDeadlineExceeded, kAborted, kDisconnected.
  ///         After an error the series is over, and it is unknown which of the requests under way were
  ///         carried out.
  template <typename Request>
  [[nodiscard]] Status push(const Request& request) {
    std::vector<std::byte> payload(protocol::encoded_size(request));
    (void)protocol::encode(request, std::span(payload));
    return push(Request::kId, Request::kName, std::move(payload));
  }
  /// Waits until every request is answered. Errors as push().
  [[nodiscard]] Status finish();

  bool on_reply(const protocol::Frame& frame) override;

 private:
  struct Place {
    std::uint16_t correlation = 0;  ///< 0 = free.
    std::vector<std::byte> payload;
    TimePoint next_send{};
    TimePoint pushed{};
    TimePoint give_up{};
    Duration spacing{};
  };
  [[nodiscard]] Status push(protocol::MessageId id, std::string_view name, std::vector<std::byte> payload);
  /// Sends what is due and takes what comes, until at most `open` requests are under way.
  [[nodiscard]] Status wait_until_open(std::size_t open);
  [[nodiscard]] std::size_t open() const noexcept;

  Session& session_;
  std::size_t depth_;
  Wait patience_;
  std::function<void()> done_;
  protocol::MessageId id_ = protocol::MessageId::kStatusReply;
  std::string_view name_;
  std::array<Place, kMaxDepth> places_;
  std::optional<Error> failed_;
  Duration slowest_{};  ///< Longest time that a reply of this series took.
};

}  // namespace scatter::device
