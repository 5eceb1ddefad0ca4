#include "tools/scatter/measure_spots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "host_sdk/formats/native_exr.h"
#include "simulator/instrument/virtual_instrument.h"
#include "simulator/samples/sample.h"
#include "tools/plot/canvas.h"
#include "tools/plot/hemispheres.h"
#include "tools/plot/ticks.h"
#include "tools/scatter/device_access.h"
#include "tools/scatter/files.h"
#include "tools/scatter/results.h"
#include "tools/scatter/spot_statistics.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/version.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;
using measurement::Measurement;
using nlohmann::ordered_json;

/// 1/g and 1/g^2 of the plastic number g.
constexpr double kStepU = 0.7548776662466927;
constexpr double kStepV = 0.5698402909980532;

/// An instrument that can be brought to another place of its sample.
struct Movable {
  std::optional<device::Device> device;
  std::shared_ptr<simulator::VirtualInstrument> simulated;  ///< Null for instruments elsewhere.
  std::function<bool(const std::string&)> ask;

  /// Before spot k (from 0). Returns where it is, for spots.json.
  Result<ordered_json> move(int k, int spots) const {
    ordered_json where = ordered_json::object();
    if (simulated == nullptr) {
      const std::string instruction = fmt::format("Move the instrument to place {} of {}.", k + 1, spots);
      if (k > 0 && !ask(instruction)) {
        return fail(ErrorCode::kAborted, "spots: stopped on request", "start again when ready");
      }
      return where;
    }
    const auto first = simulated->sample();
    if (const auto place = first->surface().place()) {
      if (k > 0) {
        const auto moved =
            first->moved({std::fmod(place->u + kStepU, 1.0), std::fmod(place->v + kStepV, 1.0)});
        if (const Status put = simulated->put(moved); !put) {
          return std::unexpected(put.error());
        }
      }
      const auto now = simulated->sample();
      where["u"] = now->surface().place()->u;
      where["v"] = now->surface().place()->v;
      where["sample"] = now->surface_spec();
    }
    return where;
  }
};

Result<Movable> open_movable(const SpotsRequest& request, const Context& context) {
  Movable movable;
  if (request.uri.starts_with("sim:")) {
    const auto uri = device::parse_uri(request.uri);
    if (!uri) {
      return std::unexpected(uri.error());
    }
    auto instrument = tools::make_sim_instrument(*uri);
    if (!instrument) {
      return std::unexpected(instrument.error());
    }
    movable.simulated = *instrument;
    device::OpenOptions options;
    options.wait = {.timeout = std::chrono::seconds(10), .stop = context.stop};
    options.build_id = kVersion;
    auto device = device::Device::open(tools::make_sim_transport(*instrument), options);
    if (!device) {
      return std::unexpected(device.error());
    }
    movable.device = std::move(*device);
    return movable;
  }
  movable.ask = person_at_terminal(context.stop);
  if (!movable.ask) {
    return fail(
        ErrorCode::kFailedPrecondition,
        fmt::format("--spots {}: there is nobody at a terminal to move the instrument", request.spots),
        "run it on a terminal, or measure each place by itself without --spots");
  }
  auto device = open_device(request.uri, context);
  if (!device) {
    return std::unexpected(device.error());
  }
  movable.device = std::move(*device);
  return movable;
}

/// One finished spot.
struct Spot {
  std::string folder;
  ordered_json where;
  Measurement measurement;
};

/// Deviation between spots in units of their own uncertainty.
std::optional<double> ratio(const SpotSpread& spread) {
  return spread.uncertainty > 0 ? std::optional(spread.deviation / spread.uncertainty) : std::nullopt;
}

ordered_json to_json(const std::optional<SpotSpread>& spread) {
  if (!spread) {
    return nullptr;
  }
  return {
      {"mean", spread->mean},
      {"standard_deviation", spread->deviation},
      {"measurement_uncertainty", spread->uncertainty},
      {"deviation_over_uncertainty", ratio(*spread) ? ordered_json(*ratio(*spread)) : ordered_json(nullptr)}};
}

std::string cell(const std::optional<SpotSpread>& spread) {
  if (!spread) {
    return "not measured";
  }
  const auto times = ratio(*spread);
  return fmt::format("{:.4g} ± {:.2g}{}", spread->mean, spread->deviation,
                     times ? fmt::format(" ({:.1f}u)", *times) : "");
}

/// Peak, diffuse part and albedo of every incidence and channel over all spots.
struct Spread {
  ordered_json json = ordered_json::array();
  std::string text;
  std::vector<std::string> lines;  ///< The same for the page, one incidence and channel each.
};

Spread spread_over(const std::vector<Spot>& spots) {
  Spread result;
  const auto& grid = spots.front().measurement.brdf.content();
  std::vector<std::vector<std::string>> rows = {{"incidence", "channel", "peak", "diffuse", "albedo"}};
  for (std::size_t part = 0; part < grid.parts.size(); ++part) {
    std::vector<std::vector<SpotFigures>> figures;
    for (const Spot& spot : spots) {
      figures.push_back(spot_figures(spot.measurement.brdf, part));
    }
    ordered_json row = {{"theta_i_deg", reflectance::degrees(grid.parts[part].theta_i)},
                        {"phi_i_deg", reflectance::degrees(grid.parts[part].phi_i)},
                        {"channels", ordered_json::array()}};
    for (std::size_t c = 0; c < grid.channels; ++c) {
      const auto over = [&](std::optional<SpotFigure> SpotFigures::* which) {
        std::vector<std::optional<SpotFigure>> values;
        for (const auto& spot : figures) {
          values.push_back(spot[c].*which);
        }
        return spread_of(values);
      };
      const auto peak = over(&SpotFigures::peak);
      const auto diffuse = over(&SpotFigures::diffuse);
      const auto share = over(&SpotFigures::share);
      const auto albedo = over(&SpotFigures::albedo);
      const double wavelength =
          c < grid.wavelengths_nm.size() ? static_cast<double>(grid.wavelengths_nm[c]) : 0.0;
      row["channels"].push_back({{"wavelength_nm", wavelength},
                                 {"peak_per_sr", to_json(peak)},
                                 {"diffuse_per_sr", to_json(diffuse)},
                                 {"diffuse_share", to_json(share)},
                                 {"albedo", to_json(albedo)}});
      rows.push_back({c == 0 ? plot::angle_text(grid.parts[part].theta_i) : "",
                      plot::channel_name(wavelength, c, grid.channels), cell(peak), cell(diffuse),
                      cell(albedo)});
      result.lines.push_back(fmt::format("between spots, {}, {}: peak {}, diffuse part {}, albedo {}",
                                         plot::angle_text(grid.parts[part].theta_i),
                                         plot::channel_name(wavelength, c, grid.channels), cell(peak),
                                         cell(diffuse), cell(albedo)));
    }
    result.json.push_back(std::move(row));
  }
  result.text = text_table(rows);
  return result;
}

/// Mean, deviation, pictures and spots.json; returns the paths written.
Result<std::vector<std::string>> write_combined(const SpotsRequest& request, const std::vector<Spot>& spots,
                                                const Spread& spread, const ordered_json& summary) {
  std::vector<const reflectance::GridBrdf*> grids;
  std::vector<const Measurement*> measurements;
  for (const Spot& spot : spots) {
    grids.push_back(&spot.measurement.brdf);
    measurements.push_back(&spot.measurement);
  }
  auto combined = combine_spots(grids);
  if (!combined) {
    return std::unexpected(combined.error());
  }
  const fs::path folder = request.folder;
  const auto mean = mean_measurement(measurements, std::move(combined->mean));
  std::vector<std::string> notes{fmt::format(
      "mean of {} spots; mean ± standard deviation between them below (u: in units of a spot's own "
      "uncertainty), direction by direction in deviation.exr",
      spots.size())};
  notes.insert(notes.end(), spread.lines.begin(), spread.lines.end());
  auto files = write_results(mean, {.folder = folder,
                                    .title = fmt::format("{}, mean of {} spots", request.title, spots.size()),
                                    .notes = notes});
  if (!files) {
    return files;
  }
  const auto picture = plot::hemispheres(
      combined->deviation,
      {.title = fmt::format("standard deviation between {} spots", spots.size()), .subtitle = request.title});
  if (!picture) {
    return std::unexpected(picture.error());
  }
  const auto exr = formats::encode_native_exr(combined->deviation);
  if (!exr) {
    return std::unexpected(exr.error());
  }
  const std::string json = summary.dump(2) + "\n";
  for (const auto& [name, bytes] : {std::pair<const char*, const std::string*>{"deviation.exr", &*exr},
                                    {"deviation.png", &*picture},
                                    {"spots.json", &json}}) {
    const fs::path path = folder / name;
    if (const auto written = write_file(path, *bytes); !written) {
      return std::unexpected(written.error());
    }
    files->push_back(path.string());
  }
  return files;
}

/// Measures one spot, calibrating at the first; `references` is then kept for all.
Result<Measurement> measure_one(device::Device& device, measurement::MeasureOptions& how,
                                const fs::path& folder, const std::string& title) {
  if (const auto ready = prepare_folder(folder); !ready) {
    return std::unexpected(ready.error());
  }
  how.recording = folder / "recording.scat";
  auto measured = measurement::measure(device, how);
  if (!measured) {
    return std::unexpected(measured.error());
  }
  if (!measured->measurement) {
    return std::unexpected(*measured->uncalibrated);
  }
  if (measured->calibration) {
    how.references = measured->calibration->references;
    how.process.references = how.references;
  }
  const auto files = write_results(*measured->measurement, {.folder = folder, .title = title, .notes = {}});
  if (!files) {
    return std::unexpected(files.error());
  }
  return std::move(*measured->measurement);
}

}  // namespace

Result<Answer> measure_spots(const SpotsRequest& request, const Context& context, Progress& bar) {
  auto movable = open_movable(request, context);
  if (!movable) {
    return std::unexpected(movable.error());
  }
  measurement::MeasureOptions how = request.how;
  std::vector<Spot> spots;
  std::optional<Error> ended;
  for (int k = 0; k < request.spots && !ended; ++k) {
    how.calibrate.progress = [&](double fraction, const std::string& what) {
      bar.show((k + fraction) / request.spots, fmt::format("spot {} of {}: {}", k + 1, request.spots, what));
    };
    auto where = movable->move(k, request.spots);
    if (!where) {
      ended = where.error();
      break;
    }
    const std::string name = fmt::format("spot-{:02}", k + 1);
    const fs::path folder = fs::path(request.folder) / name;
    auto one = measure_one(*movable->device, how, folder, fmt::format("{}, spot {}", request.title, k + 1));
    if (!one) {
      ended = one.error();
      break;
    }
    spots.push_back({folder.string(), std::move(*where), std::move(*one)});
  }
  bar.clear();
  if (spots.empty()) {
    return std::unexpected(*ended);
  }

  Answer answer;
  const Spread spread = spread_over(spots);
  answer.json["spots_wanted"] = request.spots;
  answer.json["spots_measured"] = spots.size();
  auto& list = answer.json["spots"] = ordered_json::array();
  bool balanced = true;
  for (const Spot& spot : spots) {
    ordered_json entry = {{"folder", spot.folder}};
    entry.update(spot.where);
    entry.update(summary_json(spot.measurement));
    list.push_back(std::move(entry));
    balanced = balanced && spot.measurement.ledger.balances();
  }
  answer.json["spread"] = spread.json;
  if (ended) {
    answer.json["error"] = {{"code", name(ended->code)}, {"what", ended->what}, {"remedy", ended->remedy}};
  }
  const auto files = write_combined(request, spots, spread, answer.json);
  if (!files) {
    return std::unexpected(files.error());
  }
  answer.json["files"] = *files;
  answer.text = fmt::format(
      "{} of {} spots measured with one calibration; mean ± standard deviation between "
      "spots (u: in units of a spot's own uncertainty):\n{}",
      spots.size(), request.spots, spread.text);
  if (ended) {
    answer.text += fmt::format("ended early: {}; {}\n", ended->what, ended->remedy);
  }
  for (const auto& file : *files) {
    answer.text += file + "\n";
  }
  answer.failed = ended.has_value() || !balanced;
  return answer;
}

}  // namespace scatter::cli
