#include "protocol/link_decoder.h"

#include <algorithm>
#include <cstring>

namespace scatter::protocol {

void LinkCounters::count(const ParseResult& result) noexcept {
  switch (result.status) {
    case ParseStatus::kFrame:
      ++good;
      return;
    case ParseStatus::kBadHeader:
      ++bad_header;
      break;
    case ParseStatus::kBadLength:
      ++bad_length;
      break;
    case ParseStatus::kBadPayload:
      ++bad_payload;
      break;
    case ParseStatus::kBadVersion:
      ++bad_version;
      return;
    case ParseStatus::kUnknownFlags:
      ++unknown_flags;
      return;
    case ParseStatus::kUnknownChannel:
      ++unknown_channel;
      return;
    case ParseStatus::kNoMagic:
    case ParseStatus::kNeedMore:
      break;
  }
  skipped_bytes += static_cast<std::uint32_t>(result.consumed);
}

LinkDecoder::LinkDecoder(std::span<std::byte> buffer, std::uint32_t max_payload) noexcept : buffer_(buffer) {
  set_max_payload(max_payload);
}

void LinkDecoder::set_max_payload(std::uint32_t max_payload) noexcept {
  const std::size_t room = buffer_.size() > kFrameOverhead ? buffer_.size() - kFrameOverhead : 0;
  max_payload_ = static_cast<std::uint32_t>(std::min<std::size_t>(max_payload, room));
}

void LinkDecoder::keep(std::span<const std::byte> bytes) noexcept {
  if (bytes.empty()) {
    return;
  }
  if (end_ + bytes.size() > buffer_.size()) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  std::memcpy(buffer_.data() + end_, bytes.data(), bytes.size());
  end_ += bytes.size();
}

ParseResult LinkDecoder::next(std::span<const std::byte>& bytes) noexcept {
  for (;;) {
    const bool buffered = begin_ != end_;
    if (!buffered) {
      begin_ = end_ = 0;
      if (bytes.empty()) {
        return {};
      }
    }
    const std::span<const std::byte> window =
        buffered ? std::span<const std::byte>(buffer_).subspan(begin_, end_ - begin_) : bytes;
    const ParseResult result = parse_frame(window, max_payload_);
    if (result.status == ParseStatus::kNeedMore) {
      if (bytes.empty()) {
        return result;
      }
      // Never more than the frame in hand needs, so that later frames need no copy.
      const std::size_t taken = buffered ? std::min(result.missing, bytes.size()) : bytes.size();
      keep(bytes.first(taken));
      bytes = bytes.subspan(taken);
      if (!buffered) {
        return result;
      }
      continue;
    }
    counters_.count(result);
    if (buffered) {
      begin_ += result.consumed;
    } else {
      bytes = bytes.subspan(result.consumed);
    }
    if (result.status == ParseStatus::kFrame || is_refused(result.status)) {
      return result;
    }
  }
}

void LinkDecoder::abandon_first_byte() noexcept {
  if (end_ - begin_ >= kHeaderBytes) {
    ++counters_.bad_payload;  // A whole header waits here only when its checksum was right.
  } else {
    ++counters_.bad_header;
  }
  ++counters_.skipped_bytes;
  ++begin_;
}

}  // namespace scatter::protocol
