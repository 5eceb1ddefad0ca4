#include "tools/scatter/fit_report.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <vector>

#include "tools/scatter/text_table.h"

namespace scatter::cli {
namespace {

using nlohmann::ordered_json;
using reflectance::FamilyScore;
using reflectance::FitParameter;
using reflectance::FitResult;
using reflectance::IncidenceLoss;

/// Lists longer than this are for machines.
constexpr std::size_t kMostRows = 24;

/// JSON knows no infinity: what is not finite is null.
ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json to_json(const std::vector<IncidenceLoss>& losses) {
  ordered_json list = ordered_json::array();
  for (const IncidenceLoss& loss : losses) {
    list.push_back({{"theta_i_deg", reflectance::degrees(loss.theta_i)},
                    {"phi_i_deg", reflectance::degrees(loss.phi_i)},
                    {"samples", loss.samples},
                    {"rms_residual", loss.rms_residual},
                    {"mean_relative_error", loss.mean_relative_error},
                    {"relative_flux_error", loss.relative_flux_error}});
  }
  return list;
}

ordered_json to_json(const FitParameter& parameter) {
  ordered_json out = {{"name", parameter.name}};
  if (parameter.channel != FitParameter::kShared) {
    out["channel"] = parameter.channel;
  }
  out["value"] = parameter.value;
  out["sigma"] = number(parameter.sigma);
  out["interval_95"] = {parameter.low_95, parameter.high_95};
  out["bounds"] = {parameter.lower_bound, parameter.upper_bound};
  out["standing"] = name(parameter.standing);
  return out;
}

/// What a material has at the end of its range, where the fit says only that it wants to go beyond.
std::vector<std::string> bounds_reached(const formats::EngineMaterial& material) {
  constexpr double kAtBound = 1e-3;
  std::vector<std::string> out;
  const auto check = [&](const char* what, double value, double low, double high) {
    if (value <= low + kAtBound) {
      out.push_back(fmt::format("{} {:.3f} at lower bound", what, value));
    } else if (value >= high - kAtBound) {
      out.push_back(fmt::format("{} {:.3f} at upper bound", what, value));
    }
  };
  check("ior", material.ior, 1, 3);
  check("roughness", material.roughness, 0, 1);
  // 1 is also what stands for "not used".
  if (material.specular_factor < 1) {
    check("specular factor", material.specular_factor, 0, 1);
  }
  return out;
}

ordered_json to_json(const EngineFit& fit, bool specular_factor) {
  const formats::EngineMaterial& material = fit.material;
  const double r = (material.ior - 1) / (material.ior + 1);
  ordered_json out = {{"base_color", material.base_color},
                      {"metallic", material.metallic},
                      {"roughness", material.roughness},
                      // F0 = 0.08 specular, as Disney's model and the engines after it have it.
                      {"specular", std::min(r * r * material.specular_factor / 0.08, 1.0)},
                      {"ior", material.ior}};
  if (specular_factor) {
    out["specular_factor"] = material.specular_factor;
  }
  out["at_bounds"] = bounds_reached(material);
  out["loss"] = {{"rms_log_residual", fit.rms_log_residual},
                 {"mean_relative_error", fit.mean_relative_error},
                 {"relative_flux_error", fit.relative_flux_error},
                 {"incidences", to_json(fit.incidences)}};
  return out;
}

ordered_json to_json(const FamilyScore& score) {
  ordered_json out = {{"model", name(score.family)}, {"parameters", score.parameters}};
  if (!score.failure.empty()) {
    out["failure"] = score.failure;
    return out;
  }
  out["rms_residual"] = score.rms_residual;
  out["mean_relative_error"] = score.mean_relative_error;
  out["incidence_residuals"] = score.incidence_residual;
  return out;
}

std::string percent(double share) {
  return fmt::format("{:.2f} %", 100 * share);
}

std::string parameters_text(const FitResult& result) {
  std::vector<std::vector<std::string>> rows{{"parameter", "value", "95 % interval", ""}};
  for (const FitParameter& parameter : result.parameters) {
    if (rows.size() > 2 * kMostRows) {
      rows.push_back({fmt::format("... {} in all, see --json", result.parameters.size())});
      break;
    }
    const std::string channel =
        parameter.channel == FitParameter::kShared ? "" : fmt::format(" [{}]", parameter.channel + 1);
    rows.push_back({parameter.name + channel, fmt::format("{:.5g}", parameter.value),
                    fmt::format("{:.5g} .. {:.5g}", parameter.low_95, parameter.high_95),
                    parameter.standing == reflectance::Standing::kDetermined
                        ? std::string()
                        : std::string(name(parameter.standing))});
  }
  return text_table(rows, "  ");
}

std::string incidences_text(const FitResult& result) {
  std::vector<std::vector<std::string>> rows{
      {"incidence", "samples", "residual", "relative error", "flux error"}};
  for (const IncidenceLoss& loss : result.incidences) {
    if (rows.size() > kMostRows) {
      rows.push_back({fmt::format("... {} in all, see --json", result.incidences.size())});
      break;
    }
    rows.push_back({fmt::format("{:.1f} deg", reflectance::degrees(loss.theta_i)),
                    fmt::format("{}", loss.samples), fmt::format("{:.4f}", loss.rms_residual),
                    percent(loss.mean_relative_error), percent(loss.relative_flux_error)});
  }
  return text_table(rows, "  ");
}

std::string scores_text(const std::vector<FamilyScore>& scores) {
  std::vector<std::vector<std::string>> rows{
      {"held-back incidences", "parameters", "residual", "relative error"}};
  for (const FamilyScore& score : scores) {
    if (score.failure.empty()) {
      rows.push_back({name(score.family), fmt::format("{}", score.parameters),
                      fmt::format("{:.4f}", score.rms_residual), percent(score.mean_relative_error)});
    } else {
      rows.push_back({name(score.family), fmt::format("{}", score.parameters), score.failure});
    }
  }
  return text_table(rows, "  ");
}

std::string engines_text(const EngineFits& engines) {
  std::vector<std::vector<std::string>> rows{
      {"engine", "base colour", "metallic", "roughness", "ior", "relative error"}};
  std::vector<std::string> at_bounds;
  const auto row = [&](const char* engine, const EngineFit& fit) {
    const auto& m = fit.material;
    for (const std::string& bound : bounds_reached(m)) {
      at_bounds.push_back(fmt::format("  {}: {}\n", engine, bound));
    }
    rows.push_back({engine, numbers({m.base_color.begin(), m.base_color.end()}, 3),
                    fmt::format("{:.3f}", m.metallic), fmt::format("{:.3f}", m.roughness),
                    fmt::format("{:.3f}", m.ior), percent(fit.mean_relative_error)});
  };
  row("metallic-roughness", engines.core);
  row("glTF", engines.gltf);
  row("OpenPBR", engines.open_pbr);
  std::string text = text_table(rows, "  ");
  for (const std::string& line : at_bounds) {
    text += line;
  }
  return text;
}

}  // namespace

Answer fit_report(const FitResult& result, const std::vector<FamilyScore>& scores,
                  const std::optional<EngineFits>& engines) {
  Answer answer;
  ordered_json& json = answer.json;
  json["model"] = name(result.family);
  json["spec"] = result.spec;
  json["samples"] = result.samples;
  json["rms_residual"] = result.rms_residual;
  json["mean_relative_error"] = result.mean_relative_error;
  if (result.reduced_chi_square) {
    json["reduced_chi_square"] = *result.reduced_chi_square;
  }
  json["parameters"] = ordered_json::array();
  for (const FitParameter& parameter : result.parameters) {
    json["parameters"].push_back(to_json(parameter));
  }
  const std::size_t count = result.parameters.size();
  json["covariance"] = ordered_json::array();
  for (std::size_t i = 0; i < count && !result.covariance.empty(); ++i) {
    ordered_json row = ordered_json::array();
    for (std::size_t j = 0; j < count; ++j) {
      row.push_back(number(result.covariance[i * count + j]));
    }
    json["covariance"].push_back(std::move(row));
  }
  json["incidences"] = to_json(result.incidences);
  if (!scores.empty()) {
    json["cross_validation"] = ordered_json::array();
    for (const FamilyScore& score : scores) {
      json["cross_validation"].push_back(to_json(score));
    }
  }
  json["remarks"] = result.remarks;
  if (engines) {
    json["engines"] = {{"metallic_roughness", to_json(engines->core, false)},
                       {"gltf", to_json(engines->gltf, true)},
                       {"open_pbr", to_json(engines->open_pbr, false)}};
  }

  answer.text = fmt::format("{}: mean relative error {} over {} directions\n", name(result.family),
                            percent(result.mean_relative_error), result.samples);
  if (!result.spec.empty()) {
    answer.text += fmt::format("{}\n", result.spec);
  }
  answer.text += fmt::format("\n{}\n{}", parameters_text(result), incidences_text(result));
  if (!scores.empty()) {
    answer.text += fmt::format("\n{}", scores_text(scores));
  }
  if (engines) {
    answer.text += fmt::format("\n{}", engines_text(*engines));
  }
  for (const std::string& remark : result.remarks) {
    answer.text += fmt::format("\nnote: {}\n", remark);
  }
  return answer;
}

}  // namespace scatter::cli
