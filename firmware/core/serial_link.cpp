#include "firmware/core/serial_link.h"

#include <algorithm>

#include "protocol/endian.h"

namespace scatter::firmware {
namespace {

constexpr std::size_t kLengthOffset = 8;
constexpr std::byte kMagicLow{static_cast<std::uint8_t>(protocol::kMagic & 0xFFU)};
constexpr std::byte kMagicHigh{static_cast<std::uint8_t>(protocol::kMagic >> 8U)};

}  // namespace

bool SerialLink::fetch() noexcept {
  for (;;) {
    if (undecoded_.empty()) {
      const std::size_t count = std::min(line_.read(raw_), raw_.size());
      if (count == 0) {
        return false;
      }
      undecoded_ = std::span<const std::byte>(raw_).first(count);
    }
    const protocol::ParseResult result = decoder_.next(undecoded_);
    if (result.status != protocol::ParseStatus::kNeedMore) {
      unread_ = decoder_.block();
      return true;
    }
  }
}

std::size_t SerialLink::read(std::span<std::byte> out) noexcept {
  std::size_t size = 0;
  // The block stays in place until it is read out; only then the decoder goes on.
  while (size < out.size() && (!unread_.empty() || fetch())) {
    const std::size_t count = std::min(out.size() - size, unread_.size());
    std::copy_n(unread_.begin(), count, out.begin() + static_cast<std::ptrdiff_t>(size));
    unread_ = unread_.subspan(count);
    size += count;
  }
  return size;
}

void SerialLink::send_encoded() noexcept {
  if (sent_ < encoded_size_) {
    const std::span<const std::byte> rest(encoded_.data() + sent_, encoded_size_ - sent_);
    sent_ += std::min(line_.write(rest), rest.size());
  }
}

void SerialLink::pump() noexcept {
  send_encoded();
  if (sent_ == encoded_size_ && frame_is_whole()) {
    // A zero before each frame: one byte in a thousand, and noise or a lost end costs one frame, not two.
    encoded_size_ = protocol::write_serial(encoded_, {frame_.data(), frame_size_}, true);
    sent_ = 0;
    frame_size_ = 0;
    send_encoded();
  }
}

std::size_t SerialLink::announced_size() const noexcept {
  return protocol::kFrameOverhead + protocol::load_le<std::uint32_t>(frame_.data() + kLengthOffset);
}

void SerialLink::skip_to_next_beginning() noexcept {
  ++unsendable_;
  std::size_t at = 1;
  while (at < frame_size_ && frame_[at] != kMagicLow) {
    ++at;
  }
  std::copy(frame_.begin() + static_cast<std::ptrdiff_t>(at),
            frame_.begin() + static_cast<std::ptrdiff_t>(frame_size_), frame_.begin());
  frame_size_ -= at;
}

void SerialLink::take(std::span<const std::byte>& bytes) noexcept {
  const bool headed = frame_size_ >= protocol::kHeaderBytes;
  const std::size_t wanted = headed ? announced_size() : protocol::kHeaderBytes;
  const std::size_t count = std::min(wanted - frame_size_, bytes.size());
  std::copy_n(bytes.begin(), count, frame_.begin() + static_cast<std::ptrdiff_t>(frame_size_));
  frame_size_ += count;
  bytes = bytes.subspan(count);
  if (frame_size_ == protocol::kHeaderBytes &&
      (frame_[0] != kMagicLow || frame_[1] != kMagicHigh || announced_size() > kFrameBytes)) {
    skip_to_next_beginning();
  }
}

std::size_t SerialLink::write(std::span<const std::byte> bytes) noexcept {
  const std::size_t offered = bytes.size();
  for (pump(); !bytes.empty() && !frame_is_whole(); pump()) {
    take(bytes);
  }
  return offered - bytes.size();
}

}  // namespace scatter::firmware
