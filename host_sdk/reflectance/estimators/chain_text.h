// The text of a chain, taken apart.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::reflectance {

/// One link's name and parameters; parameters are taken out one by one, so that what is left over is unknown.
class LinkText {
 public:
  explicit LinkText(std::string_view name) : name_(name) {}

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Errors  kInvalidArgument: the key twice.
  [[nodiscard]] Status add(std::string_view key, std::string_view value);

  /// Takes a number; `fallback` when the key is not there.
  /// Errors  kInvalidArgument: not a finite number.
  [[nodiscard]] Result<double> number(std::string_view key, double fallback);
  [[nodiscard]] Result<std::optional<double>> number(std::string_view key);
  /// Takes a whole number >= 0.
  [[nodiscard]] Result<std::size_t> count(std::string_view key, std::size_t fallback);
  /// Takes one of the words; the first one when the key is not there.
  [[nodiscard]] Result<std::string> word(std::string_view key, const std::vector<std::string>& words);
  /// Errors  kInvalidArgument: parameters that nobody took.
  [[nodiscard]] Status done() const;

 private:
  [[nodiscard]] std::optional<std::string> take(std::string_view key);

  std::string name_;
  std::vector<std::pair<std::string, std::string>> values_;
  std::string known_;  ///< Keys asked for so far, for the message.
};

/// Errors  kInvalidArgument: an empty part, a parameter before any link, a parameter without key or value,
///         more than 16 links.
[[nodiscard]] Result<std::vector<LinkText>> parse_chain_text(std::string_view text);

}  // namespace scatter::reflectance
