#include "host_sdk/formats/open_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>

#include "host_sdk/formats/bird.h"
#include "host_sdk/formats/classify.h"
#include "host_sdk/formats/exr_atlas.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/merl.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/native_exr.h"
#include "host_sdk/formats/rgl.h"
#include "host_sdk/formats/zemax.h"
#include "host_sdk/reflectance/models/model_spec.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;

constexpr const char* kReadable = "use a Zemax, MiniDiff, MERL, RGL, BiRD, OpenEXR grid or OpenEXR tile file";

template <typename T>
Result<std::shared_ptr<const Brdf>> shared(Result<T> brdf) {
  if (!brdf) {
    return std::unexpected(std::move(brdf.error()));
  }
  return std::make_shared<const T>(std::move(*brdf));
}

Result<std::shared_ptr<const Brdf>> material_of_atlas(std::string_view bytes, std::string_view file,
                                                      std::string_view material) {
  auto entries = decode_exr_atlas(bytes, file);
  if (!entries) {
    return std::unexpected(std::move(entries.error()));
  }
  std::string names;
  for (AtlasEntry& entry : *entries) {
    if (entry.name == material) {
      return std::make_shared<const reflectance::SpecularGridBrdf>(std::move(entry.brdf));
    }
    names += fmt::format("{}{}", names.empty() ? "" : ", ", entry.name);
  }
  return fail(ErrorCode::kNotFound, fmt::format("{}: has no material named '{}'", file, material),
              names.empty() ? std::string("leave the part behind '#' out: the file holds one material")
                            : fmt::format("use one of: {}", names));
}

/// What no reader takes: how it begins, which is where the known formats differ.
std::unexpected<Error> unknown_format(std::string_view bytes, std::string_view file) {
  if (bytes.empty()) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{}: is empty", file), kReadable);
  }
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF")) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: byte 0: is UTF-16 text, expected UTF-8 or ASCII", file), "save it as UTF-8");
  }
  constexpr std::size_t kShown = 12;
  const std::string_view start = bytes.substr(0, kShown);
  const bool printable = std::ranges::all_of(start, [](char c) { return c >= ' ' && c <= '~'; });
  std::string found;
  for (const char c : start) {
    found += printable ? std::string(1, c)
                       : fmt::format("{}{:02X}", found.empty() ? "" : " ", static_cast<unsigned char>(c));
  }
  return fail(
      ErrorCode::kInvalidArgument,
      fmt::format("{}: is no BRDF format that is known: byte 0: found {}{}{}, expected the start of one",
                  file, printable ? "'" : "bytes ", found, printable ? "'" : ""),
      kReadable);
}

}  // namespace

Result<std::shared_ptr<const Brdf>> decode_brdf(std::string_view bytes, std::string_view name_of_file) {
  const Format format = classify(bytes, name_of_file);
  switch (format) {
    case Format::kZemax:
      return shared(decode_zemax(bytes, name_of_file));
    case Format::kMiniDiff:
      return shared(decode_minidiff(bytes, name_of_file));
    case Format::kNativeExr:
      return shared(decode_native_exr(bytes, name_of_file));
    case Format::kExrTiles:
      return shared(decode_exr_tiles(bytes, name_of_file));
    case Format::kRgl:
      return shared(decode_rgl(bytes, name_of_file));
    case Format::kMerl:
      return shared(decode_merl(bytes, name_of_file));
    case Format::kBird:
      return decode_bird(bytes, name_of_file);
    case Format::kRecording:
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: is a recording, which holds raw frames and no BRDF", name_of_file),
                  "run 'scatter process' on it first");
    case Format::kExrOther:
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: is an OpenEXR image without BRDF attributes", name_of_file), kReadable);
    case Format::kUnknown:
      break;
  }
  return unknown_format(bytes, name_of_file);
}

Result<std::shared_ptr<const Brdf>> open_brdf(std::string_view path_or_spec) {
  if (reflectance::is_model_spec(path_or_spec)) {
    return reflectance::make_model(path_or_spec);
  }
  constexpr std::string_view kFile = "file:";
  if (path_or_spec.starts_with(kFile)) {
    path_or_spec.remove_prefix(kFile.size());
  }
  auto bytes = read_file(std::filesystem::path(path_or_spec));
  if (const std::size_t mark = path_or_spec.rfind('#');
      !bytes && bytes.error().code == ErrorCode::kNotFound && mark != std::string_view::npos) {
    const std::string_view path = path_or_spec.substr(0, mark);
    if (const auto atlas = read_file(std::filesystem::path(path))) {
      return material_of_atlas(*atlas, path, path_or_spec.substr(mark + 1));
    }
  }
  if (!bytes) {
    if (bytes.error().code == ErrorCode::kNotFound) {
      bytes.error().remedy +=
          ", or name a model: lambertian:0.5, ggx:alpha=0.2, film:transmittance=0.6,haze=0.3";
    }
    return std::unexpected(std::move(bytes.error()));
  }
  return decode_brdf(*bytes, path_or_spec);
}

}  // namespace scatter::formats
