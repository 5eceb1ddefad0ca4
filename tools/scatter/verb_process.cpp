// scatter process REC.scat ... -o DIR: from recordings to a BRDF, with any calibration.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <chrono>
#include <memory>

#include "host_sdk/measurement/calibrate.h"
#include "host_sdk/reflectance/direction.h"
#include "tools/scatter/files.h"
#include "tools/scatter/measurement_json.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/results.h"

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::vector<std::string> recordings;
  std::string output;
  std::string calibration;
  std::string title;
  std::string merge = "repeats";
  std::vector<double> rotations_deg;
  bool correct_tilt = false;
};

Status check(const Options& options) {
  const std::size_t files = options.recordings.size();
  const std::size_t angles = options.rotations_deg.size();
  if (angles != 0 && angles != files) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{} rotations for {} recordings", angles, files),
                "give one angle per recording, for example --rotation 0 90");
  }
  if (options.merge == "rotations" && angles == 0) {
    return fail(ErrorCode::kInvalidArgument,
                "--merge rotations does not say by how much the sample was turned",
                "add one angle per recording, for example --rotation 0 90");
  }
  return {};
}

Result<Answer> run(const Options& options, const Context& context) {
  if (const auto fine = check(options); !fine) {
    return std::unexpected(fine.error());
  }
  if (const auto ready = prepare_folder(options.output); !ready) {
    return std::unexpected(ready.error());
  }
  measurement::ProcessOptions how;
  how.correct_tilt = options.correct_tilt;
  if (!options.calibration.empty()) {
    auto references = measurement::load_references(options.calibration);
    if (!references) {
      return std::unexpected(references.error());
    }
    how.references = *references;
  }
  const auto start = std::chrono::steady_clock::now();
  Progress bar;
  std::vector<measurement::Measurement> measurements;
  std::size_t raw_bytes = 0;
  for (std::size_t k = 0; k < options.recordings.size(); ++k) {
    bar.show(double(k) / double(options.recordings.size() + 1), options.recordings[k]);
    if (context.stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "stopped before the end", "run again; the recordings are untouched");
    }
    how.sample_rotation_rad =
        options.rotations_deg.empty() ? 0 : reflectance::radians(options.rotations_deg[k]);
    auto measurement = measurement::process(options.recordings[k], how);
    if (!measurement) {
      return std::unexpected(measurement.error());
    }
    raw_bytes += measurement->raw_bytes;
    measurements.push_back(std::move(*measurement));
  }
  auto combined = measurements.size() == 1 ? Result<measurement::Measurement>(std::move(measurements.front()))
                                           : measurement::combine(std::move(measurements));
  if (!combined) {
    return std::unexpected(combined.error());
  }
  const double process_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  bar.show(0.95, "writing results");
  ResultsRequest request{.folder = options.output,
                         .title = options.title.empty()
                                      ? fs::path(options.recordings.front()).filename().string()
                                      : options.title,
                         .notes = {}};
  if (options.recordings.size() > 1) {
    request.notes.push_back(fmt::format("combined from {} recordings", options.recordings.size()));
  }
  if (options.correct_tilt) {
    request.notes.push_back("corrected for the estimated tilt");
  }
  const auto files = write_results(*combined, request);
  bar.clear();
  if (!files) {
    return std::unexpected(files.error());
  }
  Answer answer;
  answer.json = summary_json(*combined);
  answer.json["raw_bytes"] = raw_bytes;
  answer.json["process_seconds"] = process_seconds;
  answer.json["wall_seconds"] =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  answer.json["files"] = *files;
  answer.text = fmt::format("processed {:.0f} MB of raw frames in {:.2f} s, {}\n", double(raw_bytes) * 1e-6,
                            process_seconds, words(combined->ledger));
  answer.text += summary_text(*combined);
  for (const auto& file : *files) {
    answer.text += file + "\n";
  }
  answer.failed = !combined->ledger.balances();
  return answer;
}

}  // namespace

Verb add_process(CLI::App& root) {
  auto* app = root.add_subcommand(
      "process", "Turn recordings into a BRDF, with the calibration they carry or any other");
  auto options = std::make_shared<Options>();
  app->add_option("recordings", options->recordings, "Recordings (.scat) of one sample")->required();
  app->add_option("-o,--output", options->output, "Folder for the results")->required();
  app->add_option("--calibration", options->calibration, "Use this calibration (.scat) instead");
  app->add_option("--title", options->title, "Name of the sample in pictures and report");
  app->add_option("--rotation", options->rotations_deg,
                  "By how much the sample was turned on its mount, one angle per recording [deg]")
      ->delimiter(',');
  app->add_option("--merge", options->merge,
                  "How several recordings combine: repeats of one rotation average, rotations become one "
                  "anisotropic result")
      ->check(CLI::IsMember({"repeats", "rotations"}))
      ->capture_default_str();
  app->add_flag("--correct-tilt", options->correct_tilt, "Correct for the estimated tilt of the sample");
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
