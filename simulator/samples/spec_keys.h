// Reads KEY=VALUE,... behind the name of a sample.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::simulator {

/// Takes the keys of "NAME:KEY=VALUE,KEY=VALUE,..." one by one; what goes wrong first is kept until finish().
/// Values hold no comma. A key that is not given leaves its variable as it is.
class SpecKeys {
 public:
  explicit SpecKeys(std::string_view spec);

  void number(std::string_view key, double low, double high, double& value);
  void whole(std::string_view key, std::uint64_t low, std::uint64_t high, std::uint64_t& value);
  /// "yes" or "no", also 1 or 0.
  void flag(std::string_view key, bool& value);
  /// The index of the value among `names`; '_' and '-' may stand for a space.
  void choice(std::string_view key, std::initializer_list<std::string_view> names, std::size_t& value);
  /// The value's text.
  [[nodiscard]] std::optional<std::string_view> text(std::string_view key);

  /// For values that the reader does not know: says that `key` is `found` when it should be `expected`.
  void reject(std::string_view key, std::string_view expected);
  void reject(Error error);

  /// Errors  kInvalidArgument naming the key, what was found and what was expected; keys given twice, without
  ///         '=', or that nobody asked for (the remedy lists those that were).
  [[nodiscard]] Status finish() const;

 private:
  struct Item {
    std::string_view key, value;
    bool known = false;
  };
  [[nodiscard]] Item* find(std::string_view key);
  void reject_text(std::string what);
  [[nodiscard]] std::string remedy() const;

  std::string_view spec_;
  std::string_view name_;
  std::vector<Item> items_;
  std::vector<std::string_view> known_;
  std::string wrong_;
  std::optional<Error> error_;
};

}  // namespace scatter::simulator
