#include "protocol/cobs.h"

#include <algorithm>
#include <cstring>

namespace scatter::protocol {
namespace {

constexpr std::size_t kLongestGroup = 254;

}  // namespace

std::size_t cobs_encode(std::span<const std::byte> bytes, std::span<std::byte> out) noexcept {
  std::size_t written = 0;
  while (true) {
    const std::size_t limit = std::min(bytes.size(), kLongestGroup);
    const void* zero = limit == 0 ? nullptr : std::memchr(bytes.data(), 0, limit);
    const std::size_t run =
        zero == nullptr ? limit
                        : static_cast<std::size_t>(static_cast<const std::byte*>(zero) - bytes.data());
    if (out.size() - written < run + 1) {
      return 0;
    }
    out[written] = static_cast<std::byte>(run + 1);
    if (run != 0) {
      std::memcpy(out.data() + written + 1, bytes.data(), run);
    }
    written += run + 1;
    if (zero != nullptr) {
      bytes = bytes.subspan(run + 1);  // The zero itself lives in the code byte; a group follows it.
      continue;
    }
    bytes = bytes.subspan(run);
    if (bytes.empty()) {
      return written;
    }
  }
}

CobsDecoder::Event CobsDecoder::next(std::span<const std::byte>& bytes) noexcept {
  while (!bytes.empty()) {
    if (ended_) {
      size_ = encoded_ = 0;
      left_ = 0;
      zero_due_ = overflow_ = ended_ = false;
    }
    if (left_ > 0) {
      const std::size_t wanted = std::min<std::size_t>(left_, bytes.size());
      const void* zero = std::memchr(bytes.data(), 0, wanted);
      const std::size_t run =
          zero == nullptr ? wanted
                          : static_cast<std::size_t>(static_cast<const std::byte*>(zero) - bytes.data());
      const std::size_t room = std::min(run, buffer_.size() - size_);
      if (room != 0) {
        std::memcpy(buffer_.data() + size_, bytes.data(), room);
      }
      size_ += room;
      overflow_ = overflow_ || room < run;
      encoded_ += run;
      left_ = static_cast<std::uint8_t>(left_ - run);
      bytes = bytes.subspan(run);
      if (zero != nullptr) {
        bytes = bytes.subspan(1);
        ended_ = true;
        return Event::kMalformed;
      }
      continue;
    }
    const auto code = static_cast<std::uint8_t>(bytes.front());
    bytes = bytes.subspan(1);
    if (code == 0) {
      ended_ = true;
      if (encoded_ == 0) {
        continue;
      }
      return overflow_ ? Event::kTooLong : Event::kBlock;
    }
    if (zero_due_) {
      if (size_ < buffer_.size()) {
        buffer_[size_++] = std::byte{0};
      } else {
        overflow_ = true;
      }
    }
    ++encoded_;
    left_ = static_cast<std::uint8_t>(code - 1);
    zero_due_ = code != kLongestGroup + 1;
  }
  return Event::kNeedMore;
}

}  // namespace scatter::protocol
