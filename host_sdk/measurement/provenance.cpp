#include "host_sdk/measurement/provenance.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>

namespace scatter::measurement {

std::string software_version() {
  return "OpenScatter " SCATTER_VERSION;
}

std::string iso_time(std::uint64_t unix_s) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(unix_s)));
}

std::map<std::string, std::string> provenance(const RecordedScan& scan, const Tilt* corrected_tilt) {
  const ReferenceSet& references = *scan.references;
  std::string certificates;
  for (const protocol::ReferenceCertificate& row : references.content().certificates) {
    certificates += (certificates.empty() ? "" : ", ") + std::string(row.id.str());
  }
  const protocol::Recipe& r = scan.recipe;
  std::map<std::string, std::string> out{
      {"recording_id", scan.id},
      {"calibration_id", references.id_hex()},
      {"software", software_version()},
      {"instrument", std::string(scan.descriptor.product.str())},
      {"serial", std::string(scan.descriptor.serial.str())},
      {"created", iso_time(scan.creation_unix_ns / 1'000'000'000ULL)},
      {"certificates", certificates},
      {"settings",
       fmt::format("{} illuminations, {} exposures, {} sweeps, {} LED-off frames", r.illuminations.size(),
                   r.exposure_mode == protocol::ExposureMode::kAuto ? "automatic" : "fixed", r.repeats,
                   r.off_frames)},
  };
  if (corrected_tilt != nullptr) {
    out.emplace("tilt_correction",
                fmt::format("x {:.3f} deg, y {:.3f} deg", reflectance::degrees(corrected_tilt->x_rad),
                            reflectance::degrees(corrected_tilt->y_rad)));
  }
  return out;
}

}  // namespace scatter::measurement
