// Words and numbers of a text file, with the place of every fault. Internal to formats.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::formats {

/// Cuts text at blanks and line ends; "#" at the start of a word begins a comment up to the end
/// of the line. Accepts LF, CRLF and a byte-order mark. Views point into the caller's text.
class TextScanner {
 public:
  TextScanner(std::string_view text, std::string_view name);

  /// Next word without taking it; empty at the end of the text.
  [[nodiscard]] std::string_view peek();
  std::string_view take();
  /// What is left of the current line, blanks trimmed, comments included.
  std::string_view take_line();
  [[nodiscard]] bool at_end() { return peek().empty(); }
  /// Case does not matter.
  bool take_if(std::string_view word);

  /// Finite numbers; a sign "+" is allowed.
  /// Errors  kDataLoss: line, expected, found.
  [[nodiscard]] Result<double> number(std::string_view what);
  [[nodiscard]] Status numbers(std::string_view what, std::span<float> out);
  /// A count 1..limit whose items, of two bytes at least, can still follow.
  [[nodiscard]] Result<std::size_t> count(std::string_view what, std::size_t limit);
  /// A count and that many numbers.
  [[nodiscard]] Result<std::vector<double>> list(std::string_view what, std::size_t limit);

  [[nodiscard]] std::size_t remaining() const noexcept { return static_cast<std::size_t>(end_ - at_); }
  /// "file.bsdf: line 12: what".
  [[nodiscard]] std::unexpected<Error> error(std::string_view what) const;
  /// The same with "expected ..., found ..." of the next word.
  [[nodiscard]] std::unexpected<Error> expected(std::string_view what);

 private:
  void skip();
  [[nodiscard]] bool parse(double& value);

  const char* at_;
  const char* end_;
  std::string_view name_;
  std::size_t line_ = 1;
};

/// ASCII comparison without case.
[[nodiscard]] bool same_word(std::string_view a, std::string_view b) noexcept;

}  // namespace scatter::formats
