// The factory set: what production writes once into an instrument and nobody changes afterwards.
//
//   offset size
//        0    4 magic "OSFS"
//        4    2 format version 1
//        6    2 zero
//        8    4 bytes of the descriptor            12    4 their CRC-32C
//       16    4 bytes of the hot pixels            20    4 their CRC-32C
//       24    4 bytes of the PRNU map              28    4 their CRC-32C
//       32   28 zero
//       60    4 CRC-32C of bytes 0..59
//       64      descriptor, encoded like a message (protocol/descriptor.h)
//               hot pixels: u32 each, y * width + x, ascending, each once
//               PRNU map: i8 per pixel, row major; or nothing
//               each of the three begins at a multiple of 64; 0xFF between them
//     last   64 commit granule: 4 bytes "OSFC", 4 bytes CRC-32C of everything before it, then 0xFF
// All little endian. A set is whole if and only if every checksum is right, its commit granule too; that
// granule is programmed last.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/ports/ports.h"
#include "protocol/descriptor.h"
#include "protocol/status.h"

namespace scatter::firmware {

/// The three objects of a set. Memory of the caller's.
struct FactoryObjects {
  std::span<const std::byte> descriptor{};  ///< Encoded.
  std::span<const std::byte> hot_pixels{};
  std::span<const std::byte> prnu_map{};
};

enum class FactoryVerdict : std::uint8_t {
  kWhole,
  kAbsent,        ///< Erased memory: production has not been here.
  kUnfinished,    ///< Begun and not committed.
  kDamaged,       ///< A checksum is wrong, or the contents contradict each other.
  kLaterVersion,  ///< Written for a later firmware.
};

/// What lies in the memory; the spans are views into it and empty unless the verdict is kWhole.
struct FactorySet {
  FactoryVerdict verdict = FactoryVerdict::kAbsent;
  std::string_view why{};  ///< What is wrong, for people; "" when whole.
  FactoryObjects objects{};
};

/// Reads the set that begins at the start of `memory` (memory-mapped flash; longer than the set is fine)
/// and decodes its descriptor. Trusts no length. `descriptor` holds the set's when the verdict is kWhole,
/// else anything.
/// Cost      one CRC over the set (about 0.4 MB for a full-size PRNU map); no RAM.
[[nodiscard]] FactorySet read_factory_set(std::span<const std::byte> memory,
                                          protocol::Descriptor& descriptor) noexcept;

/// Bytes of the set with these objects.
[[nodiscard]] std::size_t factory_set_bytes(const FactoryObjects& objects) noexcept;
/// Makes the set at the start of `out`; the number of bytes. 0: `out` is shorter than factory_set_bytes().
/// Does not judge the contents: read_factory_set on the result does. For production and for simulators.
[[nodiscard]] std::size_t compose_factory_set(const FactoryObjects& objects,
                                              std::span<std::byte> out) noexcept;

/// Programs a composed set at the start of a flash, its commit granule last, and reads it back.
/// Errors    kInvalidArgument: `set` is not whole, or its 64-byte steps are no multiple of the program
///           granule; kOutOfRange: longer than the flash; kFailedPrecondition: the flash is not erased
///           there (write-once: nothing was touched); kDataLoss: the flash refused or reads back otherwise.
/// Cost      blocks for the whole write; 256 bytes of stack. For production only.
[[nodiscard]] protocol::StatusCode write_factory_set(Flash& flash, std::span<const std::byte> set) noexcept;

}  // namespace scatter::firmware
