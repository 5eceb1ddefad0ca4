#include <fmt/format.h>
#include <fmt/ranges.h>

#include "host_sdk/formats/exr_tile_file.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"

namespace scatter::formats {

using reflectance::SpecularGridBrdf;

Result<SpecularGridBrdf> decode_exr_tiles(std::string_view bytes, std::string_view name) {
  const auto file = decode_exr_tile_file(bytes, name);
  if (!file) {
    return std::unexpected(file.error());
  }
  if (file->atlas_names.size() > 1) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: is an atlas of {} materials: {}", name, file->atlas_names.size(),
                            fmt::join(file->atlas_names, ", ")),
                fmt::format("name one of its materials: {}#{}", name, file->atlas_names.front()));
  }
  return file->brdf(0, name);
}

Result<SpecularGridBrdf> read_exr_tiles(const std::filesystem::path& path) {
  const auto bytes = read_file(path);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  return decode_exr_tiles(*bytes, path.string());
}

}  // namespace scatter::formats
