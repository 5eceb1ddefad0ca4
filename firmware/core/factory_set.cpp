#include "firmware/core/factory_set.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <new>

#include "protocol/codec.h"
#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::firmware {
namespace {

using protocol::crc32c;
using protocol::load_le;
using protocol::StatusCode;
using protocol::store_le;
using Bytes = std::span<const std::byte>;

constexpr std::uint32_t kSetMagic = 0x5346534F;     // "OSFS"
constexpr std::uint32_t kCommitMagic = 0x4346534F;  // "OSFC"
constexpr std::uint16_t kSetVersion = 1;
constexpr std::size_t kStep = 64;
constexpr std::size_t kObjects = 3;
constexpr std::byte kErased{0xFF};

constexpr std::size_t stepped(std::size_t size) noexcept {
  return (size + kStep - 1) / kStep * kStep;
}

bool erased(Bytes bytes) noexcept {
  return std::ranges::all_of(bytes, [](std::byte b) { return b == kErased; });
}

std::array<Bytes, kObjects> listed(const FactoryObjects& objects) noexcept {
  return {objects.descriptor, objects.hot_pixels, objects.prnu_map};
}

FactorySet bad(FactoryVerdict verdict, std::string_view why) noexcept {
  return {.verdict = verdict, .why = why, .objects = {}};
}

/// Everything but the meaning of the objects; `size` becomes the set's length when it is whole.
FactorySet take_apart(Bytes memory, std::size_t& size) noexcept {
  if (memory.size() < kStep) {
    return bad(FactoryVerdict::kDamaged, "the factory memory is shorter than a factory set's header");
  }
  const Bytes header = memory.first(kStep);
  if (erased(header)) {
    return bad(FactoryVerdict::kAbsent, "no factory set: the memory is erased");
  }
  if (load_le<std::uint32_t>(header.data()) != kSetMagic ||
      load_le<std::uint32_t>(header.data() + kStep - 4) != crc32c(header.first(kStep - 4))) {
    return bad(FactoryVerdict::kDamaged, "the factory set's header is damaged");
  }
  if (load_le<std::uint16_t>(header.data() + 4) != kSetVersion) {
    return bad(FactoryVerdict::kLaterVersion, "the factory set was written for a later firmware");
  }
  std::array<Bytes, kObjects> objects{};
  std::size_t at = kStep;
  for (std::size_t i = 0; i < kObjects; ++i) {
    const std::size_t length = load_le<std::uint32_t>(header.data() + 8 + 8 * i);
    if (length > memory.size() - at || stepped(length) > memory.size() - at) {
      return bad(FactoryVerdict::kDamaged, "the factory set is longer than its memory");
    }
    objects[i] = memory.subspan(at, length);
    at += stepped(length);
  }
  if (memory.size() - at < kStep) {
    return bad(FactoryVerdict::kDamaged, "the factory set is longer than its memory");
  }
  const Bytes commit = memory.subspan(at, kStep);
  if (erased(commit)) {
    return bad(FactoryVerdict::kUnfinished, "the factory set was begun and not committed");
  }
  if (load_le<std::uint32_t>(commit.data()) != kCommitMagic ||
      load_le<std::uint32_t>(commit.data() + 4) != crc32c(memory.first(at)) || !erased(commit.subspan(8))) {
    return bad(FactoryVerdict::kDamaged, "the factory set does not match its commit granule");
  }
  for (std::size_t i = 0; i < kObjects; ++i) {
    if (crc32c(objects[i]) != load_le<std::uint32_t>(header.data() + 12 + 8 * i)) {
      return bad(FactoryVerdict::kDamaged, "an object of the factory set is damaged");
    }
  }
  size = at + kStep;
  return {.verdict = FactoryVerdict::kWhole,
          .why = {},
          .objects = {.descriptor = objects[0], .hot_pixels = objects[1], .prnu_map = objects[2]}};
}

/// "" or what contradicts the descriptor.
std::string_view contradiction(const FactoryObjects& objects,
                               const protocol::Descriptor& descriptor) noexcept {
  const std::uint64_t pixels = std::uint64_t{descriptor.sensor.width_px} * descriptor.sensor.height_px;
  if (pixels == 0) {
    return "the factory descriptor names a sensor without pixels";
  }
  if (descriptor.product.empty() || descriptor.serial.empty()) {
    return "the factory descriptor names no product or no serial number";
  }
  if (objects.hot_pixels.size() % 4 != 0) {
    return "the factory set's list of hot pixels ends inside an entry";
  }
  std::uint64_t lowest = 0;
  for (std::size_t at = 0; at < objects.hot_pixels.size(); at += 4) {
    const std::uint64_t pixel = load_le<std::uint32_t>(objects.hot_pixels.data() + at);
    if (pixel < lowest || pixel >= pixels) {
      return "the factory set's hot pixels are not ascending within the sensor";
    }
    lowest = pixel + 1;
  }
  if (!objects.prnu_map.empty() && objects.prnu_map.size() != pixels) {
    return "the factory set's PRNU map has another size than the sensor";
  }
  return {};
}

/// Programs bytes [from, to) of the set and reads them back.
bool program_range(Flash& flash, Bytes set, std::size_t from, std::size_t to) noexcept {
  if (!flash.program(static_cast<std::uint32_t>(from), set.subspan(from, to - from))) {
    return false;
  }
  std::array<std::byte, 256> back;
  for (std::size_t at = from; at < to; at += back.size()) {
    const std::span<std::byte> piece = std::span(back).first(std::min(back.size(), to - at));
    if (!flash.read(static_cast<std::uint32_t>(at), piece) ||
        std::memcmp(piece.data(), set.data() + at, piece.size()) != 0) {
      return false;
    }
  }
  return true;
}

}  // namespace

FactorySet read_factory_set(Bytes memory, protocol::Descriptor& descriptor) noexcept {
  std::size_t size = 0;
  FactorySet set = take_apart(memory, size);
  if (set.verdict != FactoryVerdict::kWhole) {
    return set;
  }
  ::new (&descriptor)
      protocol::Descriptor();  // In place: an assignment would make a second one on the stack.
  if (!protocol::decode_into(set.objects.descriptor, descriptor)) {
    return bad(FactoryVerdict::kDamaged, "the factory descriptor ends inside a field or a list is too long");
  }
  if (const std::string_view why = contradiction(set.objects, descriptor); !why.empty()) {
    return bad(FactoryVerdict::kDamaged, why);
  }
  return set;
}

std::size_t factory_set_bytes(const FactoryObjects& objects) noexcept {
  std::size_t size = 2 * kStep;
  for (const Bytes object : listed(objects)) {
    size += stepped(object.size());
  }
  return size;
}

std::size_t compose_factory_set(const FactoryObjects& objects, std::span<std::byte> out) noexcept {
  const std::size_t size = factory_set_bytes(objects);
  if (out.size() < size) {
    return 0;
  }
  std::ranges::fill(out.first(kStep), std::byte{0});
  std::ranges::fill(out.subspan(kStep, size - kStep), kErased);
  store_le(out.data(), kSetMagic);
  store_le(out.data() + 4, kSetVersion);
  std::size_t at = kStep;
  std::size_t entry = 8;
  for (const Bytes object : listed(objects)) {
    store_le(out.data() + entry, static_cast<std::uint32_t>(object.size()));
    store_le(out.data() + entry + 4, crc32c(object));
    std::ranges::copy(object, out.subspan(at).begin());
    entry += 8;
    at += stepped(object.size());
  }
  store_le(out.data() + kStep - 4, crc32c(out.first(kStep - 4)));
  store_le(out.data() + at, kCommitMagic);
  store_le(out.data() + at + 4, crc32c(out.first(at)));
  return size;
}

StatusCode write_factory_set(Flash& flash, Bytes set) noexcept {
  std::size_t size = 0;
  const Flash::Geometry geometry = flash.geometry();
  if (take_apart(set, size).verdict != FactoryVerdict::kWhole || geometry.program_bytes == 0 ||
      kStep % geometry.program_bytes != 0) {
    return StatusCode::kInvalidArgument;
  }
  if (size > std::uint64_t{geometry.unit_bytes} * geometry.units) {
    return StatusCode::kOutOfRange;
  }
  std::array<std::byte, kStep> there;
  for (std::size_t at = 0; at < size; at += kStep) {
    if (!flash.read(static_cast<std::uint32_t>(at), there) || !erased(there)) {
      return StatusCode::kFailedPrecondition;
    }
  }
  const bool written =
      program_range(flash, set, 0, size - kStep) && program_range(flash, set, size - kStep, size);
  return written ? StatusCode::kOk : StatusCode::kDataLoss;
}

}  // namespace scatter::firmware
