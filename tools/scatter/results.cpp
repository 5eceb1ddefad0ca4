#include "tools/scatter/results.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <optional>

#include "host_sdk/formats/minidiff.h"
#include "host_sdk/formats/native_exr.h"
#include "tools/plot/curves.h"
#include "tools/plot/hemispheres.h"
#include "tools/plot/report.h"
#include "tools/plot/ticks.h"
#include "tools/scatter/files.h"
#include "tools/scatter/measurement_json.h"
#include "tools/scatter/measurement_report.h"
#include "tools/scatter/text_table.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;
using measurement::Measurement;
using nlohmann::ordered_json;

Status write(const fs::path& path, const Result<std::string>& bytes) {
  return bytes ? write_file(path, *bytes) : Status(std::unexpected(bytes.error()));
}

}  // namespace

Result<std::vector<std::string>> write_results(const Measurement& measurement,
                                               const ResultsRequest& request) {
  const fs::path exr = request.folder / "brdf.exr";
  const fs::path bsdf = request.folder / "brdf.bsdf";
  const fs::path quality = request.folder / "quality.json";
  const fs::path lobe = request.folder / "lobe.png";
  const fs::path page = request.folder / "report.html";

  Status exr_done;
  Status bsdf_done;
  Result<std::string> picture;
  std::array<Result<std::string>, 2> lines;
  const auto subtitle = report_subtitle(measurement);
  tbb::parallel_invoke([&] { exr_done = write(exr, formats::encode_native_exr(measurement.brdf)); },
                       [&] { bsdf_done = write(bsdf, formats::encode_minidiff(measurement.brdf)); },
                       [&] {
                         // All drawing in one thread: cairo's font cache is shared, and the rounding of
                         // glyphs depends on who filled it, which would make the same measurement's pictures
                         // differ now and then.
                         picture = plot::hemispheres(measurement.brdf,
                                                     {.title = request.title, .subtitle = subtitle});
                         const plot::NamedBrdf one[] = {{"measured", &measurement.brdf}};
                         plot::CurveOptions options{.incidences = plot::incidences_of(measurement.brdf)};
                         options.incidences.resize(std::min<std::size_t>(options.incidences.size(), 24));
                         lines[0] = plot::curves(one, options);
                         options.theme = plot::Theme::kDark;
                         lines[1] = plot::curves(one, options);
                       });
  for (const Status* done : {&exr_done, &bsdf_done}) {
    if (!*done) {
      return std::unexpected(done->error());
    }
  }
  for (const auto* drawn : {&picture, &lines[0], &lines[1]}) {
    if (!*drawn) {
      return std::unexpected(drawn->error());
    }
  }
  auto content = measurement_report(measurement, request.title, request.notes);
  content.hemispheres_png = *picture;
  content.curves_light_svg = *lines[0];
  content.curves_dark_svg = *lines[1];
  for (const auto& [path, bytes] : {std::pair{quality, summary_json(measurement).dump(2) + "\n"},
                                    std::pair{lobe, *picture}, std::pair{page, plot::report(content)}}) {
    if (auto written = write_file(path, bytes); !written) {
      return std::unexpected(written.error());
    }
  }
  return std::vector<std::string>{exr.string(), bsdf.string(), quality.string(), lobe.string(),
                                  page.string()};
}

ordered_json summary_json(const Measurement& measurement) {
  const auto& tilt = measurement.tilt;
  return {{"ledger", to_json(measurement.ledger)},
          {"instrument_seconds", measurement.instrument_seconds},
          {"quality", to_json(measurement.quality)},
          {"verdict", measurement::name(measurement::overall(measurement.quality))},
          {"albedo", to_json(measurement.albedo)},
          {"tilt",
           {{"x_deg", reflectance::degrees(tilt.x_rad)},
            {"y_deg", reflectance::degrees(tilt.y_rad)},
            {"standard_error_deg", reflectance::degrees(tilt.standard_error_rad)},
            {"told", tilt.told}}},
          {"recording_id", measurement.recording_id},
          {"calibration_id", measurement.calibration_id}};
}

std::string summary_text(const Measurement& measurement) {
  std::string text;
  const bool transmitted = measurement.brdf.type() == reflectance::ScatterType::kBtdf;
  std::vector<std::vector<std::string>> rows = {{"incidence", transmitted
                                                                  ? "transmittance over the measured region"
                                                                  : "albedo over the measured region"}};
  for (const auto& row : measurement.albedo) {
    rows.push_back({plot::angle_text(row.theta_i_rad), numbers(row.albedo, 4)});
  }
  text += text_table(rows);
  rows.clear();
  for (const auto& item : measurement.quality) {
    if (item.verdict != measurement::Verdict::kOk) {
      rows.push_back({std::string(measurement::name(item.verdict)), item.name,
                      fmt::format("{:.4g} (limit {:.4g})", item.value, item.limit), item.advice});
    }
  }
  text += fmt::format("quality: {}\n", measurement::name(measurement::overall(measurement.quality)));
  return text + text_table(rows, "  ");
}

}  // namespace scatter::cli
