#include "simulator/faults/frame_faults.h"

#include <algorithm>
#include <utility>

#include "protocol/frame.h"

namespace scatter::simulator {
namespace {

/// Keeps both directions' draws apart: frames of one direction are even, of the other odd.
std::uint64_t position(std::uint64_t frame, Direction direction) noexcept {
  return frame * 2 + static_cast<std::uint64_t>(direction);
}

void append(std::vector<std::byte>& out, std::span<const std::byte> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

}  // namespace

FrameFaults::FrameFaults(const LinkRates& rates, std::uint64_t seed, Direction direction)
    : rates_(rates), seed_(seed), direction_(direction) {}

bool FrameFaults::strikes(FaultKey key, double rate) const noexcept {
  return fault_strikes(seed_, key, position(counts_.frames, direction_), rate);
}

std::array<std::uint32_t, 4> FrameFaults::draw(FaultKey key, std::uint32_t part) const noexcept {
  // Part 0 decided whether the fault strikes.
  return fault_draw(seed_, key, position(counts_.frames, direction_), part + 1);
}

void FrameFaults::pass(std::span<const std::byte> bytes, std::uint64_t now_us, std::vector<std::byte>& out) {
  if (partial_.empty()) {
    partial_since_us_ = now_us;
  }
  append(partial_, bytes);
  std::size_t done = 0;
  while (done < partial_.size()) {
    const auto rest = std::span(partial_).subspan(done);
    const protocol::ParseResult result = protocol::parse_frame(rest);
    if (result.status == protocol::ParseStatus::kNeedMore) {
      break;
    }
    const auto taken = rest.first(result.consumed);
    if (result.frame || protocol::is_refused(result.status)) {
      whole_frame({taken.begin(), taken.end()}, now_us, out);
    } else {
      append(out, taken);
    }
    done += result.consumed;
    partial_since_us_ = now_us;
  }
  partial_.erase(partial_.begin(), partial_.begin() + static_cast<std::ptrdiff_t>(done));
}

void FrameFaults::whole_frame(std::vector<std::byte> frame, std::uint64_t now_us,
                              std::vector<std::byte>& out) {
  if (strikes(FaultKey::kGarbage, rates_.garbage)) {
    const std::uint32_t length = draw(FaultKey::kGarbage, 0)[0] % 64 + 1;
    for (std::uint32_t i = 0; i < length; ++i) {
      out.push_back(static_cast<std::byte>(draw(FaultKey::kGarbage, i + 1)[0] & 0xFFU));
    }
    ++counts_.garbage_bursts;
  }
  bool hold = false;
  if (strikes(FaultKey::kDrop, rates_.drop)) {
    ++counts_.dropped;
    frame.clear();
  } else {
    if (strikes(FaultKey::kCorrupt, rates_.corrupt)) {
      corrupt(frame);
      ++counts_.corrupted;
    }
    if (strikes(FaultKey::kTruncate, rates_.truncate)) {
      frame.resize(draw(FaultKey::kTruncate, 0)[0] % frame.size());
      ++counts_.truncated;
    }
    if (strikes(FaultKey::kDuplicate, rates_.duplicate)) {
      const std::vector<std::byte> once = frame;
      append(frame, once);
      ++counts_.duplicated;
    }
    hold = held_.empty() && strikes(FaultKey::kReorder, rates_.reorder);
  }
  ++counts_.frames;
  if (hold) {
    ++counts_.reordered;
    held_ = std::move(frame);
    held_since_us_ = now_us;
    return;
  }
  append(out, frame);
  append(out, held_);
  held_.clear();
}

void FrameFaults::corrupt(std::span<std::byte> frame) const noexcept {
  const std::uint32_t flips = draw(FaultKey::kCorrupt, 0)[0] % 5 + 1;
  for (std::uint32_t i = 0; i < flips; ++i) {
    // Five bits apart from each other by construction: flipping one twice would undo the damage.
    const std::size_t stripe = frame.size() * 8 / 5;
    const std::size_t bit = i * stripe + draw(FaultKey::kCorrupt, i + 1)[0] % stripe;
    frame[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
  }
}

void FrameFaults::release_due(std::uint64_t now_us, std::vector<std::byte>& out) {
  if (!held_.empty() && now_us >= held_since_us_ + kHoldUs) {
    append(out, held_);
    held_.clear();
  }
  if (!partial_.empty() && now_us >= partial_since_us_ + kHoldUs) {
    append(out, partial_);
    partial_.clear();
  }
}

std::optional<std::uint64_t> FrameFaults::due_us() const noexcept {
  std::optional<std::uint64_t> due;
  if (!held_.empty()) {
    due = held_since_us_ + kHoldUs;
  }
  if (!partial_.empty()) {
    due = std::min(due.value_or(UINT64_MAX), partial_since_us_ + kHoldUs);
  }
  return due;
}

void FrameFaults::clear() noexcept {
  held_.clear();
  partial_.clear();
}

}  // namespace scatter::simulator
