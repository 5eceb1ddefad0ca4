// scatter plot FILE|SPEC ... -o X.svg|png: curves in the plane of incidence, or hemispheres.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tools/plot/caption.h"
#include "tools/plot/curves.h"
#include "tools/plot/hemispheres.h"
#include "tools/scatter/files.h"
#include "tools/scatter/grid_of.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

struct Options {
  std::vector<std::string> subjects;
  std::string output;
  std::string kind = "curves";
  std::string scale = "auto";
  std::string title;
  std::vector<double> incidences_deg;
  bool dark = false;
  bool light = false;
  bool luminance = false;
  PreparationOptions preparation;
};

plot::Scale scale_of(const std::string& name) {
  return name == "log" ? plot::Scale::kLog : name == "linear" ? plot::Scale::kLinear : plot::Scale::kAuto;
}

/// The incidences asked for; without any, those of the first subject that was measured, drawn evenly spaced
/// where there are many.
std::vector<plot::Incidence> incidences(const Options& options, const std::vector<plot::NamedBrdf>& brdfs) {
  std::vector<plot::Incidence> chosen;
  for (const double theta_deg : options.incidences_deg) {
    chosen.push_back({reflectance::radians(theta_deg), 0});
  }
  for (std::size_t k = 0; k < brdfs.size() && chosen.empty(); ++k) {
    if (dynamic_cast<const reflectance::GridBrdf*>(brdfs[k].brdf) != nullptr ||
        dynamic_cast<const reflectance::SpecularGridBrdf*>(brdfs[k].brdf) != nullptr) {
      chosen = plot::incidences_of(*brdfs[k].brdf);
    }
  }
  if (chosen.empty()) {
    chosen = plot::incidences_of(*brdfs.front().brdf);
  }
  return chosen;
}

/// Panels and discs of a picture whose incidences nobody chose.
constexpr std::size_t kMost = 12;

Result<std::string> hemispheres(const Options& options, const plot::NamedBrdf& named, plot::ImageKind kind,
                                const std::vector<plot::Incidence>& lights, std::vector<std::string>& told) {
  const auto grid = grid_of(*named.brdf, lights);
  if (!grid) {
    return std::unexpected(grid.error());
  }
  return plot::hemispheres(**grid,
                           {.kind = kind,
                            .theme = options.light ? plot::Theme::kLight : plot::Theme::kDark,
                            .scale = scale_of(options.scale),
                            .luminance = options.luminance,
                            .title = options.title.empty() ? named.name : options.title,
                            .max_rows = options.incidences_deg.empty() ? kMost : lights.size(),
                            .notes = {plot::dirac_note(named, lights)}},
                           &told);
}

Result<std::string> draw(const Options& options, const std::vector<plot::NamedBrdf>& brdfs,
                         std::vector<std::string>& told) {
  const auto kind = plot::image_kind(options.output);
  if (!kind) {
    return std::unexpected(kind.error());
  }
  if (options.kind == "curves") {
    return plot::curves(brdfs,
                        {.kind = *kind,
                         .theme = options.dark ? plot::Theme::kDark : plot::Theme::kLight,
                         .scale = scale_of(options.scale),
                         .title = options.title,
                         .incidences = incidences(options, brdfs),
                         .max_panels = options.incidences_deg.empty() ? kMost : 24},
                        &told);
  }
  if (brdfs.size() != 1) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("hemispheres of {} BRDFs in one picture", brdfs.size()),
                "draw one at a time, or use --kind curves to lay several over each other");
  }
  return hemispheres(options, brdfs.front(), *kind, incidences(options, brdfs), told);
}

Result<Answer> run(const Options& options) {
  std::vector<std::shared_ptr<const reflectance::Brdf>> kept;
  std::vector<plot::NamedBrdf> brdfs;
  for (const auto& subject : options.subjects) {
    const auto opened = open_data(subject);
    if (!opened) {
      return std::unexpected(opened.error());
    }
    const auto prepared = prepare(*opened, options.preparation, "");
    if (!prepared) {
      return std::unexpected(prepared.error());
    }
    kept.push_back(prepared->brdf);
    brdfs.push_back({shown_name(subject), kept.back().get()});
  }
  std::vector<std::string> notes;
  const auto picture = draw(options, brdfs, notes);
  if (!picture) {
    return std::unexpected(picture.error());
  }
  if (const auto written = write_file(options.output, *picture); !written) {
    return std::unexpected(written.error());
  }
  Answer answer;
  answer.json = {{"notes", notes}, {"files", {options.output}}};
  answer.text = options.output + "\n";
  for (const std::string& note : notes) {
    answer.text += fmt::format("  {}\n", note);
  }
  return answer;
}

}  // namespace

Verb add_plot(CLI::App& root) {
  auto* app =
      root.add_subcommand("plot", "Draw curves in the plane of incidence, or false-colour hemispheres");
  auto options = std::make_shared<Options>();
  app->add_option("brdfs", options->subjects, "Files or models")->required();
  app->add_option("-o,--output", options->output, "Picture: .svg or .png")->required();
  app->add_option("--kind", options->kind, "curves or hemispheres")
      ->check(CLI::IsMember({"curves", "hemispheres"}))
      ->capture_default_str();
  app->add_option("--scale", options->scale, "Scale of the values")
      ->check(CLI::IsMember({"auto", "log", "linear"}))
      ->capture_default_str();
  app->add_option("--incidence", options->incidences_deg, "Incidences to draw [deg], for example 0,30,60")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 89.9));
  app->add_option("--title", options->title, "Heading");
  auto* dark = app->add_flag("--dark", options->dark, "Dark page (the default for hemispheres)");
  app->add_flag("--light", options->light, "Light page (the default for curves)")->excludes(dark);
  app->add_flag("--luminance", options->luminance, "Hemispheres: one column, the mean of the channels");
  add_preparation_options(*app, options->preparation);
  return {app, [options](const Context&) { return run(*options); }};
}

}  // namespace scatter::cli
