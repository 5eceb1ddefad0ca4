// One row of a message schema: name, member, unit and meaning. Everything about a message (encode,
// decode, size, bounds, SPEC.md tables, machine-readable description) is derived from its rows.
#pragma once

#include <string_view>
#include <tuple>

namespace scatter::protocol {

/// A message field. `Member` is the pointer to member that the codec reads and writes.
template <typename Message, typename T>
struct Field {
  using Type = T;
  std::string_view name;
  T Message::* member;
  std::string_view unit;     ///< SI symbol with scale ("us", "mK", "1e-6 rad"), "" when none.
  std::string_view meaning;  ///< One phrase for SPEC.md.
};

template <typename Message, typename T>
[[nodiscard]] constexpr Field<Message, T> field(std::string_view name, T Message::* member,
                                                std::string_view unit, std::string_view meaning) {
  return {name, member, unit, meaning};
}

template <typename... Rows>
[[nodiscard]] constexpr std::tuple<Rows...> fields(Rows... rows) {
  return {rows...};
}

}  // namespace scatter::protocol
