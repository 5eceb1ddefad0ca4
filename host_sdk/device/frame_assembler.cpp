#include "host_sdk/device/frame_assembler.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "protocol/crc.h"
#include "protocol/session.h"

namespace scatter::device {

namespace {

// A link that reorders swaps neighbours; a frame this far behind a whole one gets nothing any more.
constexpr std::uint32_t kReorderDepth = 2;

// Honest devices send rising offsets; more separate pieces than this only come from hostile ones.
constexpr std::size_t kMaxPieces = 4096;

}  // namespace

struct FrameAssembler::Open {
  Frame frame;
  std::uint32_t id = 0;
  std::optional<std::uint32_t> total;
  std::shared_ptr<std::byte[]> pixels;
  std::vector<ByteRange> filled;  ///< Ascending, neither touching nor overlapping.
  std::uint32_t crc = 0;          ///< Of the first `crc_until` bytes, from the chunks' checksums.
  std::uint32_t crc_until = 0;
  bool whole = false;

  [[nodiscard]] bool all_bytes() const noexcept {
    return total && (*total == 0 || (filled.size() == 1 && filled[0] == ByteRange{0, *total}));
  }
};

FrameAssembler::FrameAssembler(std::shared_ptr<PixelPool> pool, const AssemblerLimits& limits)
    : pool_(std::move(pool)), limits_(limits) {}

FrameAssembler::~FrameAssembler() = default;

bool FrameAssembler::of_this_run(std::uint32_t run_id) noexcept {
  if (!limits_.run_id) {
    if (limits_.after_run && !protocol::comes_before(*limits_.after_run, run_id)) {
      return false;
    }
    limits_.run_id = run_id;
  }
  return run_id == *limits_.run_id;
}

FrameAssembler::Open* FrameAssembler::find_or_open(std::uint32_t frame_id) {
  if (protocol::comes_before(frame_id, settled_until_)) {
    ++counters_.duplicate_chunks;
    return nullptr;
  }
  if (limits_.until && !protocol::comes_before(frame_id, *limits_.until)) {
    ++counters_.unrequested_chunks;
    return nullptr;
  }
  // The newest frame is nearly always the one: look from the back.
  auto at = open_.end();
  while (at != open_.begin() && !protocol::comes_before((*std::prev(at))->id, frame_id)) {
    --at;
  }
  if (at != open_.end() && (*at)->id == frame_id) {
    return at->get();
  }
  if (open_.size() >= limits_.max_open) {
    settle_front();
    return find_or_open(frame_id);
  }
  auto made = std::make_unique<Open>();
  made->id = frame_id;
  made->frame.begin.run_id = made->frame.end.run_id = limits_.run_id.value_or(0);
  made->frame.begin.frame_id = made->frame.end.frame_id = frame_id;
  if (protocol::comes_before(seen_until_, frame_id + 1)) {
    seen_until_ = frame_id + 1;
  }
  return open_.insert(at, std::move(made))->get();
}

void FrameAssembler::accept(const protocol::Frame& wire, std::uint64_t host_time_unix_ns) {
  Open* open = nullptr;
  switch (wire.id()) {
    case protocol::MessageId::kFrameBegin: {
      const auto message = wire.as<protocol::FrameBegin>();
      if (!message || !of_this_run(message->run_id) || message->total > limits_.max_frame_bytes) {
        break;
      }
      open = find_or_open(message->frame_id);
      if (open == nullptr) {
        return;
      }
      if (open->frame.has_begin || open->whole) {
        ++counters_.duplicate_chunks;
        return;
      }
      if (open->total && *open->total != message->total) {
        break;
      }
      open->frame.begin = *message;
      open->frame.has_begin = true;
      open->total = message->total;
      break;
    }
    case protocol::MessageId::kFrameData: {
      const auto message = wire.as<protocol::FrameData>();
      if (!message || !of_this_run(message->run_id) || message->total > limits_.max_frame_bytes ||
          message->offset > message->total || message->data.size() > message->total - message->offset) {
        break;
      }
      open = find_or_open(message->frame_id);
      if (open == nullptr) {
        return;
      }
      if (open->total.value_or(message->total) != message->total) {
        ++counters_.unrequested_chunks;
        return;
      }
      open->total = message->total;
      place(*open, *message, wire);
      break;
    }
    case protocol::MessageId::kFrameEnd: {
      const auto message = wire.as<protocol::FrameEnd>();
      if (!message || !of_this_run(message->run_id)) {
        break;
      }
      open = find_or_open(message->frame_id);
      if (open == nullptr) {
        return;
      }
      if (open->frame.has_end) {
        ++counters_.duplicate_chunks;
        return;
      }
      open->frame.end = *message;
      open->frame.has_end = true;
      ++counters_.ends_seen;
      break;
    }
    default:
      break;
  }
  if (open == nullptr) {
    ++counters_.unrequested_chunks;
    return;
  }
  open->frame.host_time_unix_ns = host_time_unix_ns;
  settle_if_whole(*open);
}

void FrameAssembler::place(Open& frame, const protocol::FrameData& data, const protocol::Frame& wire) {
  const std::uint32_t begin = data.offset;
  const auto end = static_cast<std::uint32_t>(begin + data.data.size());
  if (begin == end) {
    return;
  }
  if (!frame.pixels) {
    frame.pixels = pool_->take(*frame.total);
    if (!frame.pixels) {
      ++counters_.unrequested_chunks;
      return;
    }
  }
  const auto copy = [&](std::uint32_t from, std::uint32_t to) {
    std::memcpy(frame.pixels.get() + from, data.data.data() + (from - begin), to - from);
    counters_.pixel_bytes += to - from;
  };
  std::vector<ByteRange>& filled = frame.filled;
  if (filled.empty() ? begin == 0 : filled.back().end == begin) {  // In order: the usual case.
    copy(begin, end);
    if (filled.empty()) {
      filled.push_back({begin, end});
    } else {
      filled.back().end = end;
    }
    if (frame.crc_until == begin) {
      frame.crc = tail_crc_.append(frame.crc, wire.payload(), wire.payload_crc(), data.data.size());
      frame.crc_until = end;
    }
    return;
  }
  // First piece that ends at or behind the chunk's start, and one past the last that starts at or
  // before its end: these become one piece.
  const auto first = std::ranges::lower_bound(filled, begin, {}, &ByteRange::end);
  const auto last = std::ranges::upper_bound(filled, end, {}, &ByteRange::begin);
  if (first == last) {
    if (filled.size() >= kMaxPieces) {
      ++counters_.unrequested_chunks;
      return;
    }
    copy(begin, end);
    filled.insert(first, {begin, end});
    return;
  }
  std::uint32_t at = begin;
  bool fresh = false;
  for (auto piece = first; piece != last; ++piece) {
    if (at < piece->begin) {
      copy(at, piece->begin);
      fresh = true;
    }
    at = std::max(at, piece->end);
  }
  if (at < end) {
    copy(at, end);
    fresh = true;
  }
  if (!fresh) {
    ++counters_.duplicate_chunks;
  }
  first->begin = std::min(first->begin, begin);
  first->end = std::max(std::prev(last)->end, end);
  filled.erase(std::next(first), last);
}

void FrameAssembler::settle_if_whole(Open& frame) {
  if (frame.whole || !frame.frame.has_begin || !frame.frame.has_end || !frame.all_bytes()) {
    return;
  }
  frame.whole = true;
  const protocol::FrameBegin& begin = frame.frame.begin;
  const std::uint64_t pixels = static_cast<std::uint64_t>(begin.width) * begin.height;
  bool right = *frame.total != 0 && packed_bytes(begin.pixel_format, pixels) == *frame.total &&
               (!limits_.epoch || begin.epoch == *limits_.epoch);
  if (right) {
    const std::span<const std::byte> rest(frame.pixels.get() + frame.crc_until,
                                          *frame.total - frame.crc_until);
    right = protocol::crc32c(rest, frame.crc) == frame.frame.end.frame_crc;
  }
  frame.frame.status = right ? FrameStatus::kComplete : FrameStatus::kCorrupt;
  // Older frames that still miss something will not get it any more.
  while (protocol::comes_before(open_.front()->id + kReorderDepth - 1, frame.id)) {
    settle_front();
  }
  advance();
}

void FrameAssembler::settle_front() {
  const std::unique_ptr<Open> front = std::move(open_.front());
  open_.pop_front();
  settled_until_ = front->id + 1;
  Frame& frame = front->frame;
  const std::uint32_t total = front->total.value_or(0);
  if (!front->whole) {
    frame.status = FrameStatus::kIncomplete;
    ++counters_.incomplete;
    std::uint32_t at = 0;
    for (const ByteRange& piece : front->filled) {
      if (at < piece.begin) {
        frame.missing.push_back({at, piece.begin});
      }
      at = piece.end;
    }
    if (at < total) {
      frame.missing.push_back({at, total});
    }
    if (front->pixels) {
      for (const ByteRange& gap : frame.missing) {
        std::memset(front->pixels.get() + gap.begin, 0, gap.end - gap.begin);
      }
    }
  } else if (frame.status == FrameStatus::kComplete) {
    ++counters_.complete;
  } else {
    ++counters_.corrupt;
  }
  frame.size_bytes = front->pixels ? total : 0;
  frame.pixels = std::move(front->pixels);
  ready_.push_back(std::move(frame));
}

void FrameAssembler::advance() {
  while (!open_.empty() && open_.front()->whole) {
    settle_front();
  }
}

void FrameAssembler::flush() {
  while (!open_.empty()) {
    settle_front();
  }
}

void FrameAssembler::skip_to(std::uint32_t frame_id) {
  while (!open_.empty() && protocol::comes_before(open_.front()->id, frame_id)) {
    settle_front();
  }
  if (protocol::comes_before(settled_until_, frame_id)) {
    settled_until_ = frame_id;
  }
  advance();
}

std::optional<Frame> FrameAssembler::pop() {
  if (ready_.empty()) {
    return std::nullopt;
  }
  std::optional<Frame> frame(std::move(ready_.front()));
  ready_.pop_front();
  return frame;
}

}  // namespace scatter::device
