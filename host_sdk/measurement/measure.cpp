#include "host_sdk/measurement/measure.h"

#include <fmt/format.h>

#include <algorithm>

#include "host_sdk/device/device.h"
#include "host_sdk/device/recording_writer.h"
#include "host_sdk/measurement/attachments.h"
#include "host_sdk/measurement/provenance.h"
#include "host_sdk/measurement/recipe_run.h"

namespace scatter::measurement {
namespace {

using protocol::Target;

constexpr std::uint32_t kDefaultBudget_us = 5'000'000;
constexpr std::uint16_t kDefaultSweeps = 3;
constexpr std::uint32_t kProbe_us = 2500;

Geometry geometry_of(const protocol::Descriptor& d, const MeasureOptions& options) noexcept {
  if (options.geometry) {
    return *options.geometry;
  }
  return d.transmission_module != 0 ? Geometry::kTransmission : Geometry::kReflection;
}

std::filesystem::path library_file(const protocol::Descriptor& d, const std::string& id_hex) {
  return library_folder(std::string(d.serial.str())) / (id_hex + ".scat");
}

std::string hex(const protocol::CalibrationId& id) {
  std::string text;
  for (const std::uint8_t byte : id) {
    text += fmt::format("{:02x}", byte);
  }
  return text;
}

/// The device's current reference calibration, if the library has its frames.
std::shared_ptr<const ReferenceSet> from_library(device::Device& device, Target kind, bool& usable_now) {
  usable_now = false;
  const auto states = device.calibration_query();
  if (!states) {
    return nullptr;
  }
  const auto state = std::ranges::find(*states, kind, &protocol::CalibrationKindState::kind);
  if (state == states->end() || state->verdict == protocol::CalibrationVerdict::kNeeded) {
    return nullptr;
  }
  usable_now = state->verdict == protocol::CalibrationVerdict::kValid;
  auto set = load_references(library_file(device.descriptor(), hex(state->id)));
  return set ? *set : nullptr;
}

/// Given, from the library, or newly made; null with calibration impossible or not wanted.
Result<std::shared_ptr<const ReferenceSet>> ensure_references(device::Device& device,
                                                              const MeasureOptions& options,
                                                              Geometry geometry,
                                                              std::optional<Calibration>& made,
                                                              std::string& why_not) {
  if (options.references) {
    return options.references;
  }
  const Target kind =
      geometry == Geometry::kTransmission ? Target::kTranslucentReference : Target::kWhiteReference;
  bool usable_now = false;
  std::shared_ptr<const ReferenceSet> known =
      options.use_library ? from_library(device, kind, usable_now) : nullptr;
  if ((known && usable_now) || !options.calibrate_if_needed) {
    if (!known) {
      why_not = "no calibration was given and none is in the library";
    }
    return known;
  }
  CalibrateOptions calibrate_options = options.calibrate;
  calibrate_options.geometry = geometry;
  auto calibration = calibrate(device, calibrate_options);
  if (!calibration) {
    const ErrorCode code = calibration.error().code;
    if (code == ErrorCode::kAborted || code == ErrorCode::kDisconnected ||
        code == ErrorCode::kDeadlineExceeded) {
      return std::unexpected(calibration.error());
    }
    // Measured without: an expired calibration is better than none, and a recording can be
    // processed with a calibration made later.
    why_not = calibration.error().what;
    return known;
  }
  if (options.use_library) {
    const Status kept =
        save(*calibration->references, library_file(device.descriptor(), calibration->references->id_hex()));
    if (!kept) {
      return std::unexpected(kept.error());
    }
  }
  made = std::move(*calibration);
  return made->references;
}

Result<device::RunSummary> record_run(device::Device& device, const MeasureOptions& options,
                                      const ReferenceSet* references) {
  auto writer =
      device::RecordingWriter::create(options.recording, {device.system_time_unix_ns(), software_version()});
  if (!writer) {
    return std::unexpected(writer.error());
  }
  if (references != nullptr) {
    if (const Status attached = attach(*writer, *references); !attached) {
      return std::unexpected(attached.error());
    }
  }
  const protocol::Recipe recipe =
      options.recipe ? *options.recipe : standard_recipe(device.descriptor(), options);
  auto summary = run_recipe(device, recipe, &*writer, options.calibrate.stop,
                            [&](const device::Frame&, double fraction) -> Status {
                              if (options.calibrate.progress) {
                                options.calibrate.progress(fraction, "measure");
                              }
                              return {};
                            });
  const Status finished = writer->finish();
  if (!summary) {
    return summary;
  }
  if (!finished) {
    return std::unexpected(finished.error());
  }
  return summary;
}

}  // namespace

protocol::Recipe standard_recipe(const protocol::Descriptor& d, const MeasureOptions& options) {
  protocol::Recipe recipe;
  recipe.illuminations.assign(illuminations_of(d, geometry_of(d, options)));
  recipe.exposure_mode = protocol::ExposureMode::kAuto;
  recipe.exposures_us.push_back(kProbe_us);
  recipe.repeats = options.repeats == 0 ? kDefaultSweeps : options.repeats;
  recipe.off_frames = 1;
  recipe.time_budget_us = options.time_budget_ms == 0 ? kDefaultBudget_us : options.time_budget_ms * 1000;
  return recipe;
}

Result<protocol::Ledger> record(device::Device& device, const MeasureOptions& options) {
  auto summary = record_run(device, options, options.references.get());
  if (!summary) {
    return std::unexpected(summary.error());
  }
  return summary->ledger;
}

Result<MeasureResult> measure(device::Device& device, const MeasureOptions& options) {
  const Geometry geometry = geometry_of(device.descriptor(), options);
  std::optional<Calibration> made;
  std::string why_not;
  auto references = ensure_references(device, options, geometry, made, why_not);
  if (!references) {
    return std::unexpected(references.error());
  }
  const auto start = std::chrono::steady_clock::now();
  const auto summary = record_run(device, options, references->get());
  if (!summary) {
    return std::unexpected(summary.error());
  }
  MeasureResult result;
  result.calibration = std::move(made);
  result.ledger = summary->ledger;
  result.instrument_seconds = 1e-6 * static_cast<double>(summary->ended_us - summary->started_us);
  const auto finish = [&]() -> MeasureResult&& {
    result.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(result);
  };
  if (!*references) {
    const std::string remedy = fmt::format(
        "run `scatter calibrate URI -o CAL.scat` with the references at hand, then `scatter process {} "
        "--calibration CAL.scat`",
        options.recording.string());
    result.uncalibrated = Error{ErrorCode::kFailedPrecondition,
                                fmt::format("calibration is missing: {}; the raw frames are in {}", why_not,
                                            options.recording.string()),
                                remedy};
    result.quality.push_back({"calibration_missing", 1, 0, Verdict::kFail, why_not + "; " + remedy});
    return finish();
  }
  ProcessOptions process_options = options.process;
  process_options.references.reset();  // The recording carries its copy.
  auto measurement = process(options.recording, process_options);
  if (!measurement) {
    return std::unexpected(measurement.error());
  }
  result.quality = measurement->quality;
  result.measurement = std::move(*measurement);
  return finish();
}

}  // namespace scatter::measurement
