#include "firmware/core/record_store.h"

#include <algorithm>

#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::firmware {
namespace {

using protocol::crc32c;
using protocol::load_le;
using protocol::store_le;

constexpr std::uint32_t kRecordMagic = 0x4352534F;  // "OSRC"
constexpr std::uint16_t kFormatVersion = 1;
constexpr std::byte kErased{0xFF};
// The first record of a power-on leaves this gap above everything found: more changes than one power-on can
// try and fail to write.
constexpr std::uint64_t kSessionGap = 1U << 20U;
// Above it no firmware has counted; a header that says so is no record.
constexpr std::uint64_t kLastNumber = std::uint64_t{1} << 62U;
// Places tried per copy and change before the copy is given up.
constexpr int kTries = 6;
// Failures in a group after which it is left.
constexpr int kFailuresPerGroup = 2;

}  // namespace

std::uint32_t RecordStore::aligned(std::size_t size) const noexcept {
  const std::uint32_t granule = geometry_.program_bytes;
  return (static_cast<std::uint32_t>(size) + granule - 1) / granule * granule;
}

std::uint32_t RecordStore::offset_of(std::size_t bank, std::uint32_t place) const noexcept {
  const std::uint32_t group = place / places_per_group_;
  const std::uint32_t first_unit =
      static_cast<std::uint32_t>(bank) * (geometry_.units / 2) + group * units_per_group_;
  return first_unit * geometry_.unit_bytes + place % places_per_group_ * place_bytes_;
}

bool RecordStore::lay_out() noexcept {
  geometry_ = flash_.geometry();
  groups_ = 0;
  const Flash::Geometry& g = geometry_;
  if (g.program_bytes == 0 || g.program_bytes > kMaxGranule || g.unit_bytes == 0 ||
      g.unit_bytes % g.program_bytes != 0 || g.units > 0xFFFF'FFFF / g.unit_bytes) {
    return false;
  }
  place_bytes_ = aligned(kHeaderBytes + kMaxPayload) + aligned(kCommitBytes);
  units_per_group_ = (place_bytes_ + g.unit_bytes - 1) / g.unit_bytes;
  places_per_group_ = units_per_group_ * g.unit_bytes / place_bytes_;
  const std::uint32_t groups = g.units / 2 / units_per_group_;
  if (groups < 2) {
    return false;
  }
  groups_ = groups;
  return true;
}

RecordStore::Header RecordStore::header_at(std::size_t bank, std::uint32_t place) noexcept {
  std::array<std::byte, kHeaderBytes> bytes;
  Header header;
  header.kind = Header::Kind::kDamaged;
  if (!flash_.read(offset_of(bank, place), bytes)) {
    return header;
  }
  if (std::ranges::all_of(bytes, [](std::byte b) { return b == kErased; })) {
    header.kind = Header::Kind::kErased;
    return header;
  }
  const std::span<const std::byte> view(bytes);
  header.number = load_le<std::uint64_t>(bytes.data() + 8);
  header.length = load_le<std::uint32_t>(bytes.data() + 16);
  const auto version = load_le<std::uint16_t>(bytes.data() + 4);
  if (load_le<std::uint32_t>(bytes.data()) != kRecordMagic ||
      load_le<std::uint32_t>(bytes.data() + 20) != crc32c(view.first(20))) {
    return header;
  }
  if (version > kFormatVersion) {
    header.kind = Header::Kind::kLaterVersion;
  } else if (version == kFormatVersion && header.length <= kMaxPayload && header.number != 0 &&
             header.number < kLastNumber) {
    header.kind = Header::Kind::kRecord;
  }
  return header;
}

bool RecordStore::load(std::size_t bank, std::uint32_t place, std::uint32_t& length) noexcept {
  const Header header = header_at(bank, place);
  if (header.kind != Header::Kind::kRecord) {
    return false;
  }
  const std::uint32_t body = aligned(kHeaderBytes + header.length);
  const std::span<std::byte> bytes = std::span(staging_).first(body + kCommitBytes);
  if (!flash_.read(offset_of(bank, place), bytes)) {
    return false;
  }
  const std::byte* const commit = bytes.data() + body;
  const std::uint32_t crc = crc32c(bytes.first(body));
  length = header.length;
  return load_le<std::uint32_t>(commit) == crc &&
         load_le<std::uint32_t>(commit + 4) == crc32c(bytes.subspan(body, 4), crc32c(bytes.subspan(8, 8)));
}

bool RecordStore::find_newest(std::size_t bank, std::uint64_t& highest) noexcept {
  Bank& b = banks_[bank];
  b = {};
  const std::uint32_t places = groups_ * places_per_group_;
  // From the highest number down to the first record that is whole.
  for (std::uint64_t below = kLastNumber;;) {
    std::uint32_t candidate = kNone;
    std::uint64_t number = 0;
    for (std::uint32_t place = 0; place < places; ++place) {
      const Header header = header_at(bank, place);
      if (header.kind == Header::Kind::kLaterVersion) {
        return false;
      }
      if (header.kind == Header::Kind::kRecord && header.number < below && header.number > number) {
        candidate = place;
        number = header.number;
      }
    }
    highest = std::max(highest, number);
    std::uint32_t length = 0;
    if (candidate == kNone) {
      return true;
    }
    if (load(bank, candidate, length)) {
      b.newest = candidate;
      b.number = number;
      return true;
    }
    below = number;
  }
}

std::uint32_t RecordStore::damaged_after(std::size_t bank) noexcept {
  const Bank& b = banks_[bank];
  const std::uint32_t places = groups_ * places_per_group_;
  // A cut leaves its traces in the places that come next; a lost bank has them anywhere.
  std::uint32_t first = 0;
  std::uint32_t count = places;
  if (b.newest != kNone) {
    first = b.newest + 1;
    count = places_per_group_ - b.newest % places_per_group_;
  }
  std::uint32_t damaged = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Header header = header_at(bank, (first + i) % places);
    const bool interrupted = header.kind == Header::Kind::kRecord && header.number > b.number;
    damaged += header.kind == Header::Kind::kDamaged || interrupted ? 1U : 0U;
  }
  return damaged;
}

bool RecordStore::mount(std::size_t& length) noexcept {
  length = 0;
  report_ = {};
  number_ = 0;
  if (!lay_out()) {
    return false;
  }
  std::uint64_t highest = 0;
  for (std::size_t bank = 0; bank < banks_.size(); ++bank) {
    if (!find_newest(bank, highest)) {
      groups_ = 0;
      report_.condition = StoreReport::Condition::kLaterVersion;
      return false;
    }
  }
  number_ = highest + kSessionGap;
  // Of equal ones the second: it was written when the first was already whole.
  const std::size_t from = banks_[0].number > banks_[1].number ? 0 : 1;
  const bool found = banks_[from].newest != kNone;
  for (std::size_t bank = 0; bank < banks_.size(); ++bank) {
    Bank& b = banks_[bank];
    report_.damaged += damaged_after(bank);
    if (found && b.number < banks_[from].number) {
      report_.copy_mended = static_cast<std::uint8_t>(bank + 1);
    } else if (found) {
      ++report_.whole_copies;
    }
    b.next = b.newest == kNone ? 0 : b.newest;
    if (b.newest != kNone) {
      take_next_group(b);
    }
  }
  if (found) {
    std::uint32_t there = 0;
    // It was whole a moment ago; a read that fails now is no reason to go on with something older.
    if (!load(from, banks_[from].newest, there)) {
      groups_ = 0;
      return false;
    }
    report_.copy_used = static_cast<std::uint8_t>(from + 1);
    length = there;
  }
  const bool recovered = report_.damaged > 0 || report_.copy_mended != 0;
  report_.condition = recovered ? StoreReport::Condition::kRecovered : StoreReport::Condition::kWhole;
  return true;
}

void RecordStore::take_next_group(Bank& bank) const noexcept {
  bank.next = (bank.next / places_per_group_ + 1) % groups_ * places_per_group_;
  bank.erased = kNone;
}

bool RecordStore::erase_group(std::size_t bank, std::uint32_t group) noexcept {
  const std::uint32_t first =
      static_cast<std::uint32_t>(bank) * (geometry_.units / 2) + group * units_per_group_;
  for (std::uint32_t unit = first; unit < first + units_per_group_; ++unit) {
    if (!flash_.erase(unit)) {
      return false;
    }
  }
  return true;
}

bool RecordStore::reads_back(std::uint32_t offset, std::uint32_t length) noexcept {
  std::array<std::byte, 128> back;
  for (std::uint32_t at = 0; at < length;) {
    const std::span<std::byte> piece = std::span(back).first(std::min<std::size_t>(back.size(), length - at));
    if (!flash_.read(offset + at, piece) ||
        !std::ranges::equal(piece, std::span(staging_).subspan(at, piece.size()))) {
      return false;
    }
    at += static_cast<std::uint32_t>(piece.size());
  }
  return true;
}

bool RecordStore::write_place(std::size_t bank, std::uint32_t body, std::uint32_t total) noexcept {
  const std::uint32_t offset = offset_of(bank, banks_[bank].next);
  const std::span<const std::byte> bytes(staging_);
  return flash_.program(offset, bytes.first(body)) && reads_back(offset, body) &&
         flash_.program(offset + body, bytes.subspan(body, total - body)) && reads_back(offset, total);
}

bool RecordStore::write_copy(std::size_t bank, std::uint32_t body, std::uint32_t total) noexcept {
  Bank& b = banks_[bank];
  const Bank& other = banks_[1 - bank];
  int failures_here = 0;
  for (int tries = 0; tries < kTries; ++tries) {
    const std::uint32_t group = b.next / places_per_group_;
    if (group != b.erased) {
      failures_here = 0;
      if (b.newest != kNone && b.newest / places_per_group_ == group) {
        if (other.number < b.number) {
          take_next_group(b);  // The newest record stands here alone: not to be erased.
          continue;
        }
        b.newest = kNone;
        b.number = 0;
      }
      if (!erase_group(bank, group)) {
        ++report_.bad_places;
        take_next_group(b);
        continue;
      }
      b.erased = group;
    }
    if (write_place(bank, body, total)) {
      b.newest = b.next;
      b.number = number_;
      b.next = (b.next + 1) % (groups_ * places_per_group_);
      return true;
    }
    ++report_.bad_places;
    if (++failures_here == kFailuresPerGroup) {
      take_next_group(b);
    } else {
      b.next = (b.next + 1) % (groups_ * places_per_group_);
    }
  }
  return false;
}

bool RecordStore::write(std::size_t length) noexcept {
  if (groups_ == 0 || length > kMaxPayload) {
    return false;
  }
  ++number_;
  const std::uint32_t body = aligned(kHeaderBytes + length);
  const std::uint32_t total = body + aligned(kCommitBytes);
  const std::span<std::byte> bytes(staging_);
  store_le(bytes.data(), kRecordMagic);
  store_le(bytes.data() + 4, kFormatVersion);
  store_le(bytes.data() + 6, static_cast<std::uint16_t>(kHeaderBytes));
  store_le(bytes.data() + 8, number_);
  store_le(bytes.data() + 16, static_cast<std::uint32_t>(length));
  store_le(bytes.data() + 20, crc32c(bytes.first(20)));
  std::ranges::fill(bytes.subspan(kHeaderBytes + length), kErased);
  const std::uint32_t crc = crc32c(bytes.first(body));
  store_le(bytes.data() + body, crc);
  store_le(bytes.data() + body + 4, crc32c(bytes.subspan(body, 4), crc32c(bytes.subspan(8, 8))));

  const std::size_t first = banks_[1].number < banks_[0].number ? 1 : 0;
  const bool first_done = write_copy(first, body, total);
  const bool second_done = write_copy(1 - first, body, total);
  report_.whole_copies = static_cast<std::uint8_t>((first_done ? 1U : 0U) + (second_done ? 1U : 0U));
  return first_done || second_done;
}

}  // namespace scatter::firmware
