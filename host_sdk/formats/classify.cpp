#include "host_sdk/formats/classify.h"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "host_sdk/formats/text_scanner.h"

namespace scatter::formats {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t kLookedAt = 64 * 1024;
constexpr std::size_t kMerlHeader = 12;
constexpr std::uint64_t kMostMerlCount = 10'000;

std::uint64_t little_endian_32(std::string_view bytes, std::size_t at) noexcept {
  std::uint64_t value = 0;
  for (std::size_t k = 4; k-- > 0;) {
    value = value << 8 | static_cast<unsigned char>(bytes[at + k]);
  }
  return value;
}

std::uint64_t turned_32(std::uint64_t value) noexcept {
  return std::byteswap(static_cast<std::uint32_t>(value));
}

/// Counts of a table, perhaps of the other byte order or one of them damaged: no text and no other
/// format begins with such numbers. The size is the reader's matter.
bool is_merl(std::string_view bytes) noexcept {
  if (bytes.size() < kMerlHeader) {
    return false;
  }
  std::size_t plausible = 0;
  std::size_t turned = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint64_t count = little_endian_32(bytes, 4 * k);
    plausible += count >= 1 && count <= kMostMerlCount;
    turned += turned_32(count) >= 1 && turned_32(count) <= kMostMerlCount;
  }
  return plausible >= 2 || turned == 3;
}

bool has_word(std::string_view text, std::string_view word) noexcept {
  const auto found = std::ranges::search(
      text, word, [](char a, char b) { return same_word(std::string_view(&a, 1), std::string_view(&b, 1)); });
  return !found.empty();
}

/// Blank lines and comments at the start of a text are no content.
std::string_view without_leading_comments(std::string_view text) noexcept {
  while (true) {
    const std::size_t start = text.find_first_not_of(" \t\r\n");
    if (start == std::string_view::npos || text[start] != '#') {
      return text;
    }
    const std::size_t end = text.find_first_of("\r\n", start);
    if (end == std::string_view::npos) {
      return text;
    }
    text.remove_prefix(end);
  }
}

Format classify_text(std::string_view text) noexcept {
  const std::size_t data = text.find("DataBegin");
  const std::string_view first_line = text.substr(0, text.find('\n'));
  if (first_line.find("MiniDiff Software") != std::string_view::npos) {
    return Format::kMiniDiff;
  }
  if (has_word(text, "AngleOfIncidence") || has_word(text, "SampleRotation")) {
    return Format::kZemax;
  }
  if (has_word(text, "ScatterRadial") && has_word(text, "ScatterAzimuth")) {
    const std::string_view blocks = data == std::string_view::npos ? "" : text.substr(data);
    return has_word(blocks, "AOI") || has_word(blocks, "POI") ? Format::kMiniDiff : Format::kZemax;
  }
  const std::size_t start = text.find_first_not_of(" \t\r\n");
  // Any JSON: the reader says what is missing in it.
  if (start != std::string_view::npos && (text[start] == '{' || text[start] == '[')) {
    return Format::kBird;
  }
  return Format::kUnknown;
}

}  // namespace

Format classify(std::string_view bytes, std::string_view name) noexcept {
  const std::string_view head = bytes.substr(0, kLookedAt);
  if (head.starts_with("\x76\x2f\x31\x01"sv)) {
    if (head.find("bsdfTileAngles"sv) != std::string_view::npos) {
      return Format::kExrTiles;
    }
    return head.find("bsdfGridVersion"sv) != std::string_view::npos ? Format::kNativeExr : Format::kExrOther;
  }
  if (head.starts_with("tensor_file\0"sv)) {
    return Format::kRgl;
  }
  // device/RECORDING.md; PNG-like, so that text transfers spoil it visibly.
  if (head.starts_with("\x89SCAT\r\n\x1a"sv)) {
    return Format::kRecording;
  }
  if (is_merl(bytes)) {
    return Format::kMerl;
  }
  const std::string_view mark = "\xEF\xBB\xBF"sv;
  Format format = classify_text(head.starts_with(mark) ? head.substr(mark.size()) : head);
  if (format == Format::kUnknown && bytes.size() > kLookedAt) {
    const std::string_view rest =
        without_leading_comments(bytes.substr(bytes.starts_with(mark) ? mark.size() : 0));
    format = classify_text(rest.substr(0, kLookedAt));
  }
  if (format == Format::kUnknown && name.ends_with(".binary") && !bytes.empty()) {
    return Format::kMerl;
  }
  return format;
}

std::string_view name(Format format) noexcept {
  switch (format) {
    case Format::kUnknown:
      return "unknown format";
    case Format::kZemax:
      return "Zemax BSDF";
    case Format::kMiniDiff:
      return "MiniDiff BSDF";
    case Format::kNativeExr:
      return "OpenEXR BRDF grid";
    case Format::kExrTiles:
      return "OpenEXR BRDF tiles";
    case Format::kExrOther:
      return "OpenEXR image";
    case Format::kRgl:
      return "RGL tensor BSDF";
    case Format::kMerl:
      return "MERL BRDF";
    case Format::kBird:
      return "BiRD JSON";
    case Format::kRecording:
      return "recording (.scat)";
  }
  return "unknown format";
}

}  // namespace scatter::formats
