// Any BRDF into any file format: the table of writers, and the one entry of tools.
//
// A format that can be written is one line of the table in save_brdf.cpp. What each keeps and
// loses is in docs/formats.md; what one file lost says conversion_losses.h.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/classify.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::formats {

/// What the caller wants; a format ignores what it has no place for.
struct EncodeOptions {
  /// Incidences of a resampled grid [rad], ascending; empty: those of the data, or 0 10 .. 80 deg.
  std::vector<double> theta_i = {};
  /// Steps of a resampled grid [rad]; 0: those of the data where it has a grid of the kind, else 1 deg.
  double theta_step = 0;
  double phi_step = 0;
  /// Write this channel alone, as monochrome.
  std::optional<std::size_t> channel = {};
  /// Significant digits of text formats, 1..17; 0: what the format usually has.
  int digits = 0;
  /// Zemax: three channels as they are (SpectralContent RGB) instead of as tristimulus values.
  bool rgb_sections = false;
  /// EXR tiles: half instead of float.
  bool half_precision = true;
  std::size_t tile_width = 360;
  std::size_t tile_height = 180;
  std::size_t tile_columns = 0;  ///< 0: near-square.
  /// measured | simulated | model; empty: what the metadata say, else measured.
  std::string method = {};
  /// Added to the metadata of the data, whose keys it replaces.
  std::map<std::string, std::string> metadata = {};
};

/// A format that can be written.
struct Writer {
  Format format = Format::kUnknown;
  std::string_view word;       ///< For the command line: "zemax".
  std::string_view extension;  ///< ".bsdf"
  std::string_view meaning;    ///< "Zemax tabular BSDF, text (.bsdf)"
  int digits = 0;              ///< Of values in a text that rounds them; 0: values are kept as numbers.
  /// The format has one channel or three: of other data encode_brdf takes those nearest 630, 525
  /// and 465 nm, in that order.
  bool only_colours = false;
  /// File image. Deterministic: the same BRDF and options give the same bytes.
  Result<std::string> (*encode)(const reflectance::Brdf& brdf, const EncodeOptions& options) = nullptr;
};

/// All of them; for an extension that several share, the first is its default.
[[nodiscard]] std::span<const Writer> writers() noexcept;

/// Errors  kInvalidArgument naming the words there are.
[[nodiscard]] Result<const Writer*> writer_named(std::string_view word);
/// By extension, whatever its case. Errors  kInvalidArgument naming the extensions there are.
[[nodiscard]] Result<const Writer*> writer_for(const std::filesystem::path& path);

/// Channels that go into the file, by their numbers in the data.
/// Errors  as encode_brdf.
[[nodiscard]] Result<std::vector<std::size_t>> channels_to_write(const reflectance::Brdf& brdf,
                                                                 const Writer& writer,
                                                                 const EncodeOptions& options);

/// Errors  those of the writer; kInvalidArgument: an option out of its range, or channels without
///         wavelengths that are neither one nor three for a format of colours;
///         kFailedPrecondition: scattered samples for a format that needs a grid; a Dirac component
///         and nothing beside it.
[[nodiscard]] Result<std::string> encode_brdf(const reflectance::Brdf& brdf, const Writer& writer,
                                              const EncodeOptions& options = {});
/// Encodes and replaces the file as a whole (file_bytes.h).
[[nodiscard]] Status save_brdf(const reflectance::Brdf& brdf, const std::filesystem::path& path,
                               const Writer& writer, const EncodeOptions& options = {});

}  // namespace scatter::formats
