#include "firmware/image/marks.h"

#include <algorithm>
#include <array>
#include <span>

#include "firmware/image/slot_layout.h"
#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::firmware {
namespace {

constexpr std::uint32_t kMarkMagic = 0x4B4D534F;  // "OSMK"
constexpr std::byte kErasedByte{0xFF};
constexpr std::size_t kLongestPlace = 64;
constexpr std::uint8_t kCopies = 2;

using Place = std::array<std::byte, kLongestPlace>;

enum class Content : std::uint8_t { kErased, kMark, kDamaged };

struct Found {
  Content content = Content::kDamaged;
  MarkKind kind = MarkKind::kNone;
  std::uint32_t number = 0;
};

void encode_mark(MarkKind kind, std::uint32_t number, Place& place) noexcept {
  place.fill(kErasedByte);
  protocol::store_le(place.data(), kMarkMagic);
  protocol::store_le(place.data() + 4, static_cast<std::uint32_t>(kind));
  protocol::store_le(place.data() + 8, number);
  protocol::store_le(place.data() + 12, protocol::crc32c(std::span<const std::byte>(place).first(12)));
}

Found read_place(Flash& slot, const SlotLayout& layout, std::uint32_t index) noexcept {
  Place place;
  const std::span<std::byte> bytes = std::span(place).first(layout.place_bytes);
  Found found;
  if (!slot.read(layout.marks_offset + index * layout.place_bytes, bytes)) {
    return found;
  }
  if (std::ranges::all_of(bytes, [](std::byte b) { return b == kErasedByte; })) {
    found.content = Content::kErased;
    return found;
  }
  const auto kind = protocol::load_le<std::uint32_t>(place.data() + 4);
  if (protocol::load_le<std::uint32_t>(place.data()) == kMarkMagic &&
      kind >= static_cast<std::uint32_t>(MarkKind::kReady) &&
      kind <= static_cast<std::uint32_t>(MarkKind::kReverted) &&
      protocol::load_le<std::uint32_t>(place.data() + 12) ==
          protocol::crc32c(std::span<const std::byte>(place).first(12))) {
    found.content = Content::kMark;
    found.kind = static_cast<MarkKind>(kind);
    found.number = protocol::load_le<std::uint32_t>(place.data() + 8);
  }
  return found;
}

/// The first place behind everything that was ever written; kMarkPlaces: none is left.
std::uint32_t free_place(Flash& slot, const SlotLayout& layout) noexcept {
  std::uint32_t place = kMarkPlaces;
  while (place > 0 && read_place(slot, layout, place - 1).content == Content::kErased) {
    --place;
  }
  return place;
}

std::uint8_t write_copies(Flash& slot, MarkKind kind, std::uint32_t number, std::uint8_t wanted) noexcept {
  const SlotLayout layout = layout_of(slot);
  std::uint8_t good = 0;
  if (!layout.usable) {
    return good;
  }
  Place bytes;
  encode_mark(kind, number, bytes);
  for (std::uint32_t place = free_place(slot, layout); place < kMarkPlaces && good < wanted; ++place) {
    const bool taken = slot.program(layout.marks_offset + place * layout.place_bytes,
                                    std::span<const std::byte>(bytes).first(layout.place_bytes));
    const Found found = read_place(slot, layout, place);
    if (taken && found.content == Content::kMark && found.kind == kind && found.number == number) {
      ++good;
    }
  }
  return good;
}

}  // namespace

Marks read_marks(Flash& slot) noexcept {
  const SlotLayout layout = layout_of(slot);
  Marks marks;
  for (std::uint32_t place = 0; layout.usable && place < kMarkPlaces; ++place) {
    const Found found = read_place(slot, layout, place);
    marks.any = marks.any || found.content != Content::kErased;
    if (found.content != Content::kMark) {
      continue;
    }
    const bool again = found.kind == marks.last && found.number == marks.number;
    marks.copies = static_cast<std::uint8_t>(again ? std::min<int>(marks.copies + 1, kCopies) : 1);
    marks.last = found.kind;
    marks.number = found.number;
  }
  return marks;
}

bool write_mark(Flash& slot, MarkKind kind, std::uint32_t number) noexcept {
  return write_copies(slot, kind, number, kCopies) > 0;
}

bool repair_marks(Flash& slot, Marks& marks) noexcept {
  if (marks.last == MarkKind::kNone || marks.copies >= kCopies) {
    return true;
  }
  const auto missing = static_cast<std::uint8_t>(kCopies - marks.copies);
  marks.copies =
      static_cast<std::uint8_t>(marks.copies + write_copies(slot, marks.last, marks.number, missing));
  return marks.copies >= kCopies;
}

}  // namespace scatter::firmware
