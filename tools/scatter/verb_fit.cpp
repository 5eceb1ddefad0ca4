// scatter fit FILE|SPEC --model auto|NAME: an analytic model, its uncertainty, and engine materials.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <memory>
#include <optional>

#include "host_sdk/formats/sample_list_brdf.h"
#include "host_sdk/reflectance/fitting/fit.h"
#include "tools/plot/curves.h"
#include "tools/scatter/files.h"
#include "tools/scatter/fit_report.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;
namespace rf = reflectance;

struct Options {
  std::string subject;
  std::string model = "auto";
  std::string residual = "log";
  std::string picture;
  std::vector<std::string> exports;
  std::size_t samples = 20'000;
  double theta_max_deg = 85;
  bool all = false;
};

rf::Residual residual_of(const std::string& name) {
  return name == "cube-root"     ? rf::Residual::kCubeRoot
         : name == "uncertainty" ? rf::Residual::kUncertainty
                                 : rf::Residual::kLog;
}

Result<rf::FitSamples> samples_of(const rf::Brdf& brdf, const Options& options) {
  const rf::GatherOptions gather{.region = options.all ? rf::Region::kAll : rf::Region::kMeasured,
                                 .theta_o_max = rf::radians(options.theta_max_deg),
                                 .max_samples = options.samples};
  if (const auto* list = dynamic_cast<const formats::SampleListBrdf*>(&brdf)) {
    return rf::gather(list->samples(), gather);
  }
  return rf::gather(brdf, gather);
}

/// Known endings, before anything long is done.
Status check_exports(const Options& options) {
  for (const std::string& path : options.exports) {
    const std::string ending = fs::path(path).extension().string();
    if (ending != ".gltf" && ending != ".mtlx") {
      return fail(ErrorCode::kInvalidArgument, fmt::format("{}: materials end in .gltf or .mtlx", path),
                  "name the file so, for example material.gltf");
    }
  }
  if (!options.picture.empty()) {
    if (const auto kind = plot::image_kind(options.picture); !kind) {
      return std::unexpected(kind.error());
    }
  }
  return {};
}

Result<std::string> draw(const Options& options, const rf::Brdf& measured, const rf::FitResult& result,
                         std::vector<std::string>& told) {
  const auto kind = plot::image_kind(options.picture);
  if (!kind) {
    return std::unexpected(kind.error());
  }
  std::vector<plot::Incidence> incidences;
  for (const auto& loss : result.incidences) {
    incidences.push_back({loss.theta_i, loss.phi_i});
  }
  const std::vector<plot::NamedBrdf> both{{fs::path(options.subject).filename().string(), &measured},
                                          {name(result.family), result.model.get()}};
  return plot::curves(both,
                      {.kind = *kind,
                       .title = fs::path(options.subject).filename().string(),
                       .incidences = std::move(incidences),
                       .max_panels = 12},
                      &told);
}

Result<Answer> run(const Options& options, const Context& context) {
  if (const auto known = check_exports(options); !known) {
    return std::unexpected(known.error());
  }
  std::optional<rf::FitFamily> family;
  if (options.model != "auto") {
    const auto named = rf::fit_family(options.model);
    if (!named) {
      return std::unexpected(named.error());
    }
    family = *named;
  }
  const auto brdf = open_subject(options.subject);
  if (!brdf) {
    return std::unexpected(brdf.error());
  }
  const auto samples = samples_of(**brdf, options);
  if (!samples) {
    return std::unexpected(Error{samples.error().code,
                                 fmt::format("{}: {}", options.subject, samples.error().what),
                                 samples.error().remedy});
  }
  Progress bar;
  const rf::FitOptions fit_options{.residual = residual_of(options.residual), .stop = context.stop};
  rf::Selection selection;
  if (family) {
    bar.show(0, fmt::format("fitting {}", name(*family)));
    auto result = rf::fit(*samples, *family, fit_options);
    if (!result) {
      bar.clear();
      return std::unexpected(result.error());
    }
    selection.best = std::move(*result);
  } else {
    rf::SelectOptions select;
    select.fit = fit_options;
    select.progress = [&](double fraction, const std::string& what) { bar.show(0.9 * fraction, what); };
    auto selected = rf::select_model(*samples, select);
    if (!selected) {
      bar.clear();
      return std::unexpected(selected.error());
    }
    selection = std::move(*selected);
  }
  std::optional<EngineFits> engines;
  if (samples->channels == 1 || samples->channels == 3 || !options.exports.empty()) {
    bar.show(0.9, "fitting engine materials");
    auto fitted = fit_engines(*samples, fs::path(options.subject).stem().string(), context.stop);
    if (!fitted) {
      bar.clear();
      return std::unexpected(fitted.error());
    }
    engines = std::move(*fitted);
  }
  bar.clear();
  Answer answer = fit_report(selection.best, selection.scores, engines);
  std::vector<std::string> files;
  std::vector<std::string> told;
  if (!options.picture.empty()) {
    const auto picture = draw(options, **brdf, selection.best, told);
    if (!picture) {
      return std::unexpected(picture.error());
    }
    if (const auto written = write_file(options.picture, *picture); !written) {
      return std::unexpected(written.error());
    }
    files.push_back(options.picture);
  }
  for (const std::string& path : options.exports) {
    const std::string bytes = fs::path(path).extension() == ".gltf"
                                  ? formats::gltf_material(engines->gltf.material)
                                  : formats::materialx_material(engines->open_pbr.material);
    if (const auto written = write_file(path, bytes); !written) {
      return std::unexpected(written.error());
    }
    files.push_back(path);
  }
  answer.json["files"] = files;
  answer.json["picture_notes"] = told;
  for (const std::string& file : files) {
    answer.text += fmt::format("\n{}\n", file);
  }
  for (const std::string& sentence : told) {
    answer.text += fmt::format("  {}\n", sentence);
  }
  return answer;
}

}  // namespace

Verb add_fit(CLI::App& root) {
  auto* app = root.add_subcommand(
      "fit", "Fit an analytic model, with uncertainties, and materials for engines and renderers");
  auto options = std::make_shared<Options>();
  app->add_option("brdf", options->subject, "File or model")->required();
  app->add_option(
         "--model", options->model,
         "auto (cross-validation chooses), lambert, oren-nayar, disney, gltf, metallic-roughness, or one or "
         "two of ggx, beckmann, cook-torrance, ward, lafortune: ggx2, oren-nayar+ward, ...")
      ->capture_default_str();
  app->add_option("--residual", options->residual,
                  "What is made small: ratios, a compromise, or multiples of sigma")
      ->check(CLI::IsMember({"log", "cube-root", "uncertainty"}))
      ->capture_default_str();
  app->add_option("-o,--output", options->picture, "Picture of data and fit: .svg or .png");
  app->add_option("--export", options->exports,
                  "Material for engines and renderers: .gltf or .mtlx (OpenPBR)");
  app->add_option("--samples", options->samples, "Most directions used; 0: all")->capture_default_str();
  app->add_option("--theta-max", options->theta_max_deg, "Leave out directions beyond this elevation [deg]")
      ->check(CLI::Range(5.0, 90.0))
      ->capture_default_str();
  app->add_flag("--all", options->all, "Also use interpolated and extrapolated values");
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
