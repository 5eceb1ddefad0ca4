// scatter measure URI -o DIR: calibrates when needed, records, processes, writes everything.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <chrono>
#include <memory>

#include "host_sdk/reflectance/direction.h"
#include "tools/scatter/device_access.h"
#include "tools/scatter/files.h"
#include "tools/scatter/measure_options.h"
#include "tools/scatter/measure_spots.h"
#include "tools/scatter/measurement_json.h"
#include "tools/scatter/results.h"
#include "tools/scatter/usb_target.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  RecordingChoice recording;
  std::string output;
  std::string title;
  bool correct_tilt = false;
  bool on_button = false;
  int spots = 1;
  double rotation_deg = 0;
};

/// What a URI says of the sample, else the URI.
std::string title_of(const std::string& uri) {
  const auto start = uri.find("sample=");
  if (start == std::string::npos) {
    return uri;
  }
  return uri.substr(start + 7, uri.find('&', start) - start - 7);
}

/// The frames are recorded, but nothing can be made of them yet.
Result<Answer> uncalibrated(const measurement::MeasureResult& measured, const fs::path& recording,
                            const Context& context) {
  if (!context.json) {
    return std::unexpected(*measured.uncalibrated);
  }
  Answer answer;
  answer.json["ledger"] = to_json(measured.ledger);
  answer.json["instrument_seconds"] = measured.instrument_seconds;
  answer.json["wall_seconds"] = measured.wall_seconds;
  answer.json["quality"] = to_json(measured.quality);
  answer.json["verdict"] = measurement::name(measurement::overall(measured.quality));
  answer.json["files"] = {recording.string()};
  answer.json["error"] = {{"code", name(measured.uncalibrated->code)},
                          {"what", measured.uncalibrated->what},
                          {"remedy", measured.uncalibrated->remedy}};
  answer.failed = true;
  return answer;
}

Result<Answer> run(const Options& options, const Context& context) {
  Progress bar;
  auto how = measure_options(options.recording, context, bar);
  if (!how) {
    return std::unexpected(how.error());
  }
  if (const auto ready = prepare_folder(options.output); !ready) {
    return std::unexpected(ready.error());
  }
  how->process.correct_tilt = options.correct_tilt;
  how->process.sample_rotation_rad = reflectance::radians(options.rotation_deg);
  const std::string title = options.title.empty() ? title_of(options.recording.uri) : options.title;
  if (options.on_button) {
    if (const Status pressed = wait_for_button(options.recording.uri, context); !pressed) {
      return std::unexpected(pressed.error());
    }
  }
  if (options.spots > 1) {
    return measure_spots({.uri = options.recording.uri,
                          .folder = options.output,
                          .title = title,
                          .spots = options.spots,
                          .how = *how},
                         context, bar);
  }
  auto device = open_device(options.recording.uri, context);
  if (!device) {
    return std::unexpected(device.error());
  }
  const fs::path folder = options.output;
  how->recording = folder / "recording.scat";
  const auto measured = measurement::measure(*device, *how);
  if (!measured) {
    bar.clear();
    return std::unexpected(measured.error());
  }
  if (!measured->measurement) {
    bar.clear();
    return uncalibrated(*measured, how->recording, context);
  }
  const measurement::Measurement& result = *measured->measurement;
  bar.show(1, "writing results");
  const auto start = std::chrono::steady_clock::now();
  ResultsRequest request{.folder = folder, .title = title, .notes = {}};
  if (options.correct_tilt) {
    request.notes.push_back("corrected for the estimated tilt");
  }
  const auto files = write_results(result, request);
  bar.clear();
  if (!files) {
    return std::unexpected(files.error());
  }
  const double wall_seconds = measured->wall_seconds +
                              std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  Answer answer;
  answer.json = summary_json(result);
  answer.json["wall_seconds"] = wall_seconds;
  answer.json["calibration"] = {
      {"performed", measured->calibration.has_value()},
      {"instrument_seconds", measured->calibration ? measured->calibration->instrument_seconds : 0.0},
      {"wall_seconds", measured->calibration ? measured->calibration->wall_seconds : 0.0},
      {"id", result.calibration_id}};
  auto& list = answer.json["files"] = nlohmann::ordered_json::array({how->recording.string()});
  for (const auto& file : *files) {
    list.push_back(file);
  }
  if (measured->calibration) {
    answer.text +=
        fmt::format("calibrated itself first: {:.1f} s on the instrument's clock ({:.1f} s here)\n",
                    measured->calibration->instrument_seconds, measured->calibration->wall_seconds);
  }
  answer.text += fmt::format("measured in {:.2f} s on the instrument's clock ({:.1f} s here), {}\n",
                             result.instrument_seconds, wall_seconds, words(result.ledger));
  answer.text += summary_text(result);
  for (const auto& file : list) {
    answer.text += file.get<std::string>() + "\n";
  }
  answer.failed = !result.ledger.balances();
  return answer;
}

}  // namespace

Verb add_measure(CLI::App& root) {
  auto* app = root.add_subcommand(
      "measure", "Measure a sample: calibrated BRDF with uncertainty, quality report, pictures");
  auto options = std::make_shared<Options>();
  add_options(*app, options->recording);
  app->add_option("-o,--output", options->output, "Folder for the results")->required();
  app->add_option("--title", options->title, "Name of the sample in pictures and report");
  app->add_flag("--correct-tilt", options->correct_tilt, "Correct for the estimated tilt of the sample");
  app->add_option("--rotation", options->rotation_deg, "The sample is turned by this on its mount [deg]")
      ->check(CLI::Range(-360.0, 360.0));
  app->add_flag("--on-button", options->on_button,
                "Begin when the instrument's measure button is pressed (usb: only)");
  app->add_option("--spots", options->spots,
                  "Measure this many places of the sample: each one's files, their mean and how they differ")
      ->check(CLI::Range(1, kMostSpots));
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
