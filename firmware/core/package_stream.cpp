#include "firmware/core/package_stream.h"

#include <algorithm>

#include "protocol/codec.h"
#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::firmware {

using protocol::StatusCode;

namespace {

constexpr std::uint32_t kHeader = protocol::kImageHeaderBytes;
constexpr std::size_t kTableCrcOffset = 60;

bool all_zero(std::span<const std::byte> bytes) noexcept {
  return std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte{0}; });
}

/// The field of a header that holds the product is `product`, zero padded.
bool names(const protocol::ImageText& field, std::string_view product) noexcept {
  for (std::size_t i = 0; i < field.size(); ++i) {
    if (field[i] != (i < product.size() ? static_cast<std::uint8_t>(product[i]) : 0U)) {
      return false;
    }
  }
  return true;
}

}  // namespace

void PackageStream::start() noexcept {
  cancel();
  fault_ = PackageFault::kNone;
}

void PackageStream::cancel() noexcept {
  if (job_ != Job::kNone) {
    receiver_.cancel();
    job_ = Job::kNone;
  }
  slot_known_ = false;
  begun_ = false;
  place_known_ = false;
  position_ = 0;
  file_bytes_ = 0;
  body_bytes_ = 0;
  body_at_ = 0;
  resume_at_ = 0;
  used_ = 0;
  filled_ = 0;
  chunk_fill_ = 0;
}

void PackageStream::fail(PackageFault fault) noexcept {
  cancel();
  fault_ = fault;
}

void PackageStream::take(std::span<const std::byte> block) noexcept {
  if (busy() || fault_ != PackageFault::kNone || block.size() > block_.size()) {
    fail(PackageFault::kUnknown);
    return;
  }
  std::ranges::copy(block, block_.begin());
  filled_ = static_cast<std::uint32_t>(block.size());
  used_ = 0;
}

void PackageStream::finish() noexcept {
  if (busy() || !complete()) {
    fail(PackageFault::kIncomplete);
  } else if (receiver_.busy()) {
    fail(PackageFault::kNotNow);
  } else {
    ask(Job::kFinish, receiver_.finish());
  }
}

bool PackageStream::busy() const noexcept {
  return job_ != Job::kNone || used_ != filled_;
}

void PackageStream::step() noexcept {
  if (job_ != Job::kNone) {
    if (!receiver_.busy()) {  // Somebody else took the answer that was ours.
      fail(PackageFault::kUnknown);
    } else if (const auto answer = receiver_.poll()) {
      ended(job_, *answer);
    }
  } else if (used_ != filled_) {
    if (receiver_.busy()) {
      fail(PackageFault::kNotNow);
    } else if (!slot_known_) {
      ask(Job::kChooseSlot, receiver_.status(protocol::kMaxPayload));
    } else if (begun_ && !place_known_) {
      ask(Job::kFindPlace, receiver_.status(protocol::kMaxPayload));
    } else {
      consume();
    }
  }
}

void PackageStream::ask(Job job, const UpdateAnswer& answer) noexcept {
  if (answer.status == StatusCode::kPending) {
    job_ = job;
    ready_ = ready_ && job != Job::kBegin;  // It erases.
  } else {
    ended(job, answer);
  }
}

void PackageStream::ended(Job job, const UpdateAnswer& answer) noexcept {
  job_ = Job::kNone;
  const bool good = answer.status == StatusCode::kOk;
  switch (job) {
    case Job::kChooseSlot:
    case Job::kFindPlace:
      if (!good) {
        fail(PackageFault::kUnknown);
      } else if (job == Job::kChooseSlot) {
        slot_ = static_cast<std::uint8_t>(1 - receiver_.state().running_slot);
        slot_known_ = true;
      } else {
        resume_at_ = receiver_.state().received;
        place_known_ = true;
      }
      break;
    case Job::kBegin:
      if (good) {
        begun_ = true;
      } else {
        fail(answer.status == StatusCode::kDataLoss             ? PackageFault::kErase
             : answer.status == StatusCode::kFailedPrecondition ? PackageFault::kNotNow
                                                                : PackageFault::kRefused);
      }
      break;
    case Job::kFinish:
      ready_ = good;
      if (!good) {
        fail(answer.status == StatusCode::kDataLoss ? PackageFault::kVerify : PackageFault::kUnknown);
      }
      break;
    case Job::kNone:
      break;
  }
}

bool PackageStream::gather(std::uint32_t wanted) noexcept {
  const std::uint32_t count = std::min(wanted - chunk_fill_, filled_ - used_);
  std::copy_n(block_.begin() + used_, count, chunk_.begin() + chunk_fill_);
  used_ += count;
  position_ += count;
  chunk_fill_ += count;
  return chunk_fill_ == wanted;
}

void PackageStream::consume() noexcept {
  if (file_bytes_ == 0) {
    if (gather(kPackageTableBytes)) {
      read_table();
    }
    return;
  }
  const std::uint32_t header_end = offset_[slot_] + kHeader;
  if (position_ >= offset_[slot_] && position_ < header_end) {
    if (gather(kHeader)) {
      begin_image();
    }
  } else if (position_ >= header_end && position_ < header_end + body_bytes_) {
    add_body();
  } else {
    skip();
  }
}

void PackageStream::read_table() noexcept {
  chunk_fill_ = 0;
  const auto u32 = [this](std::size_t at) { return protocol::load_le<std::uint32_t>(chunk_.data() + at); };
  const auto u16 = [this](std::size_t at) { return protocol::load_le<std::uint16_t>(chunk_.data() + at); };
  const std::span<const std::byte> table(chunk_);
  offset_ = {u32(16), u32(24)};
  size_ = {u32(20), u32(28)};
  const auto fits = [](std::uint32_t size) {
    return size > kHeader && size <= kHeader + kPackageMaxBodyBytes;
  };
  const bool good = u32(kTableCrcOffset) == protocol::crc32c(table.first(kTableCrcOffset)) &&
                    u32(0) == kPackageMagic && u16(4) == kPackageVersion && u16(6) == ImageSlots::kCount &&
                    u32(12) == 0 && all_zero(table.subspan(32, kTableCrcOffset - 32)) && fits(size_[0]) &&
                    fits(size_[1]) && offset_[0] == kPackageTableBytes &&
                    offset_[1] == (offset_[0] + size_[0] + kPackageTableBytes - 1) / kPackageTableBytes *
                                      kPackageTableBytes &&
                    u32(8) == offset_[1] + size_[1];
  if (good) {
    file_bytes_ = u32(8);
  } else {
    fail(PackageFault::kFormat);
  }
}

void PackageStream::begin_image() noexcept {
  chunk_fill_ = 0;
  const std::span<const std::byte> bytes = std::span(chunk_).first(kHeader);
  protocol::ImageHeader header;
  if (!protocol::decode_into(bytes, header) || header.magic != protocol::kImageMagic ||
      header.body_bytes != size_[slot_] - kHeader) {
    fail(PackageFault::kFormat);
    return;
  }
  if (!names(header.product, product_)) {
    fail(PackageFault::kProduct);
    return;
  }
  body_bytes_ = header.body_bytes;
  protocol::UpdateBegin message;
  std::ranges::transform(bytes, message.header.begin(),
                         [](std::byte b) { return std::to_integer<std::uint8_t>(b); });
  ask(Job::kBegin, receiver_.begin(message));
}

void PackageStream::add_body() noexcept {
  const std::uint32_t end = body_at_ < resume_at_ ? std::min(resume_at_, body_bytes_) : body_bytes_;
  const std::uint32_t wanted = std::min(kChunk, end - body_at_);
  if (!gather(wanted)) {
    return;
  }
  chunk_fill_ = 0;
  protocol::UpdateWrite message;
  message.offset = body_at_;
  message.data = std::span(chunk_).first(wanted);
  const UpdateAnswer answer = receiver_.write(message);
  const bool compared = body_at_ < resume_at_;
  body_at_ += wanted;
  if (answer.status == StatusCode::kDataLoss) {
    fail(compared ? PackageFault::kVerify : PackageFault::kProgram);
  } else if (answer.status != StatusCode::kOk) {
    fail(PackageFault::kUnknown);
  }
}

/// The other image; or zeros between the images; or, behind the end, the suffix of a .dfu file that a host
/// left on.
void PackageStream::skip() noexcept {
  const std::uint32_t other = 1U - slot_;
  const std::uint32_t other_end = offset_[other] + size_[other];
  const std::uint32_t left = filled_ - used_;
  if (position_ >= offset_[other] && position_ < other_end) {
    const std::uint32_t count = std::min(left, other_end - position_);
    used_ += count;
    position_ += count;
  } else if (position_ < file_bytes_) {
    const std::uint32_t count = std::min(left, offset_[1] - position_);
    const bool good = all_zero(std::span(block_).subspan(used_, count));
    used_ += count;
    position_ += count;
    if (!good) {
      fail(PackageFault::kFormat);
    }
  } else if (gather(kDfuSuffixBytes)) {
    // Appendix B: "UFD" at 8, its own length at 11. Its checksum is over what a stream no longer has.
    constexpr std::array<std::byte, 4> kSignature{std::byte{'U'}, std::byte{'F'}, std::byte{'D'},
                                                  std::byte{kDfuSuffixBytes}};
    const bool good =
        std::ranges::equal(std::span(chunk_).subspan(8, kSignature.size()), kSignature) && used_ == filled_;
    if (!good || position_ != file_bytes_ + kDfuSuffixBytes) {
      fail(PackageFault::kFormat);
    }
  }
}

}  // namespace scatter::firmware
