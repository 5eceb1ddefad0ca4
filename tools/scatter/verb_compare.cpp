// scatter compare A B: how far two BRDFs are apart; B is the reference.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <memory>

#include "host_sdk/reflectance/compare.h"
#include "tools/plot/curves.h"
#include "tools/plot/ticks.h"
#include "tools/scatter/files.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

using reflectance::degrees;

struct Options {
  std::string a;
  std::string b;
  std::string region = "measured";
  std::string picture;
};

nlohmann::ordered_json or_null(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

/// What the figures do not say by themselves.
std::vector<std::string> remarks(const reflectance::Comparison& found, reflectance::ScatterType type) {
  using By = reflectance::ChannelMatch::By;
  std::vector<std::string> out;
  const auto straight = std::ranges::max_element(found.incidences, {}, [](const auto& incidence) {
    return std::abs(incidence.dirac_a - incidence.dirac_b);
  });
  if (straight != found.incidences.end() && straight->dirac_a != straight->dirac_b) {
    out.push_back(fmt::format(
        "the {} shares differ: {:.4f} against {:.4f} of the reference at {}; no direction's value holds "
        "them, the albedo errors do",
        type == reflectance::ScatterType::kBtdf ? "straight (unscattered)" : "mirror (unscattered)",
        straight->dirac_a, straight->dirac_b, plot::angle_text(straight->theta_i)));
  }
  if (!found.relative_errors_known) {
    out.emplace_back("the reference is 0 or less in every direction compared: no relative error can be told");
  }
  if (found.channels.by == By::kOneForAll) {
    out.emplace_back("one channel stands against every channel of the other");
  } else if (found.channels.by == By::kWavelength) {
    out.emplace_back("every channel stands against the one of the nearest wavelength");
  } else if (found.channels.by == By::kAssumedRgb) {
    out.emplace_back(
        "three channels without wavelengths are taken as red, green, blue at 650, 550, 450 nm, "
        "and every channel stands against the nearest one");
  }
  if (found.available_incidences > found.incidences.size()) {
    out.push_back(fmt::format("compared at {} of {} incidences, spread over them", found.incidences.size(),
                              found.available_incidences));
  }
  return out;
}

nlohmann::ordered_json to_json(const reflectance::Comparison& found, const std::string& region) {
  const auto relative = [&](double value) {
    return found.relative_errors_known ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
  };
  nlohmann::ordered_json json = {{"region", region},
                                 {"bins", found.bins},
                                 {"bins_without_reference", found.bins_without_reference},
                                 {"median_relative_error", relative(found.median_relative_error)},
                                 {"mean_relative_error", relative(found.mean_relative_error)},
                                 {"p95_relative_error", relative(found.p95_relative_error)},
                                 {"p99_relative_error", relative(found.p99_relative_error)},
                                 {"cosine_weighted_rms_per_sr", found.cosine_weighted_rms_per_sr},
                                 {"log_rms", found.log_rms}};
  auto& albedo = json["albedo_error"] = nlohmann::ordered_json::array();
  auto& incidences = json["incidences"] = nlohmann::ordered_json::array();
  for (const auto& incidence : found.incidences) {
    albedo.push_back(incidence.albedo_error);
    incidences.push_back({{"rotation_deg", degrees(incidence.rotation_rad)},
                          {"theta_i_deg", degrees(incidence.theta_i)},
                          {"phi_i_deg", degrees(incidence.phi_i)},
                          {"bins", incidence.bins},
                          {"albedo_error", incidence.albedo_error},
                          {"dirac", incidence.dirac_a},
                          {"dirac_reference", incidence.dirac_b},
                          {"peak_angle_error_deg", or_null(incidence.peak_angle_error_deg)},
                          {"peak_ratio", or_null(incidence.peak_ratio)}});
  }
  json["peak_angle_error_deg"] = or_null(found.peak_angle_error_deg);
  json["peak_ratio"] = or_null(found.peak_ratio);
  if (found.reduced_chi_square) {
    json["reduced_chi_square"] = *found.reduced_chi_square;
  }
  if (found.coverage_95) {
    json["coverage_95"] = *found.coverage_95;
  }
  return json;
}

std::string to_text(const reflectance::Comparison& found) {
  const auto percent = [](double value) { return fmt::format("{:.3f} %", 100 * value); };
  const auto relative = [&](double value) {
    return found.relative_errors_known ? percent(value) : std::string("cannot be told");
  };
  std::vector<std::vector<std::string>> rows = {
      {"bins compared", std::to_string(found.bins)},
      {"relative error, median", relative(found.median_relative_error)},
      {"relative error, mean", relative(found.mean_relative_error)},
      {"relative error, 95th percentile", relative(found.p95_relative_error)},
      {"relative error, 99th percentile", relative(found.p99_relative_error)}};
  const bool turned = std::ranges::any_of(found.incidences, [&](const auto& incidence) {
    return incidence.theta_i > 0 && std::abs(incidence.phi_i - found.incidences.back().phi_i) > 1e-9;
  });
  for (const auto& incidence : found.incidences) {
    const bool nothing = incidence.bins == 0 && incidence.albedo_error == 0;
    rows.push_back(
        {"albedo error at " + plot::angle_text(incidence.theta_i) +
             (turned ? ", azimuth " + plot::angle_text(incidence.phi_i) : std::string()),
         nothing ? std::string("no direction in common") : fmt::format("{:.5f}", incidence.albedo_error)});
  }
  if (found.peak_angle_error_deg) {
    rows.push_back({"peak off by, worst incidence", fmt::format("{:.3f} deg", *found.peak_angle_error_deg)});
  }
  if (found.peak_ratio) {
    rows.push_back({"peak ratio, worst incidence", fmt::format("{:.4f}", *found.peak_ratio)});
  }
  if (found.reduced_chi_square) {
    rows.push_back({"reduced chi-square", fmt::format("{:.3f} (1: the stated noise explains the difference)",
                                                      *found.reduced_chi_square)});
  }
  if (found.coverage_95) {
    rows.push_back({"inside the 95 % intervals", percent(*found.coverage_95)});
  }
  return text_table(rows);
}

/// Both in the plane of incidence, one over the other, at a's incidences.
/// Returns   the sentences of the picture's caption.
Result<std::vector<std::string>> draw(const Options& options, const reflectance::Brdf& a,
                                      const reflectance::Brdf& b) {
  const auto kind = plot::image_kind(options.picture);
  if (!kind) {
    return std::unexpected(kind.error());
  }
  const plot::NamedBrdf both[] = {{shown_name(options.a), &a}, {shown_name(options.b), &b}};
  std::vector<std::string> told;
  const auto image = plot::curves(
      both, {.kind = *kind, .incidences = plot::incidences_of(a), .max_panels = 12, .theta_max_deg = 85},
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
  const auto a = open_data(options.a);
  if (!a) {
    return std::unexpected(a.error());
  }
  const auto b = open_data(options.b);
  if (!b) {
    return std::unexpected(b.error());
  }
  const auto region = options.region == "all" ? reflectance::Region::kAll : reflectance::Region::kMeasured;
  const auto found = reflectance::compare(**a, **b, {.region = region});
  if (!found) {
    return std::unexpected(found.error());
  }
  Answer answer{.json = to_json(*found, options.region), .text = to_text(*found)};
  answer.json["remarks"] = nlohmann::ordered_json::array();
  for (const std::string& remark : remarks(*found, (*a)->type())) {
    answer.json["remarks"].push_back(remark);
    answer.text += fmt::format("note: {}\n", remark);
  }
  if (!options.picture.empty()) {
    const auto told = draw(options, **a, **b);
    if (!told) {
      return std::unexpected(told.error());
    }
    answer.json["files"] = {options.picture};
    answer.json["picture_notes"] = *told;
    answer.text += fmt::format("\n{}\n", options.picture);
    for (const std::string& sentence : *told) {
      answer.text += fmt::format("  {}\n", sentence);
    }
  }
  return answer;
}

}  // namespace

Verb add_compare(CLI::App& root) {
  auto* app = root.add_subcommand("compare", "Show how far a BRDF is from a reference");
  auto options = std::make_shared<Options>();
  app->add_option("a", options->a, "File or model that is judged")->required();
  app->add_option("b", options->b, "Reference: file or model")->required();
  app->add_option("--region", options->region, "Which directions count: those measured, or all with a value")
      ->check(CLI::IsMember({"measured", "all"}))
      ->capture_default_str();
  app->add_option("-o,--output", options->picture, "Also draw both in the plane of incidence (.svg or .png)");
  return {app, [options](const Context&) { return run(*options); }};
}

}  // namespace scatter::cli
