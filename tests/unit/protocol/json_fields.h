// Messages to and from JSON by their field lists, for the golden vectors.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

#include "protocol/codec.h"
#include "tests/unit/protocol/test_bytes.h"

namespace scatter::protocol::test {

/// Fills `value`; `tails` keeps the bytes that a tail views.
template <typename T>
void from_json(const nlohmann::json& json, T& value, Bytes& tails) {
  if constexpr (std::is_enum_v<T>) {
    value = static_cast<T>(json.get<std::underlying_type_t<T>>());
  } else if constexpr (Scalar<T>) {
    value = json.get<T>();
  } else if constexpr (codec_detail::kIsTail<T>) {
    tails = from_hex(json.get<std::string>());
    value = tails;
  } else if constexpr (codec_detail::kIsRaw<T>) {
    const Bytes bytes = from_hex(json.get<std::string>());
    REQUIRE(bytes.size() == value.size());
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      value[i] = static_cast<std::uint8_t>(bytes[i]);
    }
  } else if constexpr (codec_detail::Bounded<T>) {
    if constexpr (std::is_same_v<codec_detail::Element<T>, char>) {
      const auto text = json.get<std::string>();
      REQUIRE(text.size() <= T::kCapacity);
      value = T(text);
    } else {
      REQUIRE(json.size() <= T::kCapacity);
      value.resize(json.size());
      for (std::size_t i = 0; i < json.size(); ++i) {
        from_json(json[i], value[i], tails);
      }
    }
  } else {
    REQUIRE(json.size() == std::tuple_size_v<std::remove_cvref_t<decltype(kSchema<T>)>>);
    codec_detail::with_rows<T>([&](const auto&... row) {
      (from_json(json.at(std::string(row.name)), value.*(row.member), tails), ...);
    });
  }
}

inline std::string to_hex(const auto& bytes) {
  std::string hex;
  for (const auto b : bytes) {
    hex += "0123456789abcdef"[static_cast<unsigned>(b) >> 4U];
    hex += "0123456789abcdef"[static_cast<unsigned>(b) & 15U];
  }
  return hex;
}

template <typename T>
nlohmann::json to_json(const T& value) {
  if constexpr (std::is_enum_v<T>) {
    return static_cast<std::underlying_type_t<T>>(value);
  } else if constexpr (Scalar<T>) {
    return value;
  } else if constexpr (codec_detail::kIsTail<T> || codec_detail::kIsRaw<T>) {
    return to_hex(value);
  } else if constexpr (codec_detail::Bounded<T>) {
    if constexpr (std::is_same_v<codec_detail::Element<T>, char>) {
      return std::string(value.str());
    } else {
      nlohmann::json list = nlohmann::json::array();
      for (const auto& element : value) {
        list.push_back(to_json(element));
      }
      return list;
    }
  } else {
    nlohmann::json object = nlohmann::json::object();
    codec_detail::with_rows<T>(
        [&](const auto&... row) { ((object[std::string(row.name)] = to_json(value.*(row.member))), ...); });
    return object;
  }
}

}  // namespace scatter::protocol::test
