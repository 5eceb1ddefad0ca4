// replay: a recording that answers like the device it was recorded from.
// Internal: programs use TransportRegistry.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/device/recording_reader.h"
#include "host_sdk/device/transport.h"
#include "protocol/link_decoder.h"
#include "protocol/session.h"

namespace scatter::device {

/// `replay:FILE`. Errors  as RecordingReader::open; kInvalidArgument: no file named.
[[nodiscard]] Result<std::unique_ptr<Transport>> open_replay(const Uri& uri, const Wait& wait);

/// Answers HELLO, object reads, configuration, start, status, stop and abort from the recording and streams
/// the recorded frames, losses included, as credits allow; everything else is refused with
/// FAILED_PRECONDITION. A configuration is accepted when a run was recorded with the same recipe.
/// Time stands still but for waits; the Unix time is the recorded one.
class ReplayTransport final : public Transport {
 public:
  explicit ReplayTransport(RecordingReader recording);

  [[nodiscard]] Result<std::span<const std::byte>> receive(TimePoint deadline,
                                                           const std::stop_token& stop) override;
  [[nodiscard]] Status write(std::span<const std::byte> bytes, TimePoint deadline,
                             const std::stop_token& stop) override;
  [[nodiscard]] TimePoint now() const override { return now_; }
  [[nodiscard]] std::uint64_t system_time_unix_ns() const override { return unix_ns_; }
  void close() noexcept override { closed_ = true; }

 private:
  void on_request(const protocol::Frame& request);
  void on_hello(const protocol::FrameHeader& request);
  void on_object_read(const protocol::FrameHeader& request, const protocol::ObjectRead& message);
  void on_set_configuration(const protocol::FrameHeader& request, const protocol::Recipe& recipe);
  void on_start(const protocol::FrameHeader& request, const protocol::Start& message);
  void on_get_status(const protocol::FrameHeader& request);
  void on_end(const protocol::FrameHeader& request, protocol::RunEnd reason);
  void refuse(const protocol::FrameHeader& request, protocol::StatusCode status, std::string_view text);
  template <typename Message>
  void send(protocol::Channel channel, std::uint16_t correlation, const Message& message);
  /// Appends the next recorded frame to `out_`; false when there is none or no credit for it.
  bool play_one();
  [[nodiscard]] protocol::RunReport report(protocol::RunEnd reason) const;

  RecordingReader recording_;
  bool closed_ = false;
  TimePoint now_{};
  std::uint64_t unix_ns_ = 0;
  std::uint16_t nonce_ = 0;
  std::vector<std::byte> decoder_buffer_;
  protocol::LinkDecoder decoder_;
  protocol::SequenceCounters sequence_;
  std::vector<std::byte> out_;   ///< For the host, not lent yet: a write() may append answers.
  std::vector<std::byte> lent_;  ///< What the host looks at.

  std::size_t run_ = 0;  ///< Current run.
  bool playing_ = false;
  bool ended_ = false;  ///< The run's end was sent.
  std::size_t at_ = 0;  ///< Next record of the run.
  std::uint32_t seen_until_ = 0;
  std::uint32_t ends_sent_ = 0;
  protocol::CreditWindow credit_;
};

}  // namespace scatter::device
