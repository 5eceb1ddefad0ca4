// The long parts of an update, one bounded piece at a time.
#include <algorithm>

#include "firmware/core/update_receiver.h"

namespace scatter::firmware {

using protocol::SlotVerdict;
using protocol::StatusCode;

std::optional<UpdateAnswer> UpdateReceiver::poll() noexcept {
  std::optional<Answer> answer;
  switch (job_) {
    case Job::kNone:
      return std::nullopt;
    case Job::kFindEnd:
      find_end_step();
      break;
    case Job::kErase:
      answer = erase_step();
      break;
    case Job::kFinish:
      answer = finish_step();
      break;
    case Job::kInspect:
      answer = inspect_step();
      break;
  }
  if (answer) {
    job_ = Job::kNone;
    if (answer->status != StatusCode::kOk) {
      target_ = ImageSlots::kCount;
    }
  }
  return answer;
}

/// Looks from the back for the last unit that holds something and can be read. It and whatever lies behind it
/// may be what a power cut left half-done; a unit that cannot be read may have been blank before, so it
/// proves nothing about those in front of it.
void UpdateReceiver::find_end_step() noexcept {
  const Flash::Geometry geometry = views_[target_].layout.flash;
  const std::uint32_t unit = --next_unit_;
  const Content content = content_of(slots_.slot(target_), unit, geometry.unit_bytes);
  if (content != Content::kErased && end_unit_ == 0) {
    end_unit_ = std::min(unit + 2, geometry.units - 1);
  }
  if (unit == 0) {  // The first unit holds the header and cannot be kept without it.
    start_erase(0, geometry.units - 1);
  } else if (content == Content::kProgrammed) {
    start_erase(unit, end_unit_);
  }
}

/// The marks first, so that a slot without its whole body can never look ready; then from the back, so that
/// what a cut leaves half-erased lies just behind the last unit that looks programmed, and is erased again.
void UpdateReceiver::start_erase(std::uint32_t first_unit, std::uint32_t end_unit) noexcept {
  job_ = Job::kErase;
  marks_erased_ = false;
  keep_units_ = first_unit;
  next_unit_ = end_unit;
  received_ =
      first_unit == 0 ? 0 : first_unit * views_[target_].layout.flash.unit_bytes - protocol::kImageBodyOffset;
}

std::optional<UpdateAnswer> UpdateReceiver::erase_step() noexcept {
  Flash& flash = slots_.slot(target_);
  const Flash::Geometry geometry = views_[target_].layout.flash;
  std::uint32_t unit = geometry.units - 1;
  if (marks_erased_) {
    if (next_unit_ == keep_units_) {
      return keep_units_ > 0 ? Answer{} : write_header();
    }
    unit = --next_unit_;
  }
  if (!flash.erase(unit) || content_of(flash, unit, geometry.unit_bytes) != Content::kErased) {
    return Answer{StatusCode::kDataLoss, Text("flash unit ") << unit << " of slot " << target_
                                                             << " cannot be erased: it is worn out"};
  }
  marks_erased_ = true;
  return std::nullopt;
}

std::optional<UpdateAnswer> UpdateReceiver::write_header() noexcept {
  Flash& flash = slots_.slot(target_);
  if (!flash.program(0, header_) || !same_bytes(flash, 0, header_)) {
    return Answer{StatusCode::kDataLoss, Text("flash did not take the image's header: begin again")};
  }
  return Answer{};
}

std::optional<UpdateAnswer> UpdateReceiver::finish_step() noexcept {
  Flash& flash = slots_.slot(target_);
  switch (body_.step()) {
    case BodyCheck::Result::kMore:
      return std::nullopt;
    case BodyCheck::Result::kGood:
      looked_ = false;
      if (!write_mark(flash, MarkKind::kReady)) {
        return Answer{StatusCode::kDataLoss, Text("flash did not take the mark of a complete image")};
      }
      body_checked_[target_] = true;
      return Answer{};
    default:
      // Nobody knows which bytes are wrong: without its header the next begin starts from nothing.
      looked_ = false;
      (void)flash.erase(0);
      return Answer{StatusCode::kDataLoss,
                    Text("the body's SHA-512 is not the one in the header: begin again")};
  }
}

std::optional<UpdateAnswer> UpdateReceiver::inspect_step() noexcept {
  const std::uint8_t slot = other();
  const BodyCheck::Result result = body_.step();
  if (result == BodyCheck::Result::kMore) {
    return std::nullopt;
  }
  body_checked_[slot] = true;
  if (result != BodyCheck::Result::kGood) {
    views_[slot].verdict =
        result == BodyCheck::Result::kUnreadable ? SlotVerdict::kUnreadable : SlotVerdict::kBadBody;
  }
  fill_state(max_payload_);
  return Answer{.status = StatusCode::kOk, .text = {}, .with_state = true};
}

UpdateReceiver::Content UpdateReceiver::content_of(Flash& flash, std::uint32_t unit,
                                                   std::uint32_t unit_bytes) noexcept {
  Content content = Content::kErased;
  for (std::uint32_t done = 0; done < unit_bytes;) {
    const std::uint32_t size = std::min(unit_bytes - done, kReadBytes);
    const std::span<std::byte> bytes = std::span(buffer_).first(size);
    if (!flash.read(unit * unit_bytes + done, bytes)) {
      return Content::kUnreadable;
    }
    if (!std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte{0xFF}; })) {
      content = Content::kProgrammed;
    }
    done += size;
  }
  return content;
}

bool UpdateReceiver::same_bytes(Flash& flash, std::uint32_t offset,
                                std::span<const std::byte> bytes) noexcept {
  while (!bytes.empty()) {
    const std::size_t size = std::min(bytes.size(), buffer_.size());
    const std::span<std::byte> found = std::span(buffer_).first(size);
    if (!flash.read(offset, found) || !std::ranges::equal(found, bytes.first(size))) {
      return false;
    }
    bytes = bytes.subspan(size);
    offset += static_cast<std::uint32_t>(size);
  }
  return true;
}

}  // namespace scatter::firmware
