#include "firmware/core/link_output.h"

#include <algorithm>

namespace scatter::firmware {

void LinkOutput::clear() noexcept {
  first_ = used_ = control_left_ = 0;
  stream_size_ = stream_sent_ = 0;
  writing_ = Writing::kNothing;
}

void LinkOutput::begin_session(std::uint16_t session) noexcept {
  if (writing_ == Writing::kControl) {
    used_ = control_left_;  // Keep the rest of the frame under way, drop what waits behind it.
  } else {
    first_ = used_ = 0;
  }
  discard_stream();
  session_ = session;
  sequence_.fill(0);
}

bool LinkOutput::queue(std::span<const std::byte> frame) noexcept {
  if (frame.size() > kMaxControlFrame || kControlBytes - used_ < frame.size() + kLengthBytes) {
    return false;
  }
  const std::array<std::byte, kLengthBytes> length{static_cast<std::byte>(frame.size() & 0xFFU),
                                                   static_cast<std::byte>(frame.size() >> 8U)};
  push(length);
  push(frame);
  return true;
}

void LinkOutput::push(std::span<const std::byte> bytes) noexcept {
  const std::size_t at = (first_ + used_) % kControlBytes;
  const std::size_t head = std::min(bytes.size(), kControlBytes - at);
  std::copy_n(bytes.begin(), head, ring_.begin() + static_cast<std::ptrdiff_t>(at));
  std::copy(bytes.begin() + static_cast<std::ptrdiff_t>(head), bytes.end(), ring_.begin());
  used_ += bytes.size();
}

void LinkOutput::drop(std::size_t count) noexcept {
  first_ = (first_ + count) % kControlBytes;
  used_ -= count;
}

std::size_t LinkOutput::peek_length() const noexcept {
  const auto low = static_cast<std::size_t>(ring_[first_]);
  const auto high = static_cast<std::size_t>(ring_[(first_ + 1) % kControlBytes]);
  return low | (high << 8U);
}

std::span<std::byte> LinkOutput::stream_slot() noexcept {
  return stream_size_ == 0 ? stream_ : std::span<std::byte>();
}

protocol::FrameHeader LinkOutput::stream_header() noexcept {
  protocol::FrameHeader header;
  header.channel = protocol::Channel::kStream;
  header.session = session_;
  header.sequence = sequence_[static_cast<std::size_t>(protocol::Channel::kStream)]++;
  return header;
}

void LinkOutput::submit_stream(std::size_t size) noexcept {
  stream_size_ = size;
  stream_sent_ = 0;
}

bool LinkOutput::discard_stream() noexcept {
  if (stream_size_ == 0 || writing_ == Writing::kStream) {
    return false;
  }
  stream_size_ = 0;
  // Its number was never seen: the host must not take the gap for a loss.
  --sequence_[static_cast<std::size_t>(protocol::Channel::kStream)];
  return true;
}

bool LinkOutput::pump() noexcept {
  bool any = false;
  for (;;) {
    if (writing_ == Writing::kNothing) {
      if (used_ > 0) {
        control_left_ = peek_length();
        drop(kLengthBytes);
        writing_ = Writing::kControl;
      } else if (stream_size_ > 0) {
        writing_ = Writing::kStream;
      } else {
        return any;
      }
    }
    const std::size_t taken = writing_ == Writing::kControl ? write_control() : write_stream();
    if (taken == 0) {
      if (writing_ == Writing::kStream && stream_sent_ == 0) {
        writing_ = Writing::kNothing;  // Not begun after all: control may still go first.
      }
      return any;
    }
    any = true;
  }
}

std::size_t LinkOutput::write_control() noexcept {
  const std::size_t chunk = std::min(control_left_, kControlBytes - first_);
  const std::size_t taken = std::min(chunk, link_.write({ring_.data() + first_, chunk}));
  drop(taken);
  control_left_ -= taken;
  if (control_left_ == 0) {
    link_.end_frame();
    writing_ = Writing::kNothing;
  }
  return taken;
}

std::size_t LinkOutput::write_stream() noexcept {
  const std::size_t left = stream_size_ - stream_sent_;
  const std::size_t taken = std::min(left, link_.write({stream_.data() + stream_sent_, left}));
  stream_sent_ += taken;
  if (stream_sent_ == stream_size_) {
    link_.end_frame();
    stream_size_ = stream_sent_ = 0;
    writing_ = Writing::kNothing;
  }
  return taken;
}

}  // namespace scatter::firmware
