// scatter atlas OUT IN...: several materials in one tile texture.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <memory>

#include "host_sdk/formats/exr_atlas.h"
#include "tools/scatter/files.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/verb.h"
#include "tools/scatter/writing_options.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string output;
  std::vector<std::string> inputs;
  std::vector<std::string> names;
  WritingOptions tiles;
  std::size_t columns = 0;
  bool resample = false;
  bool texture_3d = false;
  PreparationOptions preparation;
};

Result<std::vector<std::string>> names_of(const Options& options) {
  if (options.names.empty()) {
    std::vector<std::string> names;
    for (const std::string& input : options.inputs) {
      std::error_code error;
      const bool file = std::filesystem::exists(input, error);
      names.push_back(file ? std::filesystem::path(input).stem().string() : input);
    }
    return names;
  }
  if (options.names.size() != options.inputs.size()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{} names for {} materials", options.names.size(), options.inputs.size()),
                "give one name per material, separated by commas");
  }
  return options.names;
}

Result<Answer> run(const Options& options) {
  const auto encode = encode_options(options.tiles);
  if (!encode) {
    return std::unexpected(encode.error());
  }
  const auto names = names_of(options);
  if (!names) {
    return std::unexpected(names.error());
  }
  std::vector<std::shared_ptr<const reflectance::Brdf>> kept;
  std::vector<formats::AtlasMaterial> materials;
  formats::AtlasOptions atlas{.tiles = {.width = encode->tile_width,
                                        .height = encode->tile_height,
                                        .columns = options.tiles.columns,
                                        .half_precision = encode->half_precision,
                                        .theta_i = encode->theta_i,
                                        .texture_3d = options.texture_3d},
                              .columns = options.columns,
                              .resample = options.resample};
  for (std::size_t k = 0; k < options.inputs.size(); ++k) {
    const auto data = open_data(options.inputs[k]);
    if (!data) {
      return std::unexpected(data.error());
    }
    // Materials that are tiles already, or agree in their incidences, go in as they are unless asked.
    const auto prepared = prepare(*data, options.preparation, options.resample ? "default" : "");
    if (!prepared) {
      return std::unexpected(prepared.error());
    }
    if (options.resample && atlas.tiles.theta_i.empty()) {
      atlas.tiles.theta_i = prepared->theta_i;
    }
    kept.push_back(prepared->brdf);
    materials.push_back({.name = (*names)[k], .brdf = kept.back().get()});
  }
  const auto bytes = formats::encode_exr_atlas(materials, atlas);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  if (const auto written = write_file(options.output, *bytes); !written) {
    return std::unexpected(written.error());
  }
  Answer answer;
  answer.json = {{"materials", *names}, {"bytes", bytes->size()}, {"files", {options.output}}};
  answer.text =
      fmt::format("{}: atlas of {} materials: {}\n", options.output, names->size(), fmt::join(*names, ", "));
  return answer;
}

}  // namespace

Verb add_atlas(CLI::App& root) {
  auto* app = root.add_subcommand("atlas", "Put several materials into one tile texture (.exr)");
  auto options = std::make_shared<Options>();
  app->add_option("out", options->output, "File to write (.exr)")->required();
  app->add_option("in", options->inputs, "Files or models, in the atlas's order")->required();
  app->add_option("--names", options->names, "Names of the materials; the files' otherwise")->delimiter(',');
  app->add_option("--atlas-columns", options->columns, "Materials per row of a tile; near-square otherwise")
      ->check(CLI::Range(1, 1000));
  app->add_flag("--resample", options->resample,
                "Bring materials that differ in incidences or tile size to the first one's");
  app->add_flag("--texture-3d", options->texture_3d, "Incidences from 0 in equal steps, for a 3-D texture");
  add_tile_options(*app, options->tiles);
  add_preparation_options(*app, options->preparation);
  return {app, [options](const Context&) { return run(*options); }};
}

}  // namespace scatter::cli
