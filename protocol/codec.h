// Encode, decode and sizes of messages, derived from their schema() and from nothing else.
//
// On the wire: fields in order, little endian, unpadded. A nested struct is its fields; a
// BoundedArray or BoundedString is a u16 count and its elements; std::array<u8, N> is N raw bytes;
// TailBytes is the rest of the payload. No heap, no exceptions; everything can run while compiling.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>

#include "protocol/bounded.h"
#include "protocol/endian.h"
#include "protocol/field.h"

namespace scatter::protocol {

/// Anything with a field list: messages, objects, and the structs nested in them.
template <typename T>
concept Message = requires { T::schema(); };

/// The field list of M, one object per type.
template <Message M>
inline constexpr auto kSchema = M::schema();

namespace codec_detail {

template <typename T>
concept Bounded = requires { T::kCapacity; };

template <Bounded T>
using Element = std::remove_cvref_t<decltype(std::declval<T&>()[0])>;

template <typename T>
inline constexpr bool kIsRaw = false;
template <std::size_t N>
inline constexpr bool kIsRaw<std::array<std::uint8_t, N>> = true;

template <typename T>
inline constexpr bool kIsTail = std::is_same_v<T, TailBytes>;

template <typename Row>
using TypeOf = typename std::remove_cvref_t<Row>::Type;

template <typename T>
struct Traits;

template <typename Rows>
struct RowTraits;

template <typename M, typename... T>
struct RowTraits<std::tuple<Field<M, T>...>> {
  static constexpr std::size_t kMin = (Traits<T>::kMin + ... + 0);
  static constexpr std::size_t kMax = (Traits<T>::kMax + ... + 0);
  static constexpr bool kHasTail = (Traits<T>::kHasTail || ...);
  /// TailBytes stands only at the end, and not inside a nested struct.
  static constexpr bool tail_is_last() noexcept {
    std::size_t index = 0;
    bool good = true;
    ((++index, good = good && (!Traits<T>::kHasTail || (kIsTail<T> && index == sizeof...(T)))), ...);
    return good;
  }
};

template <>
struct RowTraits<std::tuple<>> {
  static constexpr std::size_t kMin = 0;
  static constexpr std::size_t kMax = 0;
  static constexpr bool kHasTail = false;
  static constexpr bool tail_is_last() noexcept { return true; }
};

template <Message M>
using RowsOf = RowTraits<std::remove_cvref_t<decltype(kSchema<M>)>>;

/// Sizes of a field's type; kMax without a tail.
template <typename T>
struct Traits {
  static_assert(Message<T>, "no wire form for this field's type");
  static constexpr std::size_t kMin = RowsOf<T>::kMin;
  static constexpr std::size_t kMax = RowsOf<T>::kMax;
  static constexpr bool kHasTail = RowsOf<T>::kHasTail;
};
template <Scalar T>
struct Traits<T> {
  static constexpr std::size_t kMin = sizeof(T);
  static constexpr std::size_t kMax = sizeof(T);
  static constexpr bool kHasTail = false;
};
template <std::size_t N>
struct Traits<std::array<std::uint8_t, N>> {
  static constexpr std::size_t kMin = N;
  static constexpr std::size_t kMax = N;
  static constexpr bool kHasTail = false;
};
template <Bounded T>
struct Traits<T> {
  static constexpr std::size_t kMin = 2;
  static constexpr std::size_t kMax = 2 + T::kCapacity * Traits<Element<T>>::kMax;
  static constexpr bool kHasTail = Traits<Element<T>>::kHasTail;
};
template <>
struct Traits<TailBytes> {
  static constexpr std::size_t kMin = 0;
  static constexpr std::size_t kMax = 0;
  static constexpr bool kHasTail = true;
};

template <Message M, typename F, std::size_t... I>
constexpr decltype(auto) with_rows(F&& function, std::index_sequence<I...>) {
  return function(std::get<I>(kSchema<M>)...);
}

/// Calls function(row...) with all rows of M.
template <Message M, typename F>
constexpr decltype(auto) with_rows(F&& function) {
  return with_rows<M>(
      function, std::make_index_sequence<std::tuple_size_v<std::remove_cvref_t<decltype(kSchema<M>)>>>{});
}

template <typename T>
constexpr std::size_t size_of(const T& value) noexcept {
  if constexpr (Traits<T>::kMin == Traits<T>::kMax && !Traits<T>::kHasTail) {
    return Traits<T>::kMax;
  } else if constexpr (kIsTail<T>) {
    return value.size();
  } else if constexpr (Bounded<T>) {
    if constexpr (Scalar<Element<T>>) {
      return 2 + value.size() * sizeof(Element<T>);
    } else {
      std::size_t total = 2;
      for (const auto& element : value) {
        total += size_of(element);
      }
      return total;
    }
  } else {
    return with_rows<T>(
        [&value](const auto&... row) { return (size_of(value.*(row.member)) + ... + std::size_t{0}); });
  }
}

/// Writes without checks: the caller has made sure of size_of(value) bytes.
template <typename T>
constexpr void put(std::byte*& at, const T& value) noexcept {
  if constexpr (Scalar<T>) {
    store_le(at, value);
    at += sizeof(T);
  } else if constexpr (kIsRaw<T>) {
    for (const std::uint8_t b : value) {
      *at++ = static_cast<std::byte>(b);
    }
  } else if constexpr (kIsTail<T>) {
    if (std::is_constant_evaluated()) {
      at = std::copy(value.begin(), value.end(), at);
    } else if (!value.empty()) {
      std::memmove(at, value.data(), value.size());  // The bytes may lie in `out` already.
      at += value.size();
    }
  } else if constexpr (Bounded<T>) {
    put(at, static_cast<std::uint16_t>(value.size()));
    for (const auto& element : value) {
      put(at, element);
    }
  } else {
    with_rows<T>([&at, &value](const auto&... row) { (put(at, value.*(row.member)), ...); });
  }
}

struct Reader {
  const std::byte* at;
  std::size_t left;
};

/// `InArray`: elements of arrays are whole; elsewhere the bytes may end before any field.
template <bool InArray, typename T>
constexpr bool get(Reader& in, T& value) noexcept {
  if constexpr (kIsTail<T>) {
    value = {in.at, in.left};
    in.at += in.left;
    in.left = 0;
    return true;
  } else if constexpr (Message<T>) {
    return with_rows<T>(
        [&in, &value](const auto&... row) { return (get<InArray>(in, value.*(row.member)) && ... && true); });
  } else {
    if constexpr (!InArray) {
      if (in.left == 0) {
        return true;  // A field that the sender did not know keeps its default.
      }
    }
    if constexpr (Scalar<T>) {
      if (in.left < sizeof(T)) {
        return false;
      }
      value = load_le<T>(in.at);
      in.at += sizeof(T);
      in.left -= sizeof(T);
      return true;
    } else if constexpr (kIsRaw<T>) {
      if (in.left < value.size()) {
        return false;
      }
      for (std::uint8_t& b : value) {
        b = static_cast<std::uint8_t>(*in.at++);
      }
      in.left -= value.size();
      return true;
    } else {
      static_assert(Bounded<T>, "no wire form for this field's type");
      std::uint16_t count = 0;
      if (!get<true>(in, count) || count > T::kCapacity) {
        return false;
      }
      value.clear();
      value.resize(count);
      for (auto& element : value) {
        if (!get<true>(in, element)) {
          return false;
        }
      }
      return true;
    }
  }
}

}  // namespace codec_detail

/// Bytes of M with every array, text and tail empty. For a message whose only open-ended field is its
/// tail this is the tail's offset, so that tail bytes can be produced in place (see encode).
template <Message M>
[[nodiscard]] constexpr std::size_t min_encoded_size() noexcept {
  return codec_detail::Traits<M>::kMin;
}

/// Bytes of M with every array and text full; a tail, if M has one, comes on top.
template <Message M>
[[nodiscard]] constexpr std::size_t max_encoded_size() noexcept {
  return codec_detail::Traits<M>::kMax;
}

/// True when M ends in TailBytes.
template <Message M>
[[nodiscard]] constexpr bool has_tail() noexcept {
  return codec_detail::Traits<M>::kHasTail;
}

/// Bytes that encode(message, ...) writes.
template <Message M>
[[nodiscard]] constexpr std::size_t encoded_size(const M& message) noexcept {
  return codec_detail::size_of(message);
}

/// Writes the message at the start of `out`; the number of bytes, or nullopt when `out` is too small
/// (nothing is written then). The tail may already lie in `out`: at its own offset it is not copied.
template <Message M>
[[nodiscard]] constexpr std::optional<std::size_t> encode(const M& message,
                                                          std::span<std::byte> out) noexcept {
  static_assert(codec_detail::RowsOf<M>::tail_is_last(), "TailBytes must be the last field");
  const std::size_t size = codec_detail::size_of(message);
  if (size > out.size()) {
    return std::nullopt;
  }
  if constexpr (has_tail<M>()) {
    // The tail first: the head must not overwrite bytes that still have to move.
    codec_detail::with_rows<M>([&message, &out, size](const auto&... row) {
      (
          [&](const auto& one) {
            if constexpr (codec_detail::kIsTail<codec_detail::TypeOf<decltype(one)>>) {
              std::byte* at = out.data() + (size - (message.*(one.member)).size());
              codec_detail::put(at, message.*(one.member));
            }
          }(row),
          ...);
    });
    std::byte* at = out.data();
    codec_detail::with_rows<M>([&message, &at](const auto&... row) {
      (
          [&](const auto& one) {
            if constexpr (!codec_detail::kIsTail<codec_detail::TypeOf<decltype(one)>>) {
              codec_detail::put(at, message.*(one.member));
            }
          }(row),
          ...);
    });
  } else {
    std::byte* at = out.data();
    codec_detail::put(at, message);
  }
  return size;
}

/// Reads a message into `message`, which must hold its defaults (M{}) before. False, with `message`
/// unspecified, when the bytes end inside a field or an array is over its bound. Missing trailing
/// fields keep their defaults, extra trailing bytes are ignored. A tail is a view into `bytes`.
template <Message M>
[[nodiscard]] constexpr bool decode_into(std::span<const std::byte> bytes, M& message) noexcept {
  static_assert(codec_detail::RowsOf<M>::tail_is_last(), "TailBytes must be the last field");
  codec_detail::Reader in{bytes.data(), bytes.size()};
  return codec_detail::get<false>(in, message);
}

/// The message in `bytes`, or nullopt when they are no such message (see decode_into).
template <Message M>
[[nodiscard]] constexpr std::optional<M> decode(std::span<const std::byte> bytes) noexcept {
  std::optional<M> message(std::in_place);
  if (!decode_into(bytes, *message)) {
    message.reset();
  }
  return message;
}

}  // namespace scatter::protocol
