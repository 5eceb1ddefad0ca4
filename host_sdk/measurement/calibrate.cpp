#include "host_sdk/measurement/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "host_sdk/device/device.h"
#include "host_sdk/device/recording_reader.h"
#include "host_sdk/device/recording_writer.h"
#include "host_sdk/measurement/attachments.h"
#include "host_sdk/measurement/provenance.h"
#include "host_sdk/measurement/recorded_scan.h"
#include "host_sdk/measurement/reference_run.h"

namespace scatter::measurement {
namespace {

using protocol::Target;

/// Brings a target under the instrument: by its stage, or by asking the user.
Status place(device::Device& device, std::uint32_t session, Target target, const CalibrateOptions& options) {
  const auto placed = device.calibration_step(session, target, {std::chrono::seconds(10), options.stop});
  if (!placed) {
    return std::unexpected(placed.error());
  }
  if (placed->placed != 0) {
    return {};
  }
  if (!options.ask_user) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("the instrument asks: {}", placed->instruction.str()),
                "run `scatter calibrate` on a terminal and follow its instructions");
  }
  if (!options.ask_user(std::string(placed->instruction.str()))) {
    return fail(ErrorCode::kAborted, "calibration was given up",
                "start it again when the references are at hand");
  }
  return {};
}

protocol::CalibrationManifest manifest(const ReferenceSet& set, Target kind) {
  const ReferenceSet::Content& c = set.content();
  protocol::CalibrationManifest m;
  m.id = set.id();
  m.kind = kind;
  m.unix_time_s = c.unix_time_s;
  m.sensor_temperature_mK = c.sensor_temperature_mK;
  m.led_temperature_mK = c.led_temperature_mK;
  if (const protocol::ReferenceCertificate* certificate = set.certificate(kind)) {
    m.certificate_id = certificate->id.str();
  }
  if (kind != Target::kDarkCap) {
    for (const ReferenceImages& image : c.illuminations) {
      const RateImage& rates = kind == Target::kBlackReference ? image.black : image.reference;
      double sum = 0;
      for (const float rate : rates.rate) {
        sum += static_cast<double>(rate);
      }
      if (!m.scalars.push_back(static_cast<float>(sum / static_cast<double>(rates.rate.size())))) {
        break;
      }
    }
  }
  return m;
}

}  // namespace

Result<Calibration> calibrate(device::Device& device, const CalibrateOptions& options) {
  const auto wall_start = std::chrono::steady_clock::now();
  const device::TimePoint device_start = device.now();
  const auto tell = [&](double fraction, const std::string& what) {
    if (options.progress) {
      options.progress(fraction, what);
    }
  };
  const auto begun = device.calibration_begin({std::chrono::seconds(5), options.stop});
  if (!begun) {
    return std::unexpected(begun.error());
  }
  const auto run_steps = [&]() -> Result<std::shared_ptr<const ReferenceSet>> {
    ReferenceRun run(device, options.geometry, options.stop);
    const Target reference =
        options.geometry == Geometry::kTransmission ? Target::kTranslucentReference : Target::kWhiteReference;
    struct Step {
      Target target;
      double until;
      const char* what;
    };
    double done = 0;
    for (const Step& step : {Step{Target::kDarkCap, 0.2, "dark"}, Step{reference, 0.75, "reference"},
                             Step{Target::kBlackReference, 1.0, "black"}}) {
      tell(done, step.what);
      if (const Status placed = place(device, begun->session, step.target, options); !placed) {
        return std::unexpected(placed.error());
      }
      const double from = done;
      const Status taken = run.take(
          step.target, [&](double fraction) { tell(from + (step.until - from) * fraction, step.what); });
      if (!taken) {
        return std::unexpected(taken.error());
      }
      done = step.until;
    }
    auto set = run.finish();
    if (!set) {
      return std::unexpected(set.error());
    }
    for (const Target kind : {Target::kDarkCap, reference, Target::kBlackReference}) {
      const Status committed = device.calibration_commit(begun->session, manifest(**set, kind),
                                                         {std::chrono::seconds(5), options.stop});
      if (!committed) {
        return std::unexpected(committed.error());
      }
    }
    return set;
  };
  auto set = run_steps();
  // The session is closed on every path, so that the sample comes back under the instrument.
  const Status ended = device.calibration_end(begun->session, {std::chrono::seconds(10), {}});
  if (!set) {
    return std::unexpected(set.error());
  }
  if (!ended) {
    return std::unexpected(ended.error());
  }
  tell(1.0, "done");
  Calibration out;
  out.references = std::move(*set);
  out.instrument_seconds = std::chrono::duration<double>(device.now() - device_start).count();
  out.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_start).count();
  return out;
}

Status save(const ReferenceSet& references, const std::filesystem::path& file) {
  std::error_code ignored;
  std::filesystem::create_directories(file.parent_path().empty() ? "." : file.parent_path(), ignored);
  auto writer = device::RecordingWriter::create(
      file, {references.content().unix_time_s * 1'000'000'000ULL, software_version()});
  if (!writer) {
    return std::unexpected(writer.error());
  }
  if (const Status attached = attach(*writer, references); !attached) {
    return attached;
  }
  return writer->finish();
}

Result<std::shared_ptr<const ReferenceSet>> load_references(const std::filesystem::path& file) {
  auto reader = device::RecordingReader::open(file);
  if (!reader) {
    return std::unexpected(reader.error());
  }
  auto set = attached_references(*reader);
  if (set && !*set) {
    return fail(ErrorCode::kNotFound, fmt::format("{}: holds no calibration", file.string()),
                "give a file that `scatter calibrate` or `scatter measure` wrote");
  }
  return set;
}

std::filesystem::path library_folder(const std::string& serial) {
  const auto from = [](const char* variable) -> std::filesystem::path {
    const char* value = std::getenv(variable);
    return value != nullptr && *value != '\0' ? std::filesystem::path(value) : std::filesystem::path();
  };
  std::filesystem::path root = from("SCATTER_LIBRARY");
  if (root.empty()) {
    const std::filesystem::path data = from("XDG_DATA_HOME");
    root = data.empty() ? from("HOME") / ".local" / "share" / "openscatter" : data / "openscatter";
  }
  return root / "calibrations" / serial;
}

}  // namespace scatter::measurement
