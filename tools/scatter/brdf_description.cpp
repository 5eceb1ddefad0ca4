#include "tools/scatter/brdf_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "host_sdk/formats/sample_list_brdf.h"
#include "host_sdk/reflectance/adaptive_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/half_difference_brdf.h"
#include "host_sdk/reflectance/inspection.h"
#include "host_sdk/reflectance/negative_values.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tools/plot/ticks.h"
#include "tools/scatter/text_table.h"

namespace scatter::cli {
namespace {

using formats::SampleListBrdf;
using nlohmann::ordered_json;
using reflectance::AdaptiveBrdf;
using reflectance::Brdf;
using reflectance::degrees;
using reflectance::Deviation;
using reflectance::GridBrdf;
using reflectance::HalfDifferenceBrdf;
using reflectance::IncidenceInspection;
using reflectance::Inspection;
using reflectance::OriginShares;
using reflectance::Region;
using reflectance::SpecularGridBrdf;

using Rows = std::vector<std::vector<std::string>>;

ordered_json to_json(const OriginShares& share) {
  return {
      {"measured", share[1]}, {"interpolated", share[2]}, {"extrapolated", share[3]}, {"invalid", share[0]}};
}

ordered_json to_json(const std::optional<Deviation>& deviation) {
  return deviation ? ordered_json{{"pairs", deviation->pairs},
                                  {"median_relative_difference", deviation->median},
                                  {"relative_rms", deviation->relative_rms}}
                   : ordered_json(nullptr);
}

std::string text_of(const std::optional<Deviation>& deviation, std::string_view subject) {
  return deviation ? fmt::format("{} differ by {:.3g} % (median of {} pairs), {:.3g} % rms", subject,
                                 100 * deviation->median, deviation->pairs, 100 * deviation->relative_rms)
                   : std::string("cannot be told: no pair of directions has a value both ways");
}

const std::map<std::string, std::string>* metadata_of(const Brdf& brdf) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    return &grid->content().metadata;
  }
  if (const auto* grid = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    return &grid->content().metadata;
  }
  if (const auto* adaptive = dynamic_cast<const AdaptiveBrdf*>(&brdf)) {
    return &adaptive->content().metadata;
  }
  if (const auto* table = dynamic_cast<const HalfDifferenceBrdf*>(&brdf)) {
    return &table->content().metadata;
  }
  if (const auto* list = dynamic_cast<const SampleListBrdf*>(&brdf)) {
    return &list->samples().metadata;
  }
  return nullptr;
}

std::string shape_of(const Brdf& brdf) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    const auto& content = grid->content();
    return fmt::format("about the normal: {} incidences, {} x {} directions, {:.4g} deg",
                       content.parts.size(), content.theta_count, content.phi_count,
                       degrees(content.theta_step));
  }
  if (const auto* grid = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    const auto& content = grid->content();
    return fmt::format("about the mirror direction: {} rotations, {} incidences, {} azimuths x {} radials{}",
                       content.rotation.size(), content.theta_i.size(), content.azimuth.size(),
                       content.radial.size(), content.plane_symmetric ? ", plane-symmetric" : "");
  }
  if (const auto* adaptive = dynamic_cast<const AdaptiveBrdf*>(&brdf)) {
    const auto& content = adaptive->content();
    return fmt::format("adaptive: {} incidences{}, {} x {} half vectors each",
                       adaptive->own_incidences().size(), adaptive->isotropic() ? ", isotropic" : "",
                       content.spectra.width, content.spectra.height);
  }
  if (const auto* list = dynamic_cast<const SampleListBrdf*>(&brdf)) {
    return fmt::format("none: a list of {} directions at {} incidences", list->samples().size(),
                       list->own_incidences().size());
  }
  return {};
}

/// One row per line of the value. A long key has a row of its own, so that it does not widen the column.
void add_lines(std::string key, std::string_view value, Rows& rows) {
  constexpr std::size_t kLongKey = 28;
  if (key.size() > kLongKey) {
    rows.push_back({std::exchange(key, "")});
  }
  while (!value.empty()) {
    const std::size_t end = std::min(value.find('\n'), value.size());
    rows.push_back({std::exchange(key, ""), std::string(value.substr(0, end))});
    value.remove_prefix(std::min(end + 1, value.size()));
  }
}

/// Rows of one line per incidence, and the same as JSON.
void add_incidences(const Brdf& brdf, const Inspection& found, ordered_json& json, std::string& text) {
  const auto* grid = dynamic_cast<const GridBrdf*>(&brdf);
  Rows rows = {{"incidence", "measured", "interpolated", "extrapolated", "no value", "albedo",
                "of it extrapolated", "mirror halves differ"}};
  if (grid != nullptr) {
    rows.front().insert(rows.front().begin() + 6, "over the measured part");
  }
  const auto percent = [](double share) { return fmt::format("{:.1f} %", 100 * share); };
  const bool turned = std::ranges::any_of(found.incidences, [&](const IncidenceInspection& incidence) {
    return incidence.phi_i != found.incidences.front().phi_i;
  });
  auto& list = json["albedo"] = ordered_json::array();
  for (std::size_t k = 0; k < found.incidences.size(); ++k) {
    const IncidenceInspection& incidence = found.incidences[k];
    const std::vector<double> whole = whole_albedo(incidence);
    ordered_json entry = {{"rotation_deg", degrees(incidence.rotation_rad)},
                          {"theta_i_deg", degrees(incidence.theta_i)},
                          {"phi_i_deg", degrees(incidence.phi_i)},
                          {"albedo", incidence.nothing_known ? ordered_json(nullptr) : ordered_json(whole)},
                          {"dirac", incidence.albedo.dirac},
                          {"quadrature_error", incidence.albedo.error},
                          {"extrapolated_share", incidence.extrapolated_albedo_share},
                          {"gains_energy", incidence.gains_energy},
                          {"coverage", to_json(incidence.coverage)},
                          {"mirror_symmetry", to_json(incidence.mirror_symmetry)}};
    const OriginShares& share = incidence.coverage;
    const std::string light = turned ? fmt::format("{}, azimuth {}", plot::angle_text(incidence.theta_i),
                                                   plot::angle_text(incidence.phi_i))
                                     : plot::angle_text(incidence.theta_i);
    std::vector<std::string> row = {light,
                                    percent(share[1]),
                                    percent(share[2]),
                                    percent(share[3]),
                                    percent(share[0]),
                                    incidence.nothing_known ? std::string("-") : numbers(whole, 4)};
    if (grid != nullptr && k < grid->content().parts.size()) {
      const auto measured = reflectance::grid_albedo(*grid, k, Region::kMeasured);
      entry["albedo_measured_region"] = measured;
      row.push_back(numbers(measured, 4));
    }
    row.push_back(incidence.nothing_known ? std::string("-") : percent(incidence.extrapolated_albedo_share));
    row.push_back(incidence.mirror_symmetry ? fmt::format("{:.3g} %", 100 * incidence.mirror_symmetry->median)
                                            : std::string("-"));
    rows.push_back(std::move(row));
    list.push_back(std::move(entry));
  }
  text += '\n';
  text += text_table(rows);
}

/// Total scatter as the file states it, beside what its values give.
void add_totals(const Inspection& found, ordered_json& json, std::string& text) {
  Rows rows = {{"incidence", "channel", "TIS stated", "recomputed", "ratio", "held to the horizon", ""}};
  auto& list = json["tis"] = ordered_json::array();
  std::size_t differing = 0;
  for (const IncidenceInspection& incidence : found.incidences) {
    for (const auto& total : incidence.totals) {
      list.push_back({{"rotation_deg", degrees(incidence.rotation_rad)},
                      {"theta_i_deg", degrees(incidence.theta_i)},
                      {"channel", total.channel},
                      {"stated", total.stated},
                      {"recomputed", total.recomputed},
                      {"ratio", total.ratio},
                      {"recomputed_held_to_horizon", total.held},
                      {"differs", total.differs}});
      rows.push_back({plot::angle_text(incidence.theta_i), std::to_string(total.channel),
                      fmt::format("{:.4g}", total.stated), fmt::format("{:.4g}", total.recomputed),
                      fmt::format("{:.3f}", total.ratio), fmt::format("{:.4g}", total.held),
                      std::string(total.differs ? "differs" : "")});
      differing += total.differs;
    }
  }
  if (list.empty()) {
    return;
  }
  auto& warnings = json["warnings"];
  text += '\n';
  text += text_table(rows);
  if (differing > 0) {
    warnings.push_back(
        fmt::format("{} of {} stated totals differ from the values' own integral by more than 5 %: "
                    "trust the recomputed ones",
                    differing, list.size()));
  }
  if (found.looks_cosine_weighted) {
    warnings.push_back(
        "the totals fit the integral without cosine: the file probably holds f cos(theta_o), not f");
  }
}

std::string energy_text(const Inspection& found) {
  const auto& energy = found.energy;
  if (!energy.largest_albedo) {
    return "cannot be told: no incidence has values over enough of the hemisphere";
  }
  const std::string largest =
      fmt::format("largest albedo {:.4f} at {}", *energy.largest_albedo, plot::angle_text(energy.largest_at));
  if (energy.gained) {
    return fmt::format(
        "more light leaves than arrives ({}): the data or the formula are wrong, or their "
        "extrapolated values",
        largest);
  }
  constexpr double kMuchUnknown = 0.01;
  return fmt::format("conserved up to incidences of {}{}, {}", plot::angle_text(energy.judged_to),
                     found.origin_shares[0] > kMuchUnknown ? " as far as there are values" : "", largest);
}

ordered_json energy_json(const reflectance::EnergyBalance& energy) {
  if (!energy.largest_albedo) {
    return {{"largest_albedo", nullptr}, {"conserved", nullptr}};
  }
  return {{"largest_albedo", *energy.largest_albedo},
          {"largest_at_deg", degrees(energy.largest_at)},
          {"judged_to_deg", degrees(energy.judged_to)},
          {"conserved", !energy.gained}};
}

/// Negative values, and a list or table that was looked at here and there only.
void add_warnings(const Brdf& brdf, const Inspection& found, ordered_json& json) {
  auto& warnings = json["warnings"];
  const auto* list = dynamic_cast<const SampleListBrdf*>(&brdf);
  const auto negative =
      list != nullptr ? reflectance::negative_values(list->samples()) : reflectance::negative_values(brdf);
  if (negative.count > 0) {
    json["negative_values"] = {{"count", negative.count}, {"of", negative.of}, {"least", negative.least}};
    warnings.push_back(fmt::format(
        "{} of {} values are negative, down to {:.3g}{}: noise below the "
        "instrument's zero, or a mistake{}",
        negative.count, negative.of, negative.least, negative.count_as_0 ? " in the file's table" : " 1/sr",
        negative.count_as_0 ? "; they count as 0" : ""));
  }
  if (found.available_incidences > found.incidences.size()) {
    warnings.push_back(fmt::format("{} of its {} incidences are looked at, spread over them",
                                   found.incidences.size(), found.available_incidences));
  }
}

}  // namespace

Answer describe_brdf(const std::string& name, const Brdf& brdf) {
  const Inspection found = reflectance::inspect(brdf);
  Answer answer;
  auto& json = answer.json;
  const char* type = brdf.type() == reflectance::ScatterType::kBtdf ? "BTDF" : "BRDF";
  const std::vector<float> wavelengths(brdf.wavelengths_nm().begin(), brdf.wavelengths_nm().end());
  std::vector<double> incidences_deg;
  for (const auto& incidence : found.incidences) {
    incidences_deg.push_back(degrees(incidence.theta_i));
  }
  json = {{"kind", "brdf"},
          {"name", name},
          {"type", type},
          {"channels", brdf.channels()},
          {"wavelengths_nm", wavelengths},
          {"incidences_deg", incidences_deg},
          {"coverage", to_json(found.origin_shares)},
          {"energy", energy_json(found.energy)},
          {"reciprocity", to_json(found.reciprocity)},
          {"mirror_symmetry", to_json(found.mirror_symmetry)},
          {"warnings", ordered_json::array()}};
  Rows rows = {{type, name},
               {"channels", wavelengths.empty()
                                ? std::to_string(brdf.channels())
                                : fmt::format("{} at {} nm", brdf.channels(), fmt::join(wavelengths, ", "))}};
  if (std::string shape = shape_of(brdf); !shape.empty()) {
    rows.push_back({"grid", std::move(shape)});
  }
  const OriginShares& share = found.origin_shares;
  rows.push_back({"coverage", fmt::format("of the hemisphere {:.1f} % measured, {:.1f} % interpolated, "
                                          "{:.1f} % extrapolated, {:.1f} % without a value",
                                          100 * share[1], 100 * share[2], 100 * share[3], 100 * share[0])});
  rows.push_back({"energy", energy_text(found)});
  if (brdf.type() == reflectance::ScatterType::kBrdf) {
    rows.push_back({"reciprocity", text_of(found.reciprocity, "f(a to b) and f(b to a)")});
  }
  rows.push_back({"symmetry", text_of(found.mirror_symmetry, "the halves beside the plane of incidence")});
  add_warnings(brdf, found, json);
  std::string tables;
  add_incidences(brdf, found, json, tables);
  add_totals(found, json, tables);
  for (const auto& warning : json["warnings"]) {
    rows.push_back({"warning", warning.get<std::string>()});
  }
  if (const auto* metadata = metadata_of(brdf)) {
    json["metadata"] = *metadata;
    for (const auto& [key, value] : *metadata) {
      // The reader's notes on totals say in sentences what the table below shows.
      if (key != "notes" || json["tis"].empty()) {
        add_lines(key, value, rows);
      }
    }
  }
  answer.text = text_table(rows) + tables;
  return answer;
}

}  // namespace scatter::cli
