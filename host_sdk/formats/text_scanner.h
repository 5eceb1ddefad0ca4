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
/// of the line. Accepts LF, CRLF, CR and a byte-order mark. Views point into the caller's text.
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

  /// Takes a keyword of a header and returns its index; each may come once.
  /// Errors  kDataLoss: another word ("expected a keyword of the header or `otherwise`"), or a
  ///         keyword that `seen` (one per keyword, set here) has already.
  [[nodiscard]] Result<std::size_t> keyword(std::span<const std::string_view> keywords, std::span<bool> seen,
                                            std::string_view otherwise);

  /// Finite numbers; a sign "+" is allowed.
  /// Errors  kDataLoss: line, expected, found.
  [[nodiscard]] Result<double> number(std::string_view what);
  /// Correctly rounded (decimal.h); too small for a float is 0.
  [[nodiscard]] Status numbers(std::string_view what, std::span<float> out);
  /// A count 1..limit whose items, of two bytes at least, can still follow.
  [[nodiscard]] Result<std::size_t> count(std::string_view what, std::size_t limit);
  /// Angles [deg] with the places where they stand, for a check that needs what comes later.
  struct Angles {
    std::vector<double> deg;
    std::vector<std::size_t> places;
  };
  /// A count and that many angles lowest..highest, each above the one before.
  /// Errors  kDataLoss: the line of the angle that is wrong.
  [[nodiscard]] Result<Angles> angles(std::string_view what, std::size_t limit, double lowest_deg,
                                      double highest_deg);

  [[nodiscard]] std::size_t remaining() const noexcept { return static_cast<std::size_t>(end_ - at_); }
  /// Comments passed so far, with their "#", without the line end: those that begin with
  /// kKeptPrefix, and the first hundred others.
  [[nodiscard]] const std::vector<std::string_view>& comments() const noexcept { return comments_; }
  static constexpr std::string_view kKeptPrefix = "# scatter.";

  /// Byte of the text that comes next, for error_at().
  [[nodiscard]] std::size_t place() const noexcept { return static_cast<std::size_t>(at_ - start_); }
  /// "file.bsdf: line 12: what".
  [[nodiscard]] std::unexpected<Error> error(std::string_view what, std::string_view remedy = kMend) const {
    return error_at(place(), what, remedy);
  }
  [[nodiscard]] std::unexpected<Error> error_at(std::size_t place, std::string_view what,
                                                std::string_view remedy = kMend) const;
  /// Lines are counted when somebody asks, from where they were asked for before: not once per value.
  [[nodiscard]] std::size_t line_at(std::size_t place) const noexcept;
  /// The same with "expected ..., found ..." of the next word.
  [[nodiscard]] std::unexpected<Error> expected(std::string_view what);

 private:
  void skip() {
    while (at_ != end_ && static_cast<unsigned char>(*at_) <= '#') {
      if (*at_ == '#') {
        skip_comment();
      } else if (is_blank(*at_)) {
        ++at_;
      } else {
        return;
      }
    }
  }
  static bool is_blank(char c) noexcept {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\f' || c == '\v';
  }
  void skip_comment();
  static constexpr std::string_view kMend = "export the file again or correct this line";
  [[nodiscard]] bool parse(double& value);

  mutable std::size_t counted_place_ = 0;
  mutable std::size_t counted_line_ = 1;  ///< Of that place.
  const char* start_;
  const char* at_;
  const char* end_;
  std::string_view name_;
  std::vector<std::string_view> comments_;
};

/// ASCII comparison without case.
[[nodiscard]] bool same_word(std::string_view a, std::string_view b) noexcept;

}  // namespace scatter::formats
