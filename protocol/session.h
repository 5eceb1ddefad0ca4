// What both ends of a session share: sequence numbers, at-most-once replies, credits in frames,
// settings epochs and HELLO (SPEC.md sections 5 and 6). All counters wrap at 2^32.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/frame.h"
#include "protocol/messages.h"

namespace scatter::protocol {

/// True when `a` comes before `b` in a counter that wraps: their distance is below 2^31.
[[nodiscard]] constexpr bool comes_before(std::uint32_t a, std::uint32_t b) noexcept {
  return static_cast<std::int32_t>(a - b) < 0;
}

/// Sequence numbers of the frames that one end sends: one counter per channel, from 0 per session.
class SequenceCounters {
 public:
  /// The number for the next frame on `channel`; each call gives a new one.
  [[nodiscard]] constexpr std::uint32_t next(Channel channel) noexcept {
    return next_[static_cast<std::size_t>(channel)]++;
  }
  /// Starts again at `first` on every channel (new session).
  constexpr void reset(std::uint32_t first = 0) noexcept { next_.fill(first); }

 private:
  std::array<std::uint32_t, kChannels> next_{};
};

/// Counts frames that one end did not receive, by the gaps in their sequence numbers. The first frame
/// of each channel sets the start.
class SequenceTracker {
 public:
  struct Arrival {
    std::uint32_t missing = 0;  ///< Frames skipped just before this one.
    bool repeated = false;      ///< This number or a later one has come before.
  };
  constexpr Arrival arrived(const FrameHeader& header) noexcept {
    Lane& lane = lanes_[static_cast<std::size_t>(header.channel) % kChannels];
    if (lane.started && comes_before(header.sequence, lane.expected)) {
      return {.missing = 0, .repeated = true};
    }
    const std::uint32_t missing = lane.started ? header.sequence - lane.expected : 0;
    lane = {.expected = header.sequence + 1, .started = true};
    missing_ += missing;
    return {.missing = missing, .repeated = false};
  }
  /// Sum over all channels. A frame that comes late was counted as missing before.
  [[nodiscard]] constexpr std::uint64_t missing() const noexcept { return missing_; }
  constexpr void reset() noexcept { *this = {}; }

 private:
  struct Lane {
    std::uint32_t expected = 0;
    bool started = false;
  };
  std::array<Lane, kChannels> lanes_{};
  std::uint64_t missing_ = 0;
};

/// Frames that the receiver allows: ids before `may_send_until`. Grants are absolute, so lost,
/// repeated and late grants do no harm.
class CreditWindow {
 public:
  /// Start of a run: frame ids count from `first_frame`.
  constexpr void restart(std::uint32_t may_send_until, std::uint32_t first_frame = 0) noexcept {
    until_ = comes_before(may_send_until, first_frame) ? first_frame : may_send_until;
  }
  /// False, and nothing changes, when the grant is not above the one in force.
  constexpr bool grant(std::uint32_t may_send_until) noexcept {
    if (!comes_before(until_, may_send_until)) {
      return false;
    }
    until_ = may_send_until;
    return true;
  }
  [[nodiscard]] constexpr bool may_send(std::uint32_t frame_id) const noexcept {
    return comes_before(frame_id, until_);
  }
  [[nodiscard]] constexpr std::uint32_t until() const noexcept { return until_; }

 private:
  std::uint32_t until_ = 0;
};

/// Number of the settings in force. 0 = never configured, so the counter skips it when it wraps.
class EpochCounter {
 public:
  constexpr explicit EpochCounter(std::uint32_t current = 0) noexcept : current_(current) {}
  /// A configuration was accepted: its number.
  constexpr std::uint32_t advance() noexcept {
    if (++current_ == 0) {
      current_ = 1;
    }
    return current_;
  }
  [[nodiscard]] constexpr std::uint32_t current() const noexcept { return current_; }

 private:
  std::uint32_t current_;
};

/// Last replies of a device, so that a repeated request is answered and not executed again.
///
/// Key: session, correlation and message id. The storage is the caller's, cut into equal slots; one
/// slot must hold the longest reply frame. When all slots are used the oldest gives way, so a host
/// may have at most slots() requests open. RAM: storage and 12 bytes per slot. Not thread-safe.
class ReplyCache {
 public:
  static constexpr std::size_t kMaxSlots = 8;

  enum class Admission : std::uint8_t {
    kExecute,   ///< New: execute it, then store() its reply.
    kRepeat,    ///< Known and answered: send reply() again.
    kUnderWay,  ///< Known, no reply yet: it is being executed; send nothing.
    kUncached,  ///< Correlation 0: no reply is wanted.
  };

  /// `slots` is clamped to 1..kMaxSlots. `storage` must outlive the cache.
  ReplyCache(std::span<std::byte> storage, std::size_t slots) noexcept;

  /// What to do with a request that came in. kExecute takes a slot for it.
  [[nodiscard]] Admission admit(const FrameHeader& request) noexcept;
  /// Keeps the whole reply frame of an admitted request. Storing again replaces it: first PENDING, then
  /// the end. False when the frame is longer than a slot or the request has no slot any more; the
  /// request then counts as not answered.
  bool store(const FrameHeader& request, std::span<const std::byte> reply_frame) noexcept;
  /// The kept reply frame, byte for byte; empty when there is none.
  [[nodiscard]] std::span<const std::byte> reply(const FrameHeader& request) const noexcept;
  /// Forgets everything (new session).
  void clear() noexcept;

  [[nodiscard]] std::size_t slots() const noexcept { return slots_; }
  [[nodiscard]] std::size_t slot_bytes() const noexcept { return slot_bytes_; }

 private:
  struct Entry {
    std::uint16_t session = 0;
    std::uint16_t correlation = 0;  ///< 0 = free.
    std::uint16_t message = 0;
    std::uint32_t size = 0;  ///< 0 = under way.
  };
  [[nodiscard]] std::size_t find(const FrameHeader& request) const noexcept;

  std::span<std::byte> storage_;
  std::array<Entry, kMaxSlots> entries_{};
  std::size_t slots_;
  std::size_t slot_bytes_;
  std::size_t next_ = 0;
};

/// What one end offers in HELLO.
struct Offer {
  std::uint8_t min_wire_major = kWireMajor;
  std::uint8_t max_wire_major = kWireMajor;
  std::uint32_t max_payload = kMaxPayload;
  std::uint32_t capabilities = 0;
};

/// Smallest payload limit an end may ask for: every message without a tail fits.
inline constexpr std::uint32_t kMinPayload = kMaxSerialPayload;

/// Answer of a device to HELLO.
struct Negotiation {
  StatusCode status = StatusCode::kOk;
  HelloReply reply;     ///< kOk: wire major, schema revision and digest, payload limit, capabilities
                        ///< filled in; the caller adds identity, clock and state.
  StatusReply refusal;  ///< Otherwise: send this.
};

/// Chooses the highest common wire major and the lower payload limit. No common major:
/// kVersionMismatch with a refusal whose bytes never change (SPEC 6.4). A payload limit below
/// kMinPayload: kInvalidArgument. The reply names the device's own capabilities; the agreed ones are
/// common_capabilities() of both.
[[nodiscard]] Negotiation negotiate(const Hello& hello, const Offer& device,
                                    std::uint32_t schema_digest) noexcept;

[[nodiscard]] constexpr std::uint32_t common_capabilities(const Hello& hello,
                                                          const HelloReply& reply) noexcept {
  return hello.capabilities & reply.capabilities;
}

}  // namespace scatter::protocol
