// scatter convert IN OUT: the same scattering data in another format.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/native_exr.h"
#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "tools/scatter/files.h"
#include "tools/scatter/grid_of.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string input;
  std::string output;
  std::string format;
};

using Bytes = Result<std::string>;

Bytes as_grid(const reflectance::Brdf& brdf, Bytes (*encode)(const reflectance::GridBrdf& grid)) {
  const auto grid = grid_of(brdf, plot::incidences_of(brdf));
  return grid ? encode(**grid) : Bytes(std::unexpected(grid.error()));
}

/// A format that can be written.
struct Writer {
  const char* name;
  const char* meaning;
  Bytes (*encode)(const reflectance::Brdf& brdf, bool model);
};

const Writer kWriters[] = {
    {"minidiff", "MiniDiff / LightTools text (.bsdf)",
     [](const reflectance::Brdf& brdf, bool) { return as_grid(brdf, formats::encode_minidiff); }},
    {"exr", "native grid with uncertainty and origin (.exr)",
     [](const reflectance::Brdf& brdf, bool) { return as_grid(brdf, formats::encode_native_exr); }},
    {"tiles", "one tile per incidence for shaders (.exr)",
     [](const reflectance::Brdf& brdf, bool model) {
       return formats::encode_exr_tiles(brdf, {.method = model ? "model" : "measured"});
     }},
};

std::string writable() {
  std::string text;
  for (const Writer& writer : kWriters) {
    text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", writer.name, writer.meaning);
  }
  return text;
}

Result<const Writer*> choose(const Options& options) {
  std::string wanted = options.format;
  if (wanted.empty()) {
    std::string extension = fs::path(options.output).extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](unsigned char c) { return char(std::tolower(c)); });
    if (extension != ".bsdf" && extension != ".exr") {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("the extension '{}' of '{}' names no format that can be written", extension,
                              options.output),
                  "use .bsdf (MiniDiff), .exr, or --format with one of: " + writable());
    }
    wanted = extension == ".bsdf" ? "minidiff" : "exr";
  }
  for (const Writer& writer : kWriters) {
    if (wanted == writer.name) {
      return &writer;
    }
  }
  return fail(ErrorCode::kUnimplemented, fmt::format("the format '{}' cannot be written", wanted),
              "use --format with one of: " + writable());
}

Result<Answer> run(const Options& options) {
  const auto writer = choose(options);
  if (!writer) {
    return std::unexpected(writer.error());
  }
  const auto brdf = formats::open_brdf(options.input);
  if (!brdf) {
    return std::unexpected(brdf.error());
  }
  const bool model = reflectance::is_model_spec(options.input);
  const auto bytes = (*writer)->encode(**brdf, model);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  const auto written = write_file(options.output, *bytes);
  if (!written) {
    return std::unexpected(written.error());
  }
  Answer answer;
  answer.json = {{"format", (*writer)->name}, {"files", {options.output}}};
  answer.text = fmt::format("{}: {}\n", options.output, (*writer)->meaning);
  return answer;
}

}  // namespace

Verb add_convert(CLI::App& root) {
  auto* app = root.add_subcommand("convert", "Write scattering data in another format");
  auto options = std::make_shared<Options>();
  app->add_option("in", options->input, "File or model")->required();
  app->add_option("out", options->output, "File to write")->required();
  app->add_option("--format", options->format, "Format to write, whatever the extension says; " + writable());
  return {app, [options](const Context&) { return run(*options); }};
}

}  // namespace scatter::cli
