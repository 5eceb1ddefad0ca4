#include "firmware/core/flash_log.h"

#include <algorithm>
#include <array>

#include "protocol/crc.h"
#include "protocol/endian.h"
#include "protocol/session.h"

namespace scatter::firmware {
namespace {

constexpr std::uint32_t kLogMagic = 0x474C534F;  // "OSLG"
constexpr std::uint32_t kLogVersion = 1;
constexpr std::size_t kHalfHeader = 16;
constexpr std::size_t kRecordHeader = 8;
constexpr std::size_t kRecordTrailer = 4;
constexpr std::size_t kStaging =
    kRecordHeader + FlashLog::kMaxPayload + kRecordTrailer + FlashLog::kMaxGranule;
constexpr std::byte kErased{0xFF};

}  // namespace

std::uint32_t FlashLog::aligned(std::size_t size) const noexcept {
  const std::uint32_t granule = geometry_.program_bytes;
  return (static_cast<std::uint32_t>(size) + granule - 1) / granule * granule;
}

bool FlashLog::read_generation(std::uint32_t half, std::uint32_t& generation) noexcept {
  std::array<std::byte, kHalfHeader> header{};
  if (!flash_.read(base(half), header) || protocol::load_le<std::uint32_t>(header.data()) != kLogMagic ||
      protocol::load_le<std::uint32_t>(header.data() + 8) != kLogVersion ||
      protocol::load_le<std::uint32_t>(header.data() + 12) !=
          protocol::crc32c(std::span<const std::byte>(header).first(12))) {
    return false;
  }
  generation = protocol::load_le<std::uint32_t>(header.data() + 4);
  return true;
}

bool FlashLog::mount(Reader& reader) noexcept {
  geometry_ = flash_.geometry();
  const bool usable = geometry_.units >= 2 && geometry_.program_bytes >= 1 &&
                      geometry_.program_bytes <= kMaxGranule && geometry_.unit_bytes >= 2 * kStaging &&
                      geometry_.unit_bytes % geometry_.program_bytes == 0;
  half_bytes_ = usable ? geometry_.units / 2 * geometry_.unit_bytes : 0;
  recovered_ = 0;
  if (!usable) {
    return false;
  }
  std::array<std::uint32_t, 2> generation{};
  const bool first = read_generation(0, generation[0]);
  const bool second = read_generation(1, generation[1]);
  if (!first && !second) {
    half_ = 0;
    generation_ = 1;
    next_ = aligned(kHalfHeader);
    if (!erase_half(0) || !write_header(0, generation_)) {
      half_bytes_ = 0;
      return false;
    }
    return true;
  }
  half_ = !first || (second && protocol::comes_before(generation[0], generation[1])) ? 1 : 0;
  generation_ = generation[half_];
  scan(reader);
  return true;
}

std::uint32_t FlashLog::end_of_data(std::uint32_t half) noexcept {
  std::array<std::byte, 128> block{};
  for (std::uint32_t end = half_bytes_; end > 0;) {
    const std::uint32_t size = std::min<std::uint32_t>(end, block.size());
    const std::span<std::byte> bytes(block.data(), size);
    if (!flash_.read(base(half) + end - size, bytes)) {
      return end;  // Cells that cannot be read are not free either.
    }
    for (std::uint32_t used = size; used > 0; --used) {
      if (bytes[used - 1] != kErased) {
        return end - size + used;
      }
    }
    end -= size;
  }
  return 0;
}

std::size_t FlashLog::read_record(std::uint32_t offset, std::span<std::byte> buffer) noexcept {
  const std::span<std::byte> header = buffer.first(kRecordHeader);
  if (offset + kRecordHeader > half_bytes_ || !flash_.read(base(half_) + offset, header) ||
      protocol::load_le<std::uint32_t>(header.data() + 4) != protocol::crc32c(header.first(4))) {
    return 0;
  }
  const std::size_t length = protocol::load_le<std::uint16_t>(header.data() + 2);
  const std::size_t total = kRecordHeader + length + kRecordTrailer;
  if (length > kMaxPayload || offset + total > half_bytes_ ||
      !flash_.read(base(half_) + offset, buffer.first(total))) {
    return 0;
  }
  const std::span<const std::byte> covered = buffer.first(total - kRecordTrailer);
  const auto crc = protocol::load_le<std::uint32_t>(buffer.data() + covered.size());
  return crc == protocol::crc32c(covered) ? total : 0;
}

void FlashLog::scan(Reader& reader) noexcept {
  const std::uint32_t end = end_of_data(half_);
  std::array<std::byte, kStaging> buffer{};
  bool in_gap = false;
  std::uint32_t offset = aligned(kHalfHeader);
  while (offset < end) {
    const std::size_t total = read_record(offset, buffer);
    if (total == 0) {
      recovered_ += in_gap ? 0U : 1U;
      in_gap = true;
      offset += geometry_.program_bytes;
      continue;
    }
    in_gap = false;
    const std::span<const std::byte> record = std::span(buffer).first(total);
    reader.record(protocol::load_le<std::uint16_t>(record.data()),
                  record.subspan(kRecordHeader, total - kRecordHeader - kRecordTrailer));
    offset += aligned(total);
  }
  next_ = offset;
}

bool FlashLog::erase_half(std::uint32_t half) noexcept {
  const std::uint32_t units = geometry_.units / 2;
  for (std::uint32_t unit = 0; unit < units; ++unit) {
    if (!flash_.erase(half * units + unit)) {
      return false;
    }
  }
  return true;
}

bool FlashLog::write_header(std::uint32_t half, std::uint32_t generation) noexcept {
  std::array<std::byte, kHalfHeader + kMaxGranule> bytes;
  bytes.fill(kErased);
  protocol::store_le(bytes.data(), kLogMagic);
  protocol::store_le(bytes.data() + 4, generation);
  protocol::store_le(bytes.data() + 8, kLogVersion);
  protocol::store_le(bytes.data() + 12, protocol::crc32c(std::span<const std::byte>(bytes).first(12)));
  return flash_.program(base(half), std::span<const std::byte>(bytes).first(aligned(kHalfHeader)));
}

FlashLog::Append FlashLog::append(std::uint16_t kind, std::span<const std::byte> payload) noexcept {
  if (half_bytes_ == 0 || payload.size() > kMaxPayload) {
    return Append::kFailed;
  }
  const std::size_t total = kRecordHeader + payload.size() + kRecordTrailer;
  if (next_ + aligned(total) > half_bytes_) {
    return Append::kFull;
  }
  std::array<std::byte, kStaging> bytes;
  bytes.fill(kErased);
  protocol::store_le(bytes.data(), kind);
  protocol::store_le(bytes.data() + 2, static_cast<std::uint16_t>(payload.size()));
  const std::span<const std::byte> view(bytes);
  protocol::store_le(bytes.data() + 4, protocol::crc32c(view.first(4)));
  std::ranges::copy(payload, bytes.begin() + kRecordHeader);
  protocol::store_le(bytes.data() + total - kRecordTrailer,
                     protocol::crc32c(view.first(total - kRecordTrailer)));
  const std::uint32_t offset = next_;
  next_ += aligned(total);  // Even a failed write may have changed the cells: never program them again.
  return flash_.program(base(half_) + offset, view.first(aligned(total))) ? Append::kDone : Append::kFailed;
}

bool FlashLog::begin_compaction() noexcept {
  if (half_bytes_ == 0 || !erase_half(1 - half_)) {
    return false;
  }
  half_ = 1 - half_;
  next_ = aligned(kHalfHeader);
  return true;
}

bool FlashLog::finish_compaction() noexcept {
  if (!write_header(half_, generation_ + 1)) {
    return false;
  }
  ++generation_;
  return true;
}

void FlashLog::abandon_compaction() noexcept {
  half_ = 1 - half_;
  next_ = half_bytes_;
}

}  // namespace scatter::firmware
