#include "host_sdk/formats/text_scanner.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "host_sdk/formats/decimal.h"

namespace scatter::formats {
namespace {

constexpr std::size_t kForeignComments = 100;
/// Rounding of angles that a program computed.
constexpr double kSameAngleDeg = 5e-7;

char lower(char c) noexcept {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

/// Words from damaged files may hold anything: only what prints goes into a message.
std::string printable(std::string_view word) {
  std::string out;
  for (const char c : word.substr(0, 40)) {
    out += c >= ' ' && c <= '~' ? c : '?';
  }
  return out;
}

}  // namespace

bool same_word(std::string_view a, std::string_view b) noexcept {
  return std::ranges::equal(a, b, {}, lower, lower);
}

TextScanner::TextScanner(std::string_view text, std::string_view name)
    : start_(text.data()), at_(text.data()), end_(text.data() + text.size()), name_(name) {
  if (text.starts_with("\xEF\xBB\xBF")) {
    at_ += 3;
  }
}

void TextScanner::skip_comment() {
  const char* stop = std::find_if(at_, end_, [](char c) { return c == '\n' || c == '\r'; });
  const std::string_view comment(at_, stop);
  if (comments_.size() < kForeignComments || comment.starts_with(kKeptPrefix)) {
    comments_.push_back(comment);
  }
  at_ = stop;
}

std::size_t TextScanner::line_at(std::size_t place) const noexcept {
  const bool again = place < counted_place_;
  std::size_t lines = again ? 1 : counted_line_;
  for (const char* c = start_ + (again ? 0 : counted_place_); c != start_ + place; ++c) {
    lines += *c == '\n' || (*c == '\r' && (c + 1 == end_ || c[1] != '\n')) ? 1 : 0;
  }
  counted_place_ = place;
  counted_line_ = lines;
  return lines;
}

std::string_view TextScanner::peek() {
  skip();
  return {at_, std::find_if(at_, end_, is_blank)};
}

std::string_view TextScanner::take() {
  const std::string_view word = peek();
  at_ += word.size();
  return word;
}

std::string_view TextScanner::take_line() {
  const char* stop = std::find_if(at_, end_, [](char c) { return c == '\n' || c == '\r'; });
  std::string_view line(at_, stop);
  at_ = stop;
  while (!line.empty() && is_blank(line.front())) {
    line.remove_prefix(1);
  }
  while (!line.empty() && is_blank(line.back())) {
    line.remove_suffix(1);
  }
  return line;
}

bool TextScanner::take_if(std::string_view word) {
  if (!same_word(peek(), word)) {
    return false;
  }
  at_ += word.size();
  return true;
}

Result<std::size_t> TextScanner::keyword(std::span<const std::string_view> keywords, std::span<bool> seen,
                                         std::string_view otherwise) {
  const std::string_view word = peek();
  std::size_t key = 0;
  while (key < keywords.size() && !same_word(keywords[key], word)) {
    ++key;
  }
  if (key == keywords.size()) {
    return expected(fmt::format("a keyword of the header or {}", otherwise));
  }
  if (seen[key]) {
    return error(fmt::format("{} is there twice", keywords[key]));
  }
  seen[key] = true;
  at_ += word.size();
  return key;
}

bool TextScanner::parse(double& value) {
  skip();
  const char* start = at_ != end_ && *at_ == '+' ? at_ + 1 : at_;
  const auto [stop, error] = std::from_chars(start, end_, value);
  if (error != std::errc{} || !std::isfinite(value) || (stop != end_ && !is_blank(*stop))) {
    return false;
  }
  at_ = stop;
  return true;
}

Result<double> TextScanner::number(std::string_view what) {
  double value = 0;
  if (!parse(value)) {
    return expected(fmt::format("{} (a number)", what));
  }
  return value;
}

Status TextScanner::numbers(std::string_view what, std::span<float> out) {
  for (std::size_t k = 0; k < out.size(); ++k) {
    skip();
    float value = 0;
    const char* stop = parse_decimal(at_, end_, value);
    if (stop == nullptr || (stop != end_ && !is_blank(*stop))) {
      return expected(fmt::format("{} {} of {} (a number)", what, k + 1, out.size()));
    }
    if (!std::isfinite(value)) {
      return error(fmt::format("{} {} is {}, too large for a 32-bit float", what, k + 1,
                               printable(std::string_view(at_, stop))));
    }
    out[k] = value;
    at_ = stop;
  }
  return {};
}

Result<std::size_t> TextScanner::count(std::string_view what, std::size_t limit) {
  const std::string_view word = peek();
  std::size_t value = 0;
  const auto [stop, error_code] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error_code != std::errc{} || stop != word.data() + word.size() || value < 1 || value > limit) {
    return expected(fmt::format("{} (a count 1..{})", what, limit));
  }
  if (value > remaining() / 2) {
    return error(fmt::format("{} is {}, but only {} bytes follow", what, value, remaining()));
  }
  at_ += word.size();
  return value;
}

Result<TextScanner::Angles> TextScanner::angles(std::string_view what, std::size_t limit, double lowest_deg,
                                                double highest_deg) {
  const auto size = count(what, limit);
  if (!size) {
    return std::unexpected(size.error());
  }
  Angles out{.deg = std::vector<double>(*size), .places = std::vector<std::size_t>(*size)};
  for (std::size_t k = 0; k < out.deg.size(); ++k) {
    skip();
    out.places[k] = place();
    double& angle = out.deg[k];
    if (!parse(angle)) {
      return expected(fmt::format("{} {} of {} (a number)", what, k + 1, out.deg.size()));
    }
    if (!(angle >= lowest_deg - kSameAngleDeg && angle <= highest_deg + kSameAngleDeg)) {
      return error_at(out.places[k],
                      fmt::format("{} {} of {} is {:.10g} deg, expected {:g}..{:g}", what, k + 1,
                                  out.deg.size(), angle, lowest_deg, highest_deg),
                      fmt::format("state {} in degrees {:g}..{:g}", what, lowest_deg, highest_deg));
    }
    if (k > 0 && !(angle > out.deg[k - 1])) {
      return error_at(out.places[k],
                      fmt::format("{} {} of {} is {:.10g} deg after {:.10g}, expected ascending angles", what,
                                  k + 1, out.deg.size(), angle, out.deg[k - 1]),
                      "sort the angles, and the values with them, in ascending order");
    }
  }
  return out;
}

std::unexpected<Error> TextScanner::error_at(std::size_t place, std::string_view what,
                                             std::string_view remedy) const {
  return fail(ErrorCode::kDataLoss, fmt::format("{}: line {}: {}", name_, line_at(place), what),
              std::string(remedy));
}

std::unexpected<Error> TextScanner::expected(std::string_view what) {
  const std::string_view word = peek();
  return error(fmt::format("expected {}, found {}", what,
                           word.empty() ? "the end of the file" : fmt::format("'{}'", printable(word))));
}

}  // namespace scatter::formats
