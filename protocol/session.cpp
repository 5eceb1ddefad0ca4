#include "protocol/session.h"

#include <algorithm>
#include <cstring>

namespace scatter::protocol {

ReplyCache::ReplyCache(std::span<std::byte> storage, std::size_t slots) noexcept
    : storage_(storage),
      slots_(std::clamp<std::size_t>(slots, 1, kMaxSlots)),
      slot_bytes_(storage.size() / slots_) {}

std::size_t ReplyCache::find(const FrameHeader& request) const noexcept {
  for (std::size_t i = 0; i < slots_; ++i) {
    const Entry& entry = entries_[i];
    if (entry.correlation != 0 && entry.correlation == request.correlation &&
        entry.session == request.session && entry.message == request.message) {
      return i;
    }
  }
  return slots_;
}

ReplyCache::Admission ReplyCache::admit(const FrameHeader& request) noexcept {
  if (request.correlation == 0) {
    return Admission::kUncached;
  }
  const std::size_t known = find(request);
  if (known != slots_) {
    return entries_[known].size == 0 ? Admission::kUnderWay : Admission::kRepeat;
  }
  entries_[next_] = {
      .session = request.session, .correlation = request.correlation, .message = request.message, .size = 0};
  next_ = (next_ + 1) % slots_;
  return Admission::kExecute;
}

bool ReplyCache::store(const FrameHeader& request, std::span<const std::byte> reply_frame) noexcept {
  const std::size_t slot = find(request);
  if (slot == slots_ || reply_frame.empty()) {
    return false;
  }
  if (reply_frame.size() > slot_bytes_) {
    entries_[slot] = {};
    return false;
  }
  std::memcpy(storage_.data() + slot * slot_bytes_, reply_frame.data(), reply_frame.size());
  entries_[slot].size = static_cast<std::uint32_t>(reply_frame.size());
  return true;
}

std::span<const std::byte> ReplyCache::reply(const FrameHeader& request) const noexcept {
  const std::size_t slot = find(request);
  return slot == slots_
             ? std::span<const std::byte>{}
             : std::span<const std::byte>(storage_).subspan(slot * slot_bytes_, entries_[slot].size);
}

void ReplyCache::clear() noexcept {
  entries_ = {};
  next_ = 0;
}

Negotiation negotiate(const Hello& hello, const Offer& device, std::uint32_t schema_digest) noexcept {
  Negotiation result;
  result.refusal.request = static_cast<std::uint16_t>(Hello::kId);
  const std::uint8_t low = std::max(hello.min_wire_major, device.min_wire_major);
  const std::uint8_t high = std::min(hello.max_wire_major, device.max_wire_major);
  if (low > high) {
    result.status = result.refusal.status = StatusCode::kVersionMismatch;
    result.refusal.text = "no common wire version";
    return result;
  }
  if (hello.max_payload < kMinPayload) {
    result.status = result.refusal.status = StatusCode::kInvalidArgument;
    result.refusal.text = "max_payload is below 1024 bytes";
    return result;
  }
  result.reply.wire_major = high;
  result.reply.schema_revision = kSchemaRevision;
  result.reply.schema_digest = schema_digest;
  result.reply.max_payload = std::min(hello.max_payload, device.max_payload);
  result.reply.capabilities = device.capabilities;
  return result;
}

}  // namespace scatter::protocol
