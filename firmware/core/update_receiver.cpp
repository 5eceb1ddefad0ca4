// Requests and their checks; the pieces of long requests are in update_jobs.cpp.
#include "firmware/core/update_receiver.h"

#include <algorithm>

#include "protocol/codec.h"

namespace scatter::firmware {

using protocol::MessageId;
using protocol::SlotVerdict;
using protocol::StatusCode;

namespace {

constexpr std::uint32_t kChunkStep = 64;  // Whole granules of any flash.

UpdateAnswer broken_payload() noexcept {
  return {StatusCode::kInvalidArgument, Text("payload ends inside a field")};
}

}  // namespace

UpdateReceiver::UpdateReceiver(ImageSlots& slots, Verifier& verifier, std::string_view product) noexcept
    : slots_(slots), verifier_(verifier), product_(product) {}

UpdateAnswer UpdateReceiver::request(const protocol::Frame& frame, std::uint32_t max_payload) noexcept {
  if (busy()) {
    return {StatusCode::kUnavailable, Text("an update request is under way: wait for its reply")};
  }
  switch (frame.id()) {
    case MessageId::kUpdateBegin:
      if (const auto message = frame.as<protocol::UpdateBegin>()) {
        return begin(*message);
      }
      return broken_payload();
    case MessageId::kUpdateWrite:
      if (const auto message = frame.as<protocol::UpdateWrite>()) {
        return write(*message);
      }
      return broken_payload();
    case MessageId::kUpdateFinish:
      return finish();
    case MessageId::kUpdateConfirm:
      return confirm();
    case MessageId::kUpdateStatus:
      return status(max_payload);
    default:
      return {StatusCode::kUnimplemented, Text("unknown request")};
  }
}

void UpdateReceiver::look() noexcept {
  if (looked_) {
    return;
  }
  for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
    views_[i] = view_slot(slots_, i, verifier_, product_);
  }
  looked_ = true;
}

// In the bootloader nothing runs: an unfinished download goes on where it is, else slot 0 is offered.
std::uint8_t UpdateReceiver::other() const noexcept {
  const std::uint8_t running = slots_.running();
  if (running < ImageSlots::kCount) {
    return static_cast<std::uint8_t>(1 - running);
  }
  const bool second =
      views_[1].verdict == SlotVerdict::kReceiving && views_[0].verdict != SlotVerdict::kReceiving;
  return second ? 1 : 0;
}

UpdateAnswer UpdateReceiver::refusal(HeaderFault fault, const protocol::ImageHeader& header,
                                     const SlotIdentity& slot) const noexcept {
  switch (fault) {
    case HeaderFault::kNone:
      return {};
    case HeaderFault::kFormat:
      return {StatusCode::kInvalidArgument,
              Text("this is no image header that this firmware knows: magic, version, flags or padding")};
    case HeaderFault::kProduct:
      return {StatusCode::kInvalidArgument, Text("image is for product \"")
                                                << text_of(header.product) << "\", expected \""
                                                << slot.product << "\""};
    case HeaderFault::kSignature:
      return {StatusCode::kPermissionDenied, Text("image is not signed by a key that this device trusts")};
    case HeaderFault::kSlot:
      return {StatusCode::kInvalidArgument, Text("image is linked for slot ")
                                                << header.slot << ", expected slot " << slot.index};
    case HeaderFault::kAddress:
      return {StatusCode::kInvalidArgument, Text("image is linked for address ")
                                                << header.load_address << ", expected "
                                                << (slot.address + protocol::kImageBodyOffset)};
    case HeaderFault::kSize:
      return {StatusCode::kInvalidArgument,
              Text("image has ") << header.body_bytes << " bytes, expected 1 to " << slot.body_capacity};
  }
  return {StatusCode::kInternal, Text("unknown header fault")};
}

UpdateAnswer UpdateReceiver::begin(const protocol::UpdateBegin& message) noexcept {
  look();
  std::ranges::transform(message.header, header_.begin(),
                         [](std::uint8_t b) { return static_cast<std::byte>(b); });
  const std::uint8_t running = slots_.running();
  // In the bootloader either slot may be written: one of them may be worn out.
  const auto wanted = std::to_integer<std::uint8_t>(header_[76]);
  const std::uint8_t target =
      running < ImageSlots::kCount ? other() : (wanted < ImageSlots::kCount ? wanted : 0);
  const SlotLayout& layout = views_[target].layout;
  const SlotIdentity slot{.product = product_,
                          .index = target,
                          .address = slots_.address(target),
                          .body_capacity = layout.body_capacity};
  protocol::ImageHeader header;
  target_ = ImageSlots::kCount;
  if (const HeaderFault fault = check_header(header_, slot, verifier_, header); fault != HeaderFault::kNone) {
    return refusal(fault, header, slot);
  }
  const std::uint32_t lowest = lowest_counter(views_);
  if (header.security_counter < lowest) {
    return {StatusCode::kInvalidArgument, Text("image is a step back: its security counter is ")
                                              << header.security_counter << ", expected at least " << lowest};
  }
  const bool on_trial = running < ImageSlots::kCount && views_[running].marks.last != MarkKind::kConfirmed;
  if (on_trial && views_[target].verdict == SlotVerdict::kConfirmed) {
    return {StatusCode::kFailedPrecondition, Text("the running image is on trial and the other slot is its "
                                                  "fallback: confirm it, or reboot, first")};
  }
  Flash& flash = slots_.slot(target);
  body_bytes_ = header.body_bytes;
  const bool same = views_[target].header_good && same_bytes(flash, 0, header_);
  target_ = target;
  if (same && views_[target].verdict == SlotVerdict::kReady) {
    (void)repair_marks(flash, views_[target].marks);
    received_ = body_bytes_;
    return {};
  }
  looked_ = false;
  body_checked_[target] = false;
  if (same && views_[target].verdict == SlotVerdict::kReceiving) {
    job_ = Job::kFindEnd;
    end_unit_ = 0;
    next_unit_ = (protocol::kImageBodyOffset + body_bytes_ - 1) / layout.flash.unit_bytes + 1;
  } else {
    start_erase(0, layout.flash.units - 1);
  }
  return {StatusCode::kPending, {}};
}

UpdateAnswer UpdateReceiver::write(const protocol::UpdateWrite& message) noexcept {
  if (target_ == ImageSlots::kCount) {
    return {StatusCode::kFailedPrecondition, Text("no update was begun: send update_begin first")};
  }
  const auto size = static_cast<std::uint32_t>(message.data.size());
  if (message.offset > body_bytes_ || size > body_bytes_ - message.offset) {
    return {StatusCode::kOutOfRange, Text("bytes from ")
                                         << message.offset << " to " << (std::uint64_t{message.offset} + size)
                                         << " are past the body's end at " << body_bytes_};
  }
  Flash& flash = slots_.slot(target_);
  const std::uint32_t at = protocol::kImageBodyOffset + message.offset;
  if (message.offset + size <= received_) {
    if (same_bytes(flash, at, message.data)) {
      return {};
    }
    return {StatusCode::kDataLoss,
            Text("bytes at ") << message.offset << " differ from those received before: begin again"};
  }
  if (message.offset != received_) {
    return {StatusCode::kOutOfRange, Text("offset is ") << message.offset << ", expected " << received_};
  }
  const std::uint32_t granule = views_[target_].layout.flash.program_bytes;
  const bool last = message.offset + size == body_bytes_;
  if (size > kMaxChunk || (!last && size % granule != 0)) {
    return {StatusCode::kInvalidArgument, Text("chunk has ") << size << " bytes, expected a multiple of "
                                                             << granule << " up to " << kMaxChunk};
  }
  if (!program(flash, at, message.data) || !same_bytes(flash, at, message.data)) {
    target_ = ImageSlots::kCount;  // Cells that were touched must not be programmed again.
    return {StatusCode::kDataLoss, Text("flash did not take the bytes at ")
                                       << message.offset << ": begin again"};
  }
  received_ += size;
  return {};
}

// Unit by unit: what a power cut leaves half-done then lies in one unit, the last one that looks programmed
// or the one behind it. The last granule is filled up with erased bytes.
bool UpdateReceiver::program(Flash& flash, std::uint32_t offset, std::span<const std::byte> bytes) noexcept {
  const Flash::Geometry geometry = flash.geometry();
  while (!bytes.empty()) {
    const std::size_t in_unit = geometry.unit_bytes - offset % geometry.unit_bytes;
    const std::size_t here = std::min(bytes.size(), in_unit);
    const std::size_t whole = here / geometry.program_bytes * geometry.program_bytes;
    if (whole > 0 && !flash.program(offset, bytes.first(whole))) {
      return false;
    }
    if (whole < here) {
      std::array<std::byte, 64> rest;
      rest.fill(std::byte{0xFF});
      std::ranges::copy(bytes.subspan(whole), rest.begin());
      return flash.program(offset + static_cast<std::uint32_t>(whole),
                           std::span<const std::byte>(rest).first(geometry.program_bytes));
    }
    bytes = bytes.subspan(here);
    offset += static_cast<std::uint32_t>(here);
  }
  return true;
}

UpdateAnswer UpdateReceiver::finish() noexcept {
  if (target_ == ImageSlots::kCount) {
    return {StatusCode::kFailedPrecondition, Text("no update was begun: send update_begin first")};
  }
  if (received_ != body_bytes_) {
    return {StatusCode::kFailedPrecondition, Text("received ")
                                                 << received_ << " bytes, expected " << body_bytes_};
  }
  look();
  if (views_[target_].verdict == SlotVerdict::kReady) {
    return {};
  }
  if (views_[target_].verdict != SlotVerdict::kReceiving) {
    target_ = ImageSlots::kCount;
    return {StatusCode::kDataLoss, Text("the header in flash is damaged: begin again")};
  }
  body_.begin(slots_.slot(target_), views_[target_].header, verifier_);
  job_ = Job::kFinish;
  return {StatusCode::kPending, {}};
}

UpdateAnswer UpdateReceiver::confirm() noexcept {
  const std::uint8_t running = slots_.running();
  if (running >= ImageSlots::kCount) {
    return {StatusCode::kFailedPrecondition, Text("no image runs: flash a firmware image")};
  }
  look();
  if (views_[running].verdict == SlotVerdict::kConfirmed) {
    (void)repair_marks(slots_.slot(running), views_[running].marks);
    return {};
  }
  if (!views_[running].header_good) {
    return {StatusCode::kDataLoss, Text("the running image's header is damaged: flash a firmware image")};
  }
  if (!write_mark(slots_.slot(running), MarkKind::kConfirmed, next_confirmation(views_))) {
    return {StatusCode::kDataLoss, Text("flash did not take the confirmation")};
  }
  looked_ = false;
  return {};
}

UpdateAnswer UpdateReceiver::status(std::uint32_t max_payload) noexcept {
  max_payload_ = max_payload;
  look();
  const std::uint8_t slot = other();
  const SlotVerdict verdict = views_[slot].verdict;
  const bool said_whole = verdict == SlotVerdict::kReady || verdict == SlotVerdict::kReverted ||
                          verdict == SlotVerdict::kTrial || verdict == SlotVerdict::kConfirmed;
  if (said_whole && !body_checked_[slot]) {
    body_.begin(slots_.slot(slot), views_[slot].header, verifier_);
    job_ = Job::kInspect;
    return {StatusCode::kPending, {}};
  }
  fill_state(max_payload);
  return {.status = StatusCode::kOk, .text = {}, .with_state = true};
}

void UpdateReceiver::fill_state(std::uint32_t max_payload) noexcept {
  const std::uint8_t running = slots_.running();
  const std::uint8_t slot = other();
  const SlotView& mine = views_[1 - slot];
  const SlotView& theirs = views_[slot];
  const auto version = [](const SlotView& view) {
    return view.header_good ? text_of(view.header.version) : std::string_view();
  };
  protocol::UpdateState state;
  state.running_slot = static_cast<std::uint8_t>(1 - slot);
  state.running_version = version(mine);
  state.other_version = version(theirs);
  state.running_verdict = mine.verdict;
  state.running_counter = mine.header_good ? mine.header.security_counter : 0;
  state.other_counter = theirs.header_good ? theirs.header.security_counter : 0;
  state.lowest_counter = lowest_counter(views_);
  state.other_verdict = theirs.verdict;
  if (theirs.header_good && theirs.verdict != SlotVerdict::kConfirmed &&
      theirs.header.security_counter < state.lowest_counter) {
    state.other_verdict = SlotVerdict::kRolledBack;
  }
  state.slot_bytes = theirs.layout.body_capacity;
  const std::uint32_t head = protocol::min_encoded_size<protocol::UpdateWrite>();
  state.chunk_bytes =
      std::min(max_payload - std::min(max_payload, head), kMaxChunk) / kChunkStep * kChunkStep;
  state.received = target_ == slot ? received_ : 0;
  if (running < ImageSlots::kCount && mine.verdict != SlotVerdict::kConfirmed) {
    state.phase = protocol::UpdatePhase::kTrial;
  } else if (state.other_verdict == SlotVerdict::kReady) {
    state.phase = protocol::UpdatePhase::kReady;
    state.received = theirs.header.body_bytes;
  } else if (state.other_verdict == SlotVerdict::kReceiving) {
    state.phase = protocol::UpdatePhase::kReceiving;
  }
  state_ = state;
}

}  // namespace scatter::firmware
