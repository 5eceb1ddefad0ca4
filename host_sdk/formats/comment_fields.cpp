#include "host_sdk/formats/comment_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

#include "host_sdk/formats/decimal.h"
#include "host_sdk/formats/text_scanner.h"

namespace scatter::formats {
namespace {

using reflectance::Origin;

constexpr std::size_t kLineWidth = 150;
constexpr std::size_t kMostForeign = 8192;  // Bytes of others' comments that are kept.

std::unexpected<Error> damaged(std::string_view what) {
  return fail(ErrorCode::kDataLoss, std::string(what),
              "export the file again or remove the lines that begin with '# scatter.'");
}

bool is_control(char c) noexcept {
  return static_cast<unsigned char>(c) < ' ' || c == '\x7f';
}

std::string escaped_key(std::string_view key) {
  std::string out;
  for (const char c : key) {
    if (is_control(c) || c == '\\' || c == ':' || c == '+' || c == '@' || c == ' ') {
      fmt::format_to(std::back_inserter(out), "\\x{:02X}", static_cast<unsigned char>(c));
    } else {
      out += c;
    }
  }
  return out;
}

Result<std::string> unescaped(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] != '\\') {
      out += text[k];
      continue;
    }
    unsigned code = 0;
    const std::string_view digits = text.substr(k + 1).substr(0, 3);
    if (digits.size() != 3 || digits[0] != 'x' ||
        std::from_chars(digits.data() + 1, digits.data() + 3, code, 16).ptr != digits.data() + 3) {
      return damaged(fmt::format("a comment field has '\\{}', expected \\xHH", escaped_key(digits)));
    }
    out += static_cast<char>(code);
    k += 3;
  }
  return out;
}

void write_field(std::string_view prefix, std::string_view key, std::string_view value, std::string& out) {
  const std::string name = fmt::format("{}{}{}", TextScanner::kKeptPrefix, prefix, escaped_key(key));
  out += name;
  out += ": ";
  std::size_t width = 0;
  for (std::size_t k = 0; k < value.size(); ++k) {
    const char c = value[k];
    const bool at_edge = k + 1 == value.size() || width == 0 || width + 1 >= kLineWidth;
    if (is_control(c) || c == '\\' || (c == ' ' && at_edge)) {
      fmt::format_to(std::back_inserter(out), "\\x{:02X}", static_cast<unsigned char>(c));
      width += 4;
    } else {
      out += c;
      width += 1;
    }
    // Continuation bytes of UTF-8 stay with their character.
    const bool whole = k + 1 == value.size() || (static_cast<unsigned char>(value[k + 1]) & 0xC0) != 0x80;
    if (width >= kLineWidth && whole && k + 1 < value.size()) {
      out += '\n';
      out += name;
      out += "+ ";
      width = 0;
    }
  }
  out += '\n';
}

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && blank(text.front())) {
    text.remove_prefix(1);
  }
  while (!text.empty() && blank(text.back())) {
    text.remove_suffix(1);
  }
  return text;
}

void keep_foreign(std::string_view comment, std::string& out) {
  comment = trimmed(comment.substr(1));
  if (comment.empty() || out.size() + comment.size() > kMostForeign) {
    return;
  }
  out += out.empty() ? "" : "\n";
  for (const char c : comment) {
    out += is_control(c) ? ' ' : c;
  }
}

}  // namespace

void write_comment_fields(const std::map<std::string, std::string>& metadata,
                          const std::map<std::string, std::string>& own, std::string& out) {
  for (const auto& [key, value] : metadata) {
    write_field("", key, value, out);
  }
  for (const auto& [key, value] : own) {
    write_field("@", key, value, out);
  }
}

Result<CommentFields> read_comment_fields(std::span<const std::string_view> comments) {
  CommentFields fields;
  for (const std::string_view comment : comments) {
    if (!comment.starts_with(TextScanner::kKeptPrefix)) {
      keep_foreign(comment, fields.foreign);
      continue;
    }
    std::string_view rest = comment.substr(TextScanner::kKeptPrefix.size());
    const bool own = rest.starts_with('@');
    rest.remove_prefix(own ? 1 : 0);
    const std::size_t mark = rest.find_first_of(":+");
    if (mark == std::string_view::npos) {
      return damaged("a comment field has neither ':' nor '+' after its key");
    }
    const auto key = unescaped(rest.substr(0, mark));
    const auto value = unescaped(trimmed(rest.substr(mark + 1)));
    if (!key || !value) {
      return std::unexpected(key ? value.error() : key.error());
    }
    auto& map = own ? fields.own : fields.metadata;
    if (rest[mark] == ':') {
      map[*key] = *value;
    } else if (const auto it = map.find(*key); it != map.end()) {
      it->second += *value;
    } else {
      return damaged(fmt::format("comment field '{}' goes on before it begins", escaped_key(*key)));
    }
  }
  return fields;
}

std::string origin_runs(std::span<const Origin> origin) {
  std::string out;
  for (std::size_t k = 0; k < origin.size();) {
    std::size_t stop = k;
    while (stop < origin.size() && origin[stop] == origin[k]) {
      ++stop;
    }
    fmt::format_to(std::back_inserter(out), "{}{}*{}", out.empty() ? "" : " ", stop - k,
                   static_cast<int>(origin[k]));
    k = stop;
  }
  return out;
}

Result<std::vector<Origin>> read_origin_runs(std::string_view runs, std::size_t expected) {
  std::vector<Origin> out;
  const char* at = runs.data();
  const char* const end = at + runs.size();
  while (at != end) {
    if (*at == ' ') {
      ++at;
      continue;
    }
    std::size_t count = 0;
    const auto [stop, error] = std::from_chars(at, end, count);
    const bool good = error == std::errc{} && end - stop >= 2 && stop[0] == '*' && stop[1] >= '0' &&
                      stop[1] <= '3' && (end - stop == 2 || stop[2] == ' ');
    if (!good || count > expected - out.size()) {
      return damaged(fmt::format("the origins in the comments do not describe {} nodes", expected));
    }
    out.insert(out.end(), count, static_cast<Origin>(stop[1] - '0'));
    at = stop + 2;
  }
  if (out.size() != expected) {
    return damaged(fmt::format("the origins in the comments are {}, expected {}", out.size(), expected));
  }
  return out;
}

std::string float_list(std::span<const float> values) {
  return fmt::format("{}", fmt::join(values, " "));
}

Result<std::vector<float>> read_float_list(std::string_view text, std::size_t expected) {
  std::vector<float> out;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at != end) {
    if (*at == ' ') {
      ++at;
      continue;
    }
    float value = 0;
    const char* stop = parse_decimal(at, end, value);
    if (stop == nullptr || !std::isfinite(value) || (stop != end && *stop != ' ') || out.size() == expected) {
      return damaged(fmt::format("a list in the comments does not hold {} numbers", expected));
    }
    out.push_back(value);
    at = stop;
  }
  if (out.size() != expected) {
    return damaged(fmt::format("a list in the comments holds {} numbers, expected {}", out.size(), expected));
  }
  return out;
}

}  // namespace scatter::formats
