// What comes from the host, until it is a frame: the link's bytes, the decoder, a bounded number of requests
// in a turn, and frames that stop arriving.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/link_output.h"
#include "firmware/ports/ports.h"
#include "protocol/link_decoder.h"

namespace scatter::firmware {

/// RAM: that of the decoder's state beside the caller's buffers, no heap. Threads: one.
class RequestReader {
 public:
  enum class Change : std::uint8_t { kNone, kAttached, kDetached };

  /// `frame` holds the longest wire frame, `received` one read of the link. All outlive the reader.
  RequestReader(Clock& clock, Link& link, const LinkOutput& output, std::span<std::byte> frame,
                std::span<std::byte> received) noexcept
      : clock_(clock), link_(link), output_(output), decoder_(frame), received_(received) {}

  /// Looks whether a host is on the link. What the old one had begun to send is gone at each change.
  [[nodiscard]] Change follow_link() noexcept;
  [[nodiscard]] bool connected() const noexcept { return connected_; }

  /// While connected: one Link::read and up to kFramesPerTurn frames, each to on_frame(const
  /// protocol::Frame&), or to on_refused(const protocol::FrameHeader&) when intact but not for this version.
  /// Takes none while a reply would find no room. True when something was done.
  template <typename OnFrame, typename OnRefused>
  bool receive(OnFrame on_frame, OnRefused on_refused) noexcept;

  /// When a frame that has begun is given up [us]; 0 = none has.
  [[nodiscard]] std::uint64_t gives_up_at_us(std::uint64_t now_us) const noexcept {
    return decoder_.buffered() > 0 ? std::max(heard_at_us_ + kSilenceUs, now_us + 1) : 0;
  }
  [[nodiscard]] const protocol::LinkCounters& counters() const noexcept { return decoder_.counters(); }

 private:
  // More in a turn would let a chatty host starve the sensor.
  static constexpr int kFramesPerTurn = 4;
  // A frame that stops arriving for this long is broken [us].
  static constexpr std::uint64_t kSilenceUs = 1'000'000;

  Clock& clock_;
  Link& link_;
  const LinkOutput& output_;
  protocol::LinkDecoder decoder_;
  std::span<std::byte> received_;
  std::span<const std::byte> unread_;  // Of received_, not yet decoded.
  bool decoder_has_more_ = false;      // next() may give a frame without new bytes.
  bool connected_ = false;
  std::uint64_t heard_at_us_ = 0;
};

template <typename OnFrame, typename OnRefused>
bool RequestReader::receive(OnFrame on_frame, OnRefused on_refused) noexcept {
  const std::uint64_t now = clock_.now_us();
  bool did_work = false;
  if (unread_.empty()) {
    const std::size_t count = std::min(link_.read(received_), received_.size());
    unread_ = std::span<const std::byte>(received_).first(count);
    if (count > 0) {
      heard_at_us_ = now;
      did_work = true;
    }
  }
  for (int i = 0; i < kFramesPerTurn && (!unread_.empty() || decoder_has_more_); ++i) {
    if (!output_.has_control_room()) {
      break;  // The host reads its replies before it gets more.
    }
    const protocol::ParseResult result = decoder_.next(unread_);
    decoder_has_more_ = result.status != protocol::ParseStatus::kNeedMore;
    did_work = true;
    if (result.frame) {
      on_frame(*result.frame);
    } else if (protocol::is_refused(result.status)) {
      on_refused(result.header);
    }
  }
  if (decoder_.buffered() > 0 && unread_.empty() && !decoder_has_more_ && now >= heard_at_us_ + kSilenceUs) {
    did_work = true;
    decoder_.give_up([&](const protocol::Frame& frame) {
      if (output_.has_control_room()) {  // Else it is as lost as the frame around it; the host asks again.
        on_frame(frame);
      }
    });
  }
  return did_work;
}

}  // namespace scatter::firmware
