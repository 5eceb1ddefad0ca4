#include "tools/scatter/measurement_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tools/plot/canvas.h"
#include "tools/plot/ticks.h"
#include "tools/scatter/version.h"

namespace scatter::cli {
namespace {

using measurement::Measurement;
using measurement::Verdict;
using reflectance::Origin;

plot::Mark mark(Verdict verdict) {
  switch (verdict) {
    case Verdict::kOk:
      return plot::Mark::kOk;
    case Verdict::kWarn:
      return plot::Mark::kWarn;
    case Verdict::kFail:
      return plot::Mark::kFail;
    case Verdict::kCannotTell:
      return plot::Mark::kCannotTell;
  }
  return plot::Mark::kCannotTell;
}

/// "tilt_x_deg" as "tilt x [deg]": the last word of a name is its unit when it is one.
std::string readable(const std::string& name) {
  std::string text = name;
  for (const char* unit : {"deg", "s", "K", "percent", "sr", "nm"}) {
    const std::string ending = std::string("_") + unit;
    if (text.ends_with(ending)) {
      text = text.substr(0, text.size() - ending.size()) + " [" + unit + "]";
    }
  }
  std::ranges::replace(text, '_', ' ');
  return text;
}

std::string verdict_text(const Measurement& measurement) {
  std::string names;
  for (const auto& item : measurement.quality) {
    if (item.verdict == Verdict::kWarn || item.verdict == Verdict::kFail) {
      names += (names.empty() ? "" : ", ") + readable(item.name);
    }
  }
  return names.empty()
             ? fmt::format("All {} checks passed or had nothing to object.", measurement.quality.size())
             : "Look at: " + names + ". The table of checks says what to do.";
}

/// Share of the nodes' solid angle that was measured, and the median relative standard uncertainty there.
struct Coverage {
  double measured = 0;
  double median_uncertainty = 0;
};

Coverage coverage(const reflectance::GridBrdf& brdf) {
  double measured = 0;
  double whole = 0;
  std::vector<float> relative;
  for (const auto& part : brdf.content().parts) {
    for (std::size_t node = 0; node < part.origin.size(); ++node) {
      const double solid_angle_sr = brdf.solid_angle_sr(node);
      whole += solid_angle_sr;
      if (part.origin[node] != Origin::kMeasured) {
        continue;
      }
      measured += solid_angle_sr;
      for (std::size_t c = 0; c < part.random_per_sr.size() && c < part.systematic_per_sr.size(); ++c) {
        if (part.f_per_sr[c][node] > 0) {
          relative.push_back(std::hypot(part.random_per_sr[c][node], part.systematic_per_sr[c][node]) /
                             part.f_per_sr[c][node]);
        }
      }
    }
  }
  Coverage result{.measured = whole > 0 ? measured / whole : 0};
  if (!relative.empty()) {
    const auto middle = relative.begin() + std::ptrdiff_t(relative.size() / 2);
    std::ranges::nth_element(relative, middle);
    result.median_uncertainty = double(*middle);
  }
  return result;
}

}  // namespace

std::string report_subtitle(const Measurement& measurement) {
  return fmt::format("{} {}", measurement.descriptor.product.str(), measurement.descriptor.serial.str());
}

plot::ReportContent measurement_report(const Measurement& measurement, const std::string& title,
                                       const std::vector<std::string>& notes) {
  const auto& grid = measurement.brdf.content();
  plot::ReportContent page;
  page.title = title;
  page.subtitle = report_subtitle(measurement);
  page.quantity = grid.type == reflectance::ScatterType::kBtdf ? "BTDF" : "BRDF";
  page.verdict = mark(measurement::overall(measurement.quality));
  page.verdict_text = verdict_text(measurement);
  const Coverage covered = coverage(measurement.brdf);
  page.facts = {
      {"on the instrument's clock", fmt::format("{:.2f} s", measurement.instrument_seconds)},
      {"frames delivered", fmt::format("{} of {}", measurement.ledger.delivered, measurement.ledger.exposed)},
      {"of the grid measured", fmt::format("{:.1f} %", 100 * covered.measured)},
      {"median standard uncertainty", fmt::format("{:.2f} %", 100 * covered.median_uncertainty)}};
  for (const auto& item : measurement.quality) {
    page.quality.push_back({.name = readable(item.name),
                            .value = fmt::format("{:.4g}", item.value),
                            .limit = item.limit == 0 ? "–" : fmt::format("{:.4g}", item.limit),
                            .mark = mark(item.verdict),
                            .advice = item.advice});
  }
  for (std::size_t c = 0; c < grid.channels; ++c) {
    page.albedo_channels.push_back(plot::channel_name(
        c < grid.wavelengths_nm.size() ? double(grid.wavelengths_nm[c]) : 0, c, grid.channels));
  }
  for (const auto& row : measurement.albedo) {
    auto& line = page.albedo.emplace_back();
    line.incidence = plot::angle_text(row.theta_i_rad);
    for (std::size_t c = 0; c < row.albedo.size(); ++c) {
      line.channels.push_back(
          {row.albedo[c], c < row.standard_uncertainty.size() ? row.standard_uncertainty[c] : 0});
    }
  }
  const auto& ledger = measurement.ledger;
  page.ledger = {{"exposed", std::to_string(ledger.exposed)},
                 {"delivered", std::to_string(ledger.delivered)},
                 {"lost by the sensor", std::to_string(ledger.lost_sensor)},
                 {"lost by the instrument", std::to_string(ledger.lost_firmware)},
                 {"lost on the link", std::to_string(ledger.lost_link)},
                 {"lost by the computer", std::to_string(ledger.lost_host)},
                 {"corrupt", std::to_string(ledger.corrupt)},
                 {"balance", ledger.balances() ? "every frame is accounted for" : "does not balance"}};
  page.provenance = {{"recording", measurement.recording_id},
                     {"calibration", measurement.calibration_id},
                     {"instrument", report_subtitle(measurement)},
                     {"program", fmt::format("OpenScatter {}", kVersion)}};
  for (const auto& note : notes) {
    page.provenance.push_back({"note", note});
  }
  for (const auto& [key, value] : grid.metadata) {
    // Those that the rows above and the table of checks hold already are left out.
    if (value != measurement.recording_id && value != measurement.calibration_id && key != "quality") {
      page.provenance.push_back({key, value});
    }
  }
  return page;
}

}  // namespace scatter::cli
