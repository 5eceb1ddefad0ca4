// scatter convert IN OUT: the same scattering data in another format.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <memory>

#include "host_sdk/formats/conversion_losses.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/reflectance/adaptive_brdf.h"
#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/extent.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tools/scatter/files.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/verb.h"
#include "tools/scatter/writing_options.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string input;
  std::string output;
  WritingOptions writing;
  PreparationOptions preparation;
};

/// The data's own nodes go into a format that can hold them; everything else is asked of a chain.
bool keeps_nodes(const reflectance::Brdf& brdf, const formats::Writer& writer,
                 const WritingOptions& writing) {
  if (!writing.incidences_deg.empty() || writing.step_deg > 0) {
    return false;
  }
  const bool about_mirror = dynamic_cast<const reflectance::SpecularGridBrdf*>(&brdf) != nullptr;
  switch (writer.format) {
    case formats::Format::kNativeExr:
    case formats::Format::kMiniDiff:
      return !about_mirror;
    case formats::Format::kBird:
      return true;
    case formats::Format::kZemax:
      return about_mirror;
    default:
      return false;
  }
}

/// Chains take the sample as isotropic; data of several rotations answer by themselves.
bool rotated(const reflectance::Brdf& brdf) {
  if (const auto* grid = dynamic_cast<const reflectance::SpecularGridBrdf*>(&brdf)) {
    return grid->content().rotation.size() > 1;
  }
  if (const auto* grid = dynamic_cast<const reflectance::GridBrdf*>(&brdf)) {
    const auto& parts = grid->content().parts;
    return std::ranges::any_of(
        parts, [&](const auto& part) { return part.rotation_rad != parts.front().rotation_rad; });
  }
  return false;
}

/// How data answer between and beyond their own nodes when no chain stands around them; empty for what is
/// known everywhere.
std::string own_rule(const reflectance::Brdf& brdf) {
  std::string_view rule;
  if (dynamic_cast<const reflectance::GridBrdf*>(&brdf) != nullptr) {
    rule =
        "bilinear between nodes, linear about the mirror direction between incidences, the nearest "
        "incidence and node beyond";
  } else if (dynamic_cast<const reflectance::SpecularGridBrdf*>(&brdf) != nullptr) {
    rule = "linear between nodes and between incidences, the nearest beyond";
  } else if (dynamic_cast<const reflectance::AdaptiveBrdf*>(&brdf) != nullptr) {
    rule = "linear between the tables' incidences, the nearest beyond";
  } else {
    return {};
  }
  std::vector<std::string> own;
  for (const double theta_i : reflectance::extent_of(brdf).theta_i) {
    own.push_back(fmt::format("{:.4g}", reflectance::degrees(theta_i)));
  }
  return fmt::format("estimators: none, the data's own rule: {}{}", rule,
                     own.empty() ? "" : fmt::format(" (incidences {} deg)", fmt::join(own, ", ")));
}

/// Whether incidences are asked for that the data do not have.
bool between_incidences(const std::vector<double>& wanted, const reflectance::Brdf& data) {
  const std::vector<double> stored = reflectance::extent_of(data).theta_i;
  return std::ranges::any_of(wanted, [&](double theta_i) {
    return std::ranges::none_of(
        stored, [&](double own) { return std::abs(own - theta_i) < reflectance::kSameAngle; });
  });
}

/// The best chain where it pays, the default one where the best does not suit the data, which a note says.
Result<Prepared> prepared_for(const Options& options, const std::shared_ptr<const reflectance::Brdf>& data,
                              bool plain, bool between) {
  auto prepared = prepare(data, options.preparation, plain ? "" : between ? "best" : "default");
  if (prepared || plain || !between || options.preparation.chain ||
      prepared.error().code != ErrorCode::kFailedPrecondition) {
    return prepared;
  }
  const std::string why = prepared.error().what;
  prepared = prepare(data, options.preparation, "default");
  if (prepared) {
    prepared->notes.push_back("guided interpolation does not suit these data: " + why);
  }
  return prepared;
}

Result<Answer> run(const Options& options) {
  const auto writer = chosen_writer(options.writing, options.output);
  if (!writer) {
    return std::unexpected(writer.error());
  }
  auto encode = encode_options(options.writing);
  if (!encode) {
    return std::unexpected(encode.error());
  }
  const auto data = open_data(options.input);
  if (!data) {
    return std::unexpected(data.error());
  }
  const bool keeps = keeps_nodes(**data, **writer, options.writing);
  const bool plain = keeps || rotated(**data);
  // MERL's table asks for every incidence.
  const bool between =
      (*writer)->format == formats::Format::kMerl || between_incidences(encode->theta_i, **data);
  const auto prepared = prepared_for(options, *data, plain, between);
  if (!prepared) {
    return std::unexpected(prepared.error());
  }
  if (reflectance::is_model_spec(options.input)) {
    encode->method = "model";
    encode->metadata["model"] = options.input;
  }
  encode->metadata.insert(prepared->metadata.begin(), prepared->metadata.end());
  if (prepared->brdf != *data && encode->theta_i.empty()) {
    encode->theta_i = prepared->theta_i;
  }
  const auto bytes = formats::encode_brdf(*prepared->brdf, **writer, *encode);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  const auto losses = formats::conversion_losses(**data, *prepared->brdf, **writer, *encode, *bytes);
  if (!losses) {
    return std::unexpected(losses.error());
  }
  if (const auto written = write_file(options.output, *bytes); !written) {
    return std::unexpected(written.error());
  }
  std::vector<std::string> notes = prepared->notes;
  if (const auto rule = own_rule(**data); prepared->brdf == *data && !keeps && !rule.empty()) {
    notes.push_back(rule);
  }
  Answer answer;
  answer.json = {{"format", (*writer)->word},
                 {"losses", *losses},
                 {"notes", notes},
                 {"bytes", bytes->size()},
                 {"files", {options.output}}};
  answer.text = fmt::format("{}: {}\n", options.output, (*writer)->meaning);
  answer.text += losses->empty() ? "  nothing is lost\n" : "  lost:\n";
  for (const std::string& loss : *losses) {
    answer.text += fmt::format("    {}\n", loss);
  }
  for (const std::string& note : notes) {
    answer.text += fmt::format("  {}\n", note);
  }
  return answer;
}

}  // namespace

Verb add_convert(CLI::App& root) {
  auto* app = root.add_subcommand("convert", "Write scattering data in another format");
  auto options = std::make_shared<Options>();
  app->add_option("in", options->input, "File or model")->required();
  app->add_option("out", options->output, "File to write")->required();
  add_writing_options(*app, options->writing);
  add_preparation_options(*app, options->preparation);
  return {app, [options](const Context&) { return run(*options); }};
}

}  // namespace scatter::cli
