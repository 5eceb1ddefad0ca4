#include "firmware/image/body_check.h"

#include <algorithm>
#include <span>

namespace scatter::firmware {

void BodyCheck::begin(Flash& slot, const protocol::ImageHeader& header, Verifier& verifier) noexcept {
  slot_ = &slot;
  verifier_ = &verifier;
  offset_ = 0;
  bytes_ = header.body_bytes;
  expected_ = header.body_sha512;
  verifier.hash_begin();
}

BodyCheck::Result BodyCheck::step() noexcept {
  const std::uint32_t end = std::min(bytes_, offset_ + kPieceBytes);
  while (offset_ < end) {
    const auto size = std::min(end - offset_, kReadBytes);
    const std::span<std::byte> bytes = std::span(buffer_).first(size);
    if (!slot_->read(protocol::kImageBodyOffset + offset_, bytes)) {
      return Result::kUnreadable;
    }
    verifier_->hash_add(bytes);
    offset_ += size;
  }
  if (offset_ < bytes_) {
    return Result::kMore;
  }
  return verifier_->hash_end() == expected_ ? Result::kGood : Result::kBad;
}

BodyCheck::Result BodyCheck::run() noexcept {
  Result result = Result::kMore;
  while (result == Result::kMore) {
    result = step();
  }
  return result;
}

}  // namespace scatter::firmware
