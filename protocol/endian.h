// Little-endian loads and stores: the byte order of everything on the wire.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace scatter::protocol {

namespace endian_detail {
template <std::size_t N>
struct Bits;
template <>
struct Bits<1> {
  using Type = std::uint8_t;
};
template <>
struct Bits<2> {
  using Type = std::uint16_t;
};
template <>
struct Bits<4> {
  using Type = std::uint32_t;
};
template <>
struct Bits<8> {
  using Type = std::uint64_t;
};
}  // namespace endian_detail

/// An integer, enum or IEEE 754 float: what store_le and load_le move.
template <typename T>
concept Scalar = (std::is_arithmetic_v<T> || std::is_enum_v<T>) && !std::is_same_v<T, bool>;

/// Writes sizeof(T) bytes at `at`, which need not be aligned.
template <Scalar T>
constexpr void store_le(std::byte* at, T value) noexcept {
  using U = typename endian_detail::Bits<sizeof(T)>::Type;
  const U bits = std::bit_cast<U>(value);
  if (std::is_constant_evaluated() || std::endian::native != std::endian::little) {
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      at[i] = static_cast<std::byte>(bits >> (8 * i));
    }
  } else {
    std::memcpy(at, &bits, sizeof(T));
  }
}

/// Reads sizeof(T) bytes at `at`, which need not be aligned.
template <Scalar T>
[[nodiscard]] constexpr T load_le(const std::byte* at) noexcept {
  using U = typename endian_detail::Bits<sizeof(T)>::Type;
  U bits = 0;
  if (std::is_constant_evaluated() || std::endian::native != std::endian::little) {
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bits = static_cast<U>(bits | static_cast<U>(static_cast<U>(at[i]) << (8 * i)));
    }
  } else {
    std::memcpy(&bits, at, sizeof(T));
  }
  return std::bit_cast<T>(bits);
}

}  // namespace scatter::protocol
