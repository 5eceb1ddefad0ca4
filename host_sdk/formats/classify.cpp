#include "host_sdk/formats/classify.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "host_sdk/formats/text_scanner.h"

namespace scatter::formats {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t kLookedAt = 64 * 1024;
constexpr std::size_t kMerlHeader = 12;

std::uint64_t little_endian_32(std::string_view bytes, std::size_t at) noexcept {
  std::uint64_t value = 0;
  for (std::size_t k = 4; k-- > 0;) {
    value = value << 8 | static_cast<unsigned char>(bytes[at + k]);
  }
  return value;
}

/// Three counts whose product, in three planes of doubles, is the rest of the file.
bool is_merl(std::string_view bytes) noexcept {
  if (bytes.size() < kMerlHeader) {
    return false;
  }
  const std::array<std::uint64_t, 3> n{little_endian_32(bytes, 0), little_endian_32(bytes, 4),
                                       little_endian_32(bytes, 8)};
  if (std::ranges::any_of(n, [](std::uint64_t k) { return k == 0 || k > 100'000; })) {
    return false;
  }
  return bytes.size() - kMerlHeader == n[0] * n[1] * n[2] * 3 * 8;
}

bool has_word(std::string_view text, std::string_view word) noexcept {
  const auto found = std::ranges::search(
      text, word, [](char a, char b) { return same_word(std::string_view(&a, 1), std::string_view(&b, 1)); });
  return !found.empty();
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
  if (start != std::string_view::npos && text[start] == '{' &&
      (text.find("\"BRDF\"") != std::string_view::npos ||
       text.find("\"theta_i\"") != std::string_view::npos ||
       text.find("\"variables\"") != std::string_view::npos ||
       text.find("\"head\"") != std::string_view::npos ||
       text.find("\"metadata\"") != std::string_view::npos)) {
    return Format::kBird;
  }
  return Format::kUnknown;
}

}  // namespace

Format classify(std::string_view bytes) noexcept {
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
  if (head.find('\0') != std::string_view::npos) {
    return Format::kUnknown;
  }
  return classify_text(head.starts_with("\xEF\xBB\xBF") ? head.substr(3) : head);
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
