// What a file is, by its content.
#pragma once

#include <cstdint>
#include <string_view>

namespace scatter::formats {

enum class Format : std::uint8_t {
  kUnknown,
  kZemax,     ///< Zemax tabular BSDF, text.
  kMiniDiff,  ///< MiniDiff / LightTools BSDF, text.
  kNativeExr,
  kExrTiles,
  kExrOther,   ///< An OpenEXR image without our attributes.
  kRgl,        ///< RGL tensor, binary.
  kMerl,       ///< MERL table, binary.
  kBird,       ///< BiRD JSON, any generation.
  kRecording,  ///< .scat: raw frames, not a BRDF.
};

/// Looks at no more than the first 64 KiB behind leading comments, and at the size. MERL's counts
/// are known even where they do not fit the size, so that its reader says what is wrong; a name
/// that ends in ".binary" decides only about what nothing else claims.
[[nodiscard]] Format classify(std::string_view bytes, std::string_view name = {}) noexcept;

/// For messages: "Zemax BSDF".
[[nodiscard]] std::string_view name(Format format) noexcept;

}  // namespace scatter::formats
