#include "firmware/image/slot_view.h"

#include <algorithm>

#include "protocol/codec.h"

namespace scatter::firmware {

using protocol::SlotVerdict;

namespace {

constexpr std::byte kErased{0xFF};

template <std::size_t N>
bool all_zero(const std::array<std::uint8_t, N>& bytes, std::size_t from = 0) noexcept {
  return std::all_of(bytes.begin() + static_cast<std::ptrdiff_t>(from), bytes.end(),
                     [](std::uint8_t b) { return b == 0; });
}

bool well_formed(const protocol::ImageHeader& header) noexcept {
  return header.magic == protocol::kImageMagic && header.header_version == protocol::kImageHeaderVersion &&
         (header.flags & ~protocol::kImageSignedForTest) == 0 && all_zero(header.zero_1) &&
         all_zero(header.zero_2) && all_zero(header.product, text_of(header.product).size()) &&
         all_zero(header.version, text_of(header.version).size());
}

SlotVerdict verdict_of(MarkKind last) noexcept {
  switch (last) {
    case MarkKind::kReady:
      return SlotVerdict::kReady;
    case MarkKind::kTried:
      return SlotVerdict::kTrial;
    case MarkKind::kConfirmed:
      return SlotVerdict::kConfirmed;
    case MarkKind::kReverted:
      return SlotVerdict::kReverted;
    case MarkKind::kNone:
      break;
  }
  return SlotVerdict::kReceiving;
}

}  // namespace

std::string_view text_of(const protocol::ImageText& text) noexcept {
  const auto end = std::ranges::find(text, std::uint8_t{0});
  return {reinterpret_cast<const char*>(text.data()), static_cast<std::size_t>(end - text.begin())};
}

HeaderFault check_header(std::span<const std::byte, protocol::kImageHeaderBytes> bytes,
                         const SlotIdentity& slot, Verifier& verifier,
                         protocol::ImageHeader& header) noexcept {
  header = {};
  if (!protocol::decode_into(bytes, header) || !well_formed(header)) {
    return HeaderFault::kFormat;
  }
  if (text_of(header.product) != slot.product) {
    return HeaderFault::kProduct;
  }
  if (!verifier.verify(bytes.first(protocol::kSignedHeaderBytes), header.signature, header.key_id)) {
    return HeaderFault::kSignature;
  }
  if (header.slot != slot.index) {
    return HeaderFault::kSlot;
  }
  if (header.load_address != slot.address + protocol::kImageBodyOffset) {
    return HeaderFault::kAddress;
  }
  if (header.body_bytes == 0 || header.body_bytes > slot.body_capacity) {
    return HeaderFault::kSize;
  }
  return HeaderFault::kNone;
}

SlotView view_slot(ImageSlots& slots, std::uint8_t index, Verifier& verifier,
                   std::string_view product) noexcept {
  SlotView view;
  Flash& flash = slots.slot(index);
  view.layout = layout_of(flash);
  std::array<std::byte, protocol::kImageHeaderBytes> bytes;
  if (!view.layout.usable || !flash.read(0, bytes)) {
    view.verdict = SlotVerdict::kUnreadable;
    return view;
  }
  if (std::ranges::all_of(bytes, [](std::byte b) { return b == kErased; })) {
    view.verdict = SlotVerdict::kEmpty;
    return view;
  }
  const SlotIdentity identity{.product = product,
                              .index = index,
                              .address = slots.address(index),
                              .body_capacity = view.layout.body_capacity};
  switch (check_header(bytes, identity, verifier, view.header)) {
    case HeaderFault::kNone:
      break;
    case HeaderFault::kProduct:
      view.verdict = SlotVerdict::kWrongProduct;
      return view;
    default:
      view.verdict = SlotVerdict::kBadHeader;
      return view;
  }
  view.header_good = true;
  view.marks = read_marks(flash);
  view.verdict = verdict_of(view.marks.last);
  return view;
}

std::uint32_t lowest_counter(const std::array<SlotView, ImageSlots::kCount>& views) noexcept {
  std::uint32_t lowest = 0;
  for (const SlotView& view : views) {
    if (view.header_good && view.marks.last == MarkKind::kConfirmed) {
      lowest = std::max(lowest, view.header.security_counter);
    }
  }
  return lowest;
}

std::uint32_t next_confirmation(const std::array<SlotView, ImageSlots::kCount>& views) noexcept {
  std::uint32_t highest = 0;
  for (const SlotView& view : views) {
    if (view.header_good && view.marks.last == MarkKind::kConfirmed) {
      highest = std::max(highest, view.marks.number);
    }
  }
  return highest + 1;
}

}  // namespace scatter::firmware
