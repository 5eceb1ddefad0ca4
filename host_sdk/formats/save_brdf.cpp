#include "host_sdk/formats/save_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "host_sdk/formats/bird.h"
#include "host_sdk/formats/dirac_share.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/grid_to_write.h"
#include "host_sdk/formats/merl.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/native_exr.h"
#include "host_sdk/formats/rgl.h"
#include "host_sdk/formats/sample_list_brdf.h"
#include "host_sdk/formats/text_scanner.h"
#include "host_sdk/formats/zemax.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::GridBrdf;
using Bytes = Result<std::string>;

Bytes on_normal_grid(const Brdf& brdf, const EncodeOptions& options, Bytes (*encode)(const GridBrdf& grid)) {
  const auto grid = normal_grid(brdf, options);
  return grid ? encode(**grid) : Bytes(std::unexpected(grid.error()));
}

Bytes native_exr(const Brdf& brdf, const EncodeOptions& options) {
  return on_normal_grid(brdf, options, encode_native_exr);
}

Bytes minidiff(const Brdf& brdf, const EncodeOptions& options) {
  const auto grid = normal_grid(brdf, options);
  return grid ? encode_minidiff(**grid, options.digits) : Bytes(std::unexpected(grid.error()));
}

Bytes exr_tiles(const Brdf& brdf, const EncodeOptions& options) {
  return encode_exr_tiles(brdf, {.width = options.tile_width,
                                 .height = options.tile_height,
                                 .columns = options.tile_columns,
                                 .half_precision = options.half_precision,
                                 .theta_i = options.theta_i,
                                 .method = options.method.empty() ? "measured" : options.method,
                                 .metadata = options.metadata});
}

Bytes zemax(const Brdf& brdf, const EncodeOptions& options) {
  const auto grid = specular_grid(brdf, options);
  return grid ? encode_zemax(**grid, {.digits = options.digits, .rgb_sections = options.rgb_sections})
              : Bytes(std::unexpected(grid.error()));
}

Bytes merl(const Brdf& brdf, const EncodeOptions& /*options*/) {
  return encode_merl(brdf);
}

Bytes rgl(const Brdf& brdf, const EncodeOptions& options) {
  reflectance::AdaptOptions adapt;
  adapt.theta_i = options.theta_i;
  adapt.metadata = metadata_of(brdf, options);
  return encode_rgl(brdf, adapt);
}

/// One line per format that can be written; the first of an extension is its default.
constexpr std::array kWriters{
    Writer{Format::kNativeExr, "exr", ".exr", "OpenEXR grid about the normal, lossless (.exr)", 0, false,
           native_exr},
    Writer{Format::kExrTiles, "tiles", ".exr", "OpenEXR, one tile per incidence, for shaders (.exr)", 0, true,
           exr_tiles},
    Writer{Format::kZemax, "zemax", ".bsdf", "Zemax tabular BSDF, text (.bsdf)", 4, true, zemax},
    Writer{Format::kMiniDiff, "minidiff", ".bsdf", "MiniDiff / LightTools BSDF, text (.bsdf)", 7, false,
           minidiff},
    Writer{Format::kBird, "bird", ".brdf", "BiRD JSON, schema v1.0 (.brdf)", 0, false, encode_bird},
    Writer{Format::kMerl, "merl", ".binary", "MERL, half and difference angles (.binary)", 0, true, merl},
    Writer{Format::kRgl, "rgl", ".bsdf", "RGL tensor, for Mitsuba 3 and pbrt-v4 (.bsdf)", 0, false, rgl},
};

/// Channels nearest to red, green and blue, as the instrument's light-emitting diodes are.
Result<std::vector<std::size_t>> colour_channels(const Brdf& brdf) {
  const auto wavelengths = brdf.wavelengths_nm();
  if (wavelengths.empty()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{} channels without wavelengths, the format has one or three", brdf.channels()),
                "choose one channel");
  }
  std::vector<std::size_t> out;
  for (const float wanted : {630.0F, 525.0F, 465.0F}) {
    const auto nearest = std::ranges::min_element(
        wavelengths, {}, [wanted](float wavelength) { return std::abs(wavelength - wanted); });
    out.push_back(static_cast<std::size_t>(nearest - wavelengths.begin()));
  }
  return out;
}

std::string words() {
  std::string text;
  for (const Writer& writer : kWriters) {
    text += fmt::format("{}{}", text.empty() ? "" : ", ", writer.word);
  }
  return text;
}

}  // namespace

std::span<const Writer> writers() noexcept {
  return kWriters;
}

Result<const Writer*> writer_named(std::string_view word) {
  const auto* it = std::ranges::find_if(kWriters, [&](const Writer& w) { return same_word(w.word, word); });
  if (it == kWriters.end()) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("no format named '{}' can be written", word),
                fmt::format("use one of: {}", words()));
  }
  return it;
}

Result<const Writer*> writer_for(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  const auto* it =
      std::ranges::find_if(kWriters, [&](const Writer& w) { return same_word(w.extension, extension); });
  if (it == kWriters.end()) {
    std::string known;
    for (const Writer& writer : kWriters) {
      known += fmt::format("{}{} ({})", known.empty() ? "" : ", ", writer.extension, writer.word);
    }
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("the extension '{}' of '{}' names no format that can be written", extension,
                            path.string()),
                fmt::format("use {}, or name the format", known));
  }
  return it;
}

Result<std::vector<std::size_t>> channels_to_write(const Brdf& brdf, const Writer& writer,
                                                   const EncodeOptions& options) {
  if (options.channel) {
    return std::vector{*options.channel};
  }
  if (writer.only_colours && brdf.channels() != 1 && brdf.channels() != 3) {
    return colour_channels(brdf);
  }
  std::vector<std::size_t> all(brdf.channels());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

Result<std::string> encode_brdf(const Brdf& brdf, const Writer& writer, const EncodeOptions& options) {
  if (options.digits < 0 || options.digits > 17) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{} digits, expected 1..17", options.digits),
                "leave it out or choose 4 to 9");
  }
  if (writer.format != Format::kBird && dynamic_cast<const SampleListBrdf*>(&brdf) != nullptr) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("the samples are scattered, the format {} needs a grid", writer.word),
                "interpolate them by a chain of estimators first, or write bird, which takes lists");
  }
  if (Status status = check_not_dirac_alone(brdf, writer.word); !status) {
    return std::unexpected(status.error());
  }
  const auto chosen = channels_to_write(brdf, writer, options);
  if (!chosen) {
    return std::unexpected(chosen.error());
  }
  if (!options.channel && chosen->size() == brdf.channels()) {
    return writer.encode(brdf, options);
  }
  const auto some = only_channels(brdf, *chosen);
  // Some channels of what is no grid know their values only.
  EncodeOptions with_metadata = options;
  with_metadata.metadata = metadata_of(brdf, options);
  return some ? writer.encode(**some, with_metadata) : Bytes(std::unexpected(some.error()));
}

Status save_brdf(const Brdf& brdf, const std::filesystem::path& path, const Writer& writer,
                 const EncodeOptions& options) {
  const auto bytes = encode_brdf(brdf, writer, options);
  return bytes ? write_file(path, *bytes) : std::unexpected(bytes.error());
}

}  // namespace scatter::formats
