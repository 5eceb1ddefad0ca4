// Options of every verb that writes scattering data: format, grid, digits, tiles.
#pragma once

#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/save_brdf.h"

namespace CLI {  // NOLINT(readability-identifier-naming): theirs
class App;
}

namespace scatter::cli {

/// As the person gives them; angles in degrees.
struct WritingOptions {
  std::string format;  ///< A writer's word; empty: by the extension.
  std::vector<double> incidences_deg;
  double step_deg = 0;
  int channel = -1;  ///< Counts from 0; -1: all.
  int digits = 0;
  bool rgb = false;
  bool full_floats = false;
  std::string tile;  ///< "360x180"
  std::size_t columns = 0;
};

void add_writing_options(CLI::App& app, WritingOptions& options);
/// Only those that tiles have: incidences, precision, size, columns.
void add_tile_options(CLI::App& app, WritingOptions& options);

/// The writer that the format or the file's extension names.
[[nodiscard]] Result<const formats::Writer*> chosen_writer(const WritingOptions& options,
                                                           const std::string& file);

/// Errors  kInvalidArgument: incidences that do not ascend, a tile size that is no "WxH".
[[nodiscard]] Result<formats::EncodeOptions> encode_options(const WritingOptions& options);

}  // namespace scatter::cli
