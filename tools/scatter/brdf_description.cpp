#include "tools/scatter/brdf_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "tools/plot/curves.h"
#include "tools/plot/ticks.h"
#include "tools/scatter/text_table.h"

namespace scatter::cli {
namespace {

using nlohmann::ordered_json;
using reflectance::Brdf;
using reflectance::degrees;
using reflectance::Direction;
using reflectance::GridBrdf;
using reflectance::Origin;
using reflectance::radians;
using reflectance::Region;
using reflectance::ScatterType;

using Rows = std::vector<std::vector<std::string>>;

/// Albedo per incidence: of the measured nodes of a grid, of the hemisphere for everything else.
double add_albedo(const Brdf& brdf, ordered_json& json, Rows& rows) {
  double largest = 0;
  auto& list = json["albedo"] = ordered_json::array();
  const auto note = [&](double theta_i, const std::vector<double>& values, const char* region) {
    largest = std::max(largest, *std::ranges::max_element(values));
    list.push_back({{"theta_i_deg", degrees(theta_i)}, {"region", region}, {"albedo", values}});
    rows.push_back({"albedo at " + plot::angle_text(theta_i),
                    fmt::format("{} over the {}", numbers(values, 4), region)});
  };
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    for (std::size_t k = 0; k < grid->content().parts.size(); ++k) {
      const auto& part = grid->content().parts[k];
      const bool measured = std::ranges::find(part.origin, Origin::kMeasured) != part.origin.end();
      note(part.theta_i, reflectance::grid_albedo(*grid, k, measured ? Region::kMeasured : Region::kAll),
           measured ? "measured region" : "grid");
    }
    return largest;
  }
  for (const auto& light : plot::incidences_of(brdf)) {
    auto found = reflectance::albedo(brdf, reflectance::from_spherical(light.theta_i, light.phi_i),
                                     {.tolerance = 1e-4});
    for (std::size_t c = 0; c < found.value.size() && c < found.dirac.size(); ++c) {
      found.value[c] += found.dirac[c];
    }
    note(light.theta_i, found.value, "hemisphere");
  }
  return largest;
}

/// Helmholtz reciprocity f(a -> b) = f(b -> a) between pairs of incidences, out of the plane as well.
void add_reciprocity(const Brdf& brdf, ordered_json& json, Rows& rows) {
  if (brdf.type() != ScatterType::kBrdf) {
    return;
  }
  constexpr std::array<double, 4> kThetas_deg = {10, 20, 40, 60};
  std::vector<double> differences;
  std::vector<double> forward(brdf.channels());
  std::vector<double> backward(brdf.channels());
  for (const double a_deg : kThetas_deg) {
    for (const double b_deg : kThetas_deg) {
      for (double phi_deg = 15; a_deg < b_deg && phi_deg <= 180; phi_deg += 15) {
        const Direction a = reflectance::from_spherical(radians(a_deg), 0);
        const Direction b = reflectance::from_spherical(radians(b_deg), radians(phi_deg));
        const auto usable = [](Origin origin) {
          return origin == Origin::kMeasured || origin == Origin::kInterpolated;
        };
        if (!usable(brdf.eval(a, b, forward)) || !usable(brdf.eval(b, a, backward))) {
          continue;
        }
        for (std::size_t c = 0; c < brdf.channels(); ++c) {
          const double mean = 0.5 * (forward[c] + backward[c]);
          if (mean > 0) {
            differences.push_back(std::abs(forward[c] - backward[c]) / mean);
          }
        }
      }
    }
  }
  if (differences.empty()) {
    rows.push_back({"reciprocity", "cannot be told: no pair of directions has a value both ways"});
    json["reciprocity"] = nullptr;
    return;
  }
  std::ranges::sort(differences);
  const double median = differences[differences.size() / 2];
  json["reciprocity"] = {{"pairs", differences.size()},
                         {"median_relative_difference", median},
                         {"largest_relative_difference", differences.back()}};
  rows.push_back({"reciprocity",
                  fmt::format("f(a to b) and f(b to a) differ by {:.2f} % (median of {}), at most {:.2f} %",
                              100 * median, differences.size(), 100 * differences.back())});
}

void add_coverage(const GridBrdf& grid, ordered_json& json, Rows& rows) {
  std::array<double, 4> share{};
  double whole = 0;
  for (const auto& part : grid.content().parts) {
    for (std::size_t node = 0; node < part.origin.size(); ++node) {
      const double solid_angle_sr = grid.solid_angle_sr(node);
      share.at(static_cast<std::size_t>(part.origin[node])) += solid_angle_sr;
      whole += solid_angle_sr;
    }
  }
  for (double& each : share) {
    each /= whole;
  }
  json["coverage"] = {
      {"measured", share[1]}, {"interpolated", share[2]}, {"extrapolated", share[3]}, {"invalid", share[0]}};
  rows.push_back(
      {"coverage", fmt::format("{:.2f} % measured, {:.2f} % interpolated, {:.2f} % extrapolated, {:.2f} % "
                               "without a value",
                               100 * share[1], 100 * share[2], 100 * share[3], 100 * share[0])});
}

}  // namespace

Answer describe_brdf(const std::string& name, const Brdf& brdf) {
  Answer answer;
  auto& json = answer.json;
  const char* type = brdf.type() == ScatterType::kBtdf ? "BTDF" : "BRDF";
  const std::vector<float> wavelengths(brdf.wavelengths_nm().begin(), brdf.wavelengths_nm().end());
  std::vector<double> incidences_deg;
  for (const auto& light : plot::incidences_of(brdf)) {
    incidences_deg.push_back(degrees(light.theta_i));
  }
  json = {{"kind", "brdf"},
          {"name", name},
          {"type", type},
          {"channels", brdf.channels()},
          {"wavelengths_nm", wavelengths},
          {"incidences_deg", incidences_deg}};
  Rows rows = {{type, name},
               {"channels", wavelengths.empty()
                                ? std::to_string(brdf.channels())
                                : fmt::format("{} at {} nm", brdf.channels(), fmt::join(wavelengths, ", "))}};
  const auto* grid = dynamic_cast<const GridBrdf*>(&brdf);
  if (grid != nullptr) {
    const auto& content = grid->content();
    rows.push_back(
        {"grid", fmt::format("{} incidences, {} x {} directions, {:.4g} deg", content.parts.size(),
                             content.theta_count, content.phi_count, degrees(content.theta_step))});
  }
  const double largest = add_albedo(brdf, json, rows);
  json["energy"] = {{"largest_albedo", largest}, {"conserved", largest <= 1}};
  rows.push_back(
      {"energy", largest <= 1 ? "conserved" : "more light leaves than arrives: the data are wrong"});
  add_reciprocity(brdf, json, rows);
  if (grid != nullptr) {
    add_coverage(*grid, json, rows);
    json["metadata"] = grid->content().metadata;
    for (const auto& [key, value] : grid->content().metadata) {
      rows.push_back({key, value});
    }
  }
  answer.text = text_table(rows);
  return answer;
}

}  // namespace scatter::cli
