// The host facing a device that says anything: every call ends in time, memory stays bounded, and
// what is handed out as complete is complete.
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "host_sdk/device/device.h"
#include "protocol/crc.h"
#include "protocol/link_decoder.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

namespace {

using namespace scatter;
using namespace scatter::device;
using namespace std::chrono_literals;
using protocol::Channel;
using protocol::MessageId;

/// Answers by the input: each piece is one utterance; when it is used up the device is silent.
class HostileDevice final : public Transport {
 public:
  explicit HostileDevice(std::span<const std::byte> input) : input_(input), decoder_(decoder_buffer_) {}

  Result<std::span<const std::byte>> receive(TimePoint deadline, const std::stop_token&) override {
    if (said_.empty()) {
      speak();
    }
    if (said_.empty()) {
      now_ = std::max(now_, deadline);
      return fail(ErrorCode::kDeadlineExceeded, "silent", "wait");
    }
    lent_.swap(said_);
    said_.clear();
    return lent_;
  }
  Status write(std::span<const std::byte> bytes, TimePoint, const std::stop_token&) override {
    decoder_.push(bytes, [this](const protocol::Frame& frame) { hear(frame); });
    return {};
  }
  TimePoint now() const override { return now_; }
  std::uint64_t system_time_unix_ns() const override { return 1; }
  void close() noexcept override {}

 private:
  /// HELLO, descriptor, configuration and Start are answered well, so that the input reaches deep.
  void hear(const protocol::Frame& frame) {
    request_ = frame.header();
    if (frame.id() == MessageId::kHello) {
      say(Channel::kControl, request_.correlation, protocol::HelloReply{});
    } else if (frame.id() == MessageId::kObjectRead) {
      protocol::Descriptor descriptor;
      descriptor.sensor.width_px = 16;
      descriptor.sensor.height_px = 16;
      std::vector<std::byte> object(protocol::encoded_size(descriptor));
      (void)protocol::encode(descriptor, std::span(object));
      protocol::ObjectChunk chunk;
      chunk.object = 1;
      chunk.total = static_cast<std::uint32_t>(object.size());
      chunk.object_crc = protocol::crc32c(object);
      chunk.data = object;
      say(Channel::kControl, request_.correlation, chunk);
    } else if (frame.id() == MessageId::kSetConfiguration) {
      say(Channel::kControl, request_.correlation, protocol::ConfigurationAccepted{.epoch = 1});
    } else if (frame.id() == MessageId::kStart) {
      say(Channel::kControl, request_.correlation, protocol::Started{.run_id = 1});
    }
  }
  template <typename Message>
  void say(Channel channel, std::uint16_t correlation, const Message& message) {
    std::vector<std::byte> bytes(protocol::kMaxFrameBytes);
    protocol::FrameHeader header;
    header.channel = channel;
    header.session = request_.session;
    header.correlation = correlation;
    bytes.resize(protocol::write_message(std::span(bytes), header, message));
    said_.insert(said_.end(), bytes.begin(), bytes.end());
  }
  /// Utterance: kind, message id, length, bytes. Kind 0 raw bytes; else a checked frame whose channel,
  /// session and correlation are right or wrong by the bits of `kind`.
  void speak() {
    if (input_.size() < 3) {
      return;
    }
    const auto kind = static_cast<unsigned>(input_[0]);
    const auto id = static_cast<unsigned>(input_[1]);
    const std::size_t length = std::min<std::size_t>(static_cast<std::size_t>(input_[2]), input_.size() - 3);
    const std::span<const std::byte> payload = input_.subspan(3, length);
    input_ = input_.subspan(3 + length);
    if (kind % 8 == 0) {
      said_.assign(payload.begin(), payload.end());
      return;
    }
    protocol::FrameHeader header;
    header.channel = static_cast<Channel>((kind >> 3U) % 4);
    header.session = static_cast<std::uint16_t>(request_.session + ((kind & 0x40U) != 0 ? 1U : 0U));
    header.correlation = static_cast<std::uint16_t>(request_.correlation + ((kind & 0x80U) != 0 ? 1U : 0U));
    constexpr std::uint16_t kPages[] = {0x8000, 0x0200, 0x0100, 0x0000};
    header.message = static_cast<std::uint16_t>(kPages[(kind >> 3U) % 4] | (id & 0x1FU));
    said_.resize(protocol::kMaxFrameBytes);
    said_.resize(protocol::write_frame(said_, header, payload));
  }

  std::span<const std::byte> input_;
  std::vector<std::byte> said_;
  std::vector<std::byte> lent_;
  std::vector<std::byte> decoder_buffer_ = std::vector<std::byte>(protocol::kMaxFrameBytes);
  protocol::LinkDecoder decoder_;
  protocol::FrameHeader request_;
  TimePoint now_{};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Result<Device> device = Device::open(
      std::make_unique<HostileDevice>(std::span(reinterpret_cast<const std::byte*>(data), size)));
  require(device.has_value());
  const Wait wait{.timeout = 2s, .stop = {}};
  (void)device->status(wait);
  (void)device->calibration_list(wait);
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  if (!device->configure(recipe, wait)) {
    return 0;
  }
  const TimePoint before = device->now();
  {
    Result<Stream> stream = device->start({.recorder = nullptr, .credit_window = 2}, wait);
    // Every frame takes some input, so more turns than bytes means that something goes round.
    for (std::size_t turn = 0; stream && turn < size + 10; ++turn) {
      const Result<std::optional<Frame>> frame = stream->next(wait);
      if (!frame || !*frame) {
        break;
      }
      require((*frame)->size_bytes <= 16 * 16 * 2);
      if ((*frame)->status == FrameStatus::kComplete) {
        require((*frame)->size_bytes == (*frame)->pixel_count() * 2 && (*frame)->missing.empty());
        require(protocol::crc32c((*frame)->bytes()) == (*frame)->end.frame_crc);
      }
      require(turn + 1 < size + 10);
    }
  }
  // start(), one next() that hands out nothing, and the farewell: each ends at its deadline.
  require(device->now() - before <= std::chrono::seconds(2) * static_cast<std::int64_t>(size + 4));
  require(device->take_events().size() <= 256);
  return 0;
}
