// scatter merge OUT RED GREEN BLUE: one file per colour made into one.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <array>
#include <memory>

#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/reflectance/estimators/merge.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tools/scatter/files.h"
#include "tools/scatter/grid_of.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/verb.h"
#include "tools/scatter/writing_options.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string output;
  std::array<std::string, 3> inputs;
  WritingOptions writing;
};

/// A file of three channels gives the colour that it stands for, one of a single channel gives that.
std::size_t channel_for(const reflectance::Brdf& brdf, std::size_t colour) {
  return brdf.channels() == 3 ? colour : 0;
}

/// Grids and lists of samples have points to merge; everything else is put on a grid about the normal.
Result<std::shared_ptr<const reflectance::Brdf>> with_points(std::shared_ptr<const reflectance::Brdf> data) {
  if (dynamic_cast<const reflectance::GridBrdf*>(data.get()) != nullptr ||
      dynamic_cast<const reflectance::SpecularGridBrdf*>(data.get()) != nullptr ||
      dynamic_cast<const reflectance::ScatteredBrdf*>(data.get()) != nullptr) {
    return data;
  }
  auto grid = grid_of(*data, plot::incidences_of(*data));
  if (!grid) {
    return std::unexpected(grid.error());
  }
  return *grid;
}

Result<Answer> run(const Options& options) {
  constexpr std::array kColours = {"red", "green", "blue"};
  const auto writer = chosen_writer(options.writing, options.output);
  if (!writer) {
    return std::unexpected(writer.error());
  }
  const auto encode = encode_options(options.writing);
  if (!encode) {
    return std::unexpected(encode.error());
  }
  std::vector<reflectance::MergeSource> sources;
  for (std::size_t c = 0; c < kColours.size(); ++c) {
    const auto data = open_data(options.inputs[c]);
    if (!data) {
      return std::unexpected(data.error());
    }
    const auto points = with_points(*data);
    if (!points) {
      return std::unexpected(points.error());
    }
    sources.push_back({.brdf = *points, .channel = channel_for(**data, c), .name = kColours[c]});
  }
  const auto merged = reflectance::merge_channels(sources);
  if (!merged) {
    return std::unexpected(merged.error());
  }
  const auto bytes = formats::encode_brdf(*merged->brdf, **writer, *encode);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  if (const auto written = write_file(options.output, *bytes); !written) {
    return std::unexpected(written.error());
  }
  Answer answer;
  answer.json = {{"format", (*writer)->word},
                 {"points", merged->points},
                 {"estimated", merged->estimated},
                 {"dropped", merged->dropped},
                 {"files", {options.output}}};
  answer.text = fmt::format(
      "{}: {}\n  {} points; {} values that one of the files did not have are interpolated, {} places left "
      "out\n",
      options.output, (*writer)->meaning, merged->points, merged->estimated, merged->dropped);
  return answer;
}

}  // namespace

Verb add_merge(CLI::App& root) {
  auto* app = root.add_subcommand("merge", "Make one file of three, one per colour");
  auto options = std::make_shared<Options>();
  app->add_option("out", options->output, "File to write")->required();
  app->add_option("red", options->inputs[0], "File of the red channel, or with three channels")->required();
  app->add_option("green", options->inputs[1], "The same for green")->required();
  app->add_option("blue", options->inputs[2], "The same for blue")->required();
  add_writing_options(*app, options->writing);
  return {app, [options](const Context&) { return run(*options); }};
}

}  // namespace scatter::cli
