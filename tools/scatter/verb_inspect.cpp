// scatter inspect FILE|SPEC: coverage, energy, reciprocity, symmetry, totals, metadata, and a picture.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <string>
#include <vector>

#include "tools/plot/caption.h"
#include "tools/plot/hemispheres.h"
#include "tools/scatter/file_description.h"
#include "tools/scatter/files.h"
#include "tools/scatter/grid_of.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/recording_description.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string target;
  std::string picture;
};

/// Hemispheres of every incidence; hatching shows what was not measured.
/// Returns   the sentences of the picture's caption.
Result<std::vector<std::string>> draw(const Options& options) {
  const auto kind = plot::image_kind(options.picture);
  if (!kind) {
    return std::unexpected(kind.error());
  }
  if (looks_like_recording(options.target)) {
    return fail(ErrorCode::kInvalidArgument,
                options.target + ": a recording holds raw frames and no BRDF to draw",
                "run 'scatter process' on it, which draws its BRDF, or leave -o out");
  }
  const auto brdf = open_subject(options.target);
  if (!brdf) {
    return std::unexpected(brdf.error());
  }
  const auto grid = grid_of(**brdf, plot::incidences_of(**brdf));
  if (!grid) {
    return std::unexpected(grid.error());
  }
  const plot::NamedBrdf named{shown_name(options.target), brdf->get()};
  std::vector<std::string> told;
  const auto image = plot::hemispheres(
      **grid,
      {.kind = *kind, .title = named.name, .notes = {plot::dirac_note(named, plot::incidences_of(**brdf))}},
      &told);
  if (!image) {
    return std::unexpected(image.error());
  }
  if (const auto written = write_file(options.picture, *image); !written) {
    return std::unexpected(written.error());
  }
  return told;
}

Result<Answer> run(const Options& options) {
  auto answer = describe_file(options.target);
  if (!answer || options.picture.empty()) {
    return answer;
  }
  const auto told = draw(options);
  if (!told) {
    return std::unexpected(told.error());
  }
  answer->json["files"] = {options.picture};
  answer->json["picture_notes"] = *told;
  answer->text += fmt::format("\n{}\n", options.picture);
  for (const std::string& sentence : *told) {
    answer->text += fmt::format("  {}\n", sentence);
  }
  return answer;
}

}  // namespace

Verb add_inspect(CLI::App& root) {
  auto* app = root.add_subcommand("inspect",
                                  "Show what is in a file: coverage, energy, reciprocity, symmetry, total "
                                  "scatter, metadata; or in a recording");
  auto options = std::make_shared<Options>();
  app->add_option("file", options->target, "File, or a model such as ggx:alpha=0.2,f0=0.04,albedo=0.3")
      ->required();
  app->add_option("-o,--output", options->picture,
                  "Also draw the hemispheres (.png or .svg), hatched where nothing was measured");
  return {app, [options](const Context&) { return run(*options); }};
}

}  // namespace scatter::cli
