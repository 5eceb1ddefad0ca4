#include "tools/scatter/writing_options.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "host_sdk/reflectance/direction.h"

namespace scatter::cli {
namespace {

std::string writable() {
  std::string text;
  for (const formats::Writer& writer : formats::writers()) {
    text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", writer.word, writer.meaning);
  }
  return text;
}

Status read_tile(const std::string& text, formats::EncodeOptions& out) {
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, out.tile_width);
  if (width.ec == std::errc() && width.ptr != end && *width.ptr == 'x') {
    const auto height = std::from_chars(width.ptr + 1, end, out.tile_height);
    if (height.ec == std::errc() && height.ptr == end) {
      return {};
    }
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("the tile size '{}' is no WIDTHxHEIGHT", text),
              "write it as 360x180");
}

}  // namespace

void add_tile_options(CLI::App& app, WritingOptions& options) {
  app.add_option("--incidences", options.incidences_deg,
                 "Incidences to write [deg], ascending, for example 0,10,20; those of the data otherwise")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 89.9));
  app.add_flag("--float", options.full_floats, "Tiles: float instead of half");
  app.add_option("--tile", options.tile, "Size of a tile [texels], default 360x180");
  app.add_option("--columns", options.columns, "Tiles per row; near-square otherwise")
      ->check(CLI::Range(1, 1000));
}

void add_writing_options(CLI::App& app, WritingOptions& options) {
  app.add_option("--format", options.format, "Format to write, whatever the extension says; " + writable());
  app.add_option("--step", options.step_deg, "Grid step [deg]; the data's own otherwise, or 1")
      ->check(CLI::Range(0.05, 30.0));
  app.add_option("--channel", options.channel, "Write this channel alone, counted from 0")
      ->check(CLI::Range(0, 1000));
  app.add_option("--digits", options.digits, "Significant digits of text formats")->check(CLI::Range(1, 17));
  app.add_flag("--rgb", options.rgb, "Zemax: sections R G B as they are, instead of tristimulus values");
  add_tile_options(app, options);
}

Result<const formats::Writer*> chosen_writer(const WritingOptions& options, const std::string& file) {
  return options.format.empty() ? formats::writer_for(std::filesystem::path(file))
                                : formats::writer_named(options.format);
}

Result<formats::EncodeOptions> encode_options(const WritingOptions& options) {
  formats::EncodeOptions out;
  for (const double theta_deg : options.incidences_deg) {
    out.theta_i.push_back(reflectance::radians(theta_deg));
  }
  if (std::ranges::adjacent_find(out.theta_i, std::ranges::greater_equal()) != out.theta_i.end()) {
    return fail(ErrorCode::kInvalidArgument, "the incidences do not ascend", "write them as 0,20,40");
  }
  out.theta_step = reflectance::radians(options.step_deg);
  out.phi_step = out.theta_step;
  if (options.channel >= 0) {
    out.channel = static_cast<std::size_t>(options.channel);
  }
  out.digits = options.digits;
  out.rgb_sections = options.rgb;
  out.half_precision = !options.full_floats;
  out.tile_columns = options.columns;
  if (!options.tile.empty()) {
    if (const auto read = read_tile(options.tile, out); !read) {
      return std::unexpected(read.error());
    }
  }
  return out;
}

}  // namespace scatter::cli
