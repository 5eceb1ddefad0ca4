// What a file is, by its content and never by its name.
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

/// Looks at no more than the first 64 KiB, and at the size.
[[nodiscard]] Format classify(std::string_view bytes) noexcept;

/// For messages: "Zemax BSDF".
[[nodiscard]] std::string_view name(Format format) noexcept;

}  // namespace scatter::formats
