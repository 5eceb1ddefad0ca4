// A small device in memory on a virtual clock, honest unless a test tells it otherwise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "host_sdk/device/device.h"
#include "host_sdk/device/transport.h"
#include "protocol/link_decoder.h"
#include "protocol/session.h"

namespace scatter::device::test {

using Bytes = std::vector<std::byte>;

inline constexpr std::uint16_t kWidth = 8;
inline constexpr std::uint16_t kHeight = 4;
inline constexpr std::uint32_t kFrameBytes = kWidth * kHeight * 2;
inline constexpr std::uint32_t kChunkBytes = 24;
/// Wire frames per exposure: begin, three chunks, end.
inline constexpr int kWirePerFrame = 5;

[[nodiscard]] protocol::Descriptor test_descriptor();
/// A recipe that gives `frames` exposures.
[[nodiscard]] protocol::Recipe test_recipe(std::uint16_t frames);
/// Pixel bytes of a frame: every frame and every byte differ from their neighbours.
[[nodiscard]] Bytes test_pixels(std::uint32_t frame_id);

/// What the device does with what it sends and hears; tests replace members.
struct Script {
  /// Called for every wire frame to the host; returns what really goes out (drop, double, damage).
  std::function<std::vector<Bytes>(const protocol::FrameHeader&, Bytes)> outgoing;
  /// False: the request is lost on its way.
  std::function<bool(const protocol::Frame&)> incoming;
  /// True: the test answered by itself (with send() or answer()).
  std::function<bool(const protocol::Frame&)> request;
  /// Ledger columns of the device: these frames were exposed and never sent.
  std::uint32_t lose_in_sensor = 0;    ///< The first n frames of a run.
  std::uint32_t lose_in_firmware = 0;  ///< The n frames after those.
  bool corrupt_checksum = false;       ///< FrameEnd carries a wrong checksum.
  bool silent_end = false;             ///< RunFinished is never sent.
  bool ignore_credit = false;
  std::uint32_t pattern_error = 0;  ///< Added to every pixel of the test pattern.
};

class ScriptedDevice final : public Transport {
 public:
  ScriptedDevice();

  [[nodiscard]] Result<std::span<const std::byte>> receive(TimePoint deadline,
                                                           const std::stop_token& stop) override;
  [[nodiscard]] Status write(std::span<const std::byte> bytes, TimePoint deadline,
                             const std::stop_token& stop) override;
  [[nodiscard]] TimePoint now() const override { return now_; }
  [[nodiscard]] std::uint64_t system_time_unix_ns() const override {
    return kUnixStart + static_cast<std::uint64_t>(now_.time_since_epoch().count());
  }
  void close() noexcept override { closed = true; }

  /// A frame to the host, through the script, `delay` from now.
  template <typename Message>
  void send(protocol::Channel channel, std::uint16_t correlation, const Message& message,
            Duration delay = {}) {
    Bytes bytes(protocol::kMaxFrameBytes);
    protocol::FrameHeader header;
    header.channel = channel;
    header.sequence = sequence_.next(channel);
    header.session = nonce;
    header.correlation = correlation;
    bytes.resize(protocol::write_message(std::span(bytes), header, message));
    post(std::move(bytes), delay);
  }
  template <typename Message>
  void answer(const protocol::FrameHeader& request, const Message& message, Duration delay = {}) {
    send(protocol::Channel::kControl, request.correlation, message, delay);
  }
  void answer_status(const protocol::FrameHeader& request, protocol::StatusCode status,
                     std::string_view text = "", std::uint32_t pending_ms = 0);
  /// Bytes as they are.
  void send_raw(Bytes bytes, Duration delay = {});
  /// The host's end sees the carrier closed after what was sent.
  void hang_up() { hung_up_ = true; }

  Script script;
  bool closed = false;
  bool running = false;
  bool aborted = false;
  std::uint16_t nonce = 0;
  std::uint32_t epoch = 0;
  std::uint32_t run_id = 0;
  std::map<protocol::MessageId, int> executed;  ///< Requests carried out, repetitions not counted.
  std::map<protocol::MessageId, int> heard;     ///< Requests that arrived.
  std::vector<std::uint32_t> credits;
  std::uint32_t boot_count = 3;
  std::uint32_t session_open = 1;

  static constexpr std::uint64_t kUnixStart = 1'767'225'600'000'000'000;  // 2026-01-01

 private:
  struct Posted {
    TimePoint due;
    Bytes bytes;
  };
  void post(Bytes frame, Duration delay);
  void on_frame(const protocol::Frame& frame);
  void execute(const protocol::Frame& frame);
  void object_read(const protocol::Frame& frame);
  void run();
  void send_frame(std::uint32_t id);
  [[nodiscard]] protocol::RunReport report(protocol::RunEnd reason);

  TimePoint now_{};
  bool hung_up_ = false;
  std::deque<Posted> posted_;
  Bytes lent_;
  Bytes decoder_buffer_;
  protocol::LinkDecoder decoder_;
  protocol::SequenceCounters sequence_;
  std::map<std::uint16_t, Bytes> replies_;
  std::uint16_t answering_ = 0;
  protocol::Recipe recipe_;
  protocol::CreditWindow credit_;
  std::uint32_t next_frame_ = 0;
  std::uint32_t sent_frames_ = 0;
};

/// The device of a test and the host's handle to it.
struct Pair {
  ScriptedDevice* device = nullptr;  ///< Owned by `host`.
  Result<Device> host;
};
[[nodiscard]] Pair open_pair(const std::function<void(ScriptedDevice&)>& prepare = {},
                             const OpenOptions& options = {});

/// All frames of a stream until it ends; fails the test on an error.
[[nodiscard]] std::vector<Frame> drain(Stream& stream);

}  // namespace scatter::device::test
