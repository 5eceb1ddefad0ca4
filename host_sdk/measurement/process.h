// From a recording to a calibrated BRDF with uncertainty and a quality report (instrument.md section 4).
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/measurement/quality.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "protocol/descriptor.h"
#include "protocol/types.h"

namespace scatter::measurement {

class ReferenceSet;

/// Estimated tilt of the sample's normal against the instrument's, towards +x and +y.
struct Tilt {
  double x_rad = 0;
  double y_rad = 0;
  double standard_error_rad = 0;  ///< Larger of both components'.
  bool told = false;              ///< False: the sample's lobe is too broad to tell.
};

struct ProcessOptions {
  /// Use this calibration instead of the copy in the recording.
  std::shared_ptr<const ReferenceSet> references;
  bool correct_tilt = false;
  double sample_rotation_rad = 0;  ///< The sample was turned by this (counter-clockwise) on its mount.
};

/// Directional-hemispherical reflectance (or transmittance) over the measured nodes only.
struct AlbedoRow {
  double theta_i_rad = 0;
  double phi_i_rad = 0;
  std::vector<double> albedo;                ///< Per channel, 0..1.
  std::vector<double> standard_uncertainty;  ///< Per channel, total.
};

struct Measurement {
  reflectance::GridBrdf brdf;  ///< BRDF, or BTDF when the transmission module was used.
  std::vector<AlbedoRow> albedo;
  std::vector<QualityItem> quality;
  Tilt tilt;
  protocol::Ledger ledger;
  protocol::Descriptor descriptor;
  double instrument_seconds = 0;  ///< Device clock, start to end of the run.
  std::size_t raw_bytes = 0;      ///< Pixel bytes processed.
  std::string recording_id;       ///< SHA-256 of the recording, hex.
  std::string calibration_id;     ///< First 16 bytes, hex.
};

/// Processes one recording.
/// Errors   kFailedPrecondition: no calibration in the recording and none given (remedy says how to
///          get one); kDataLoss: no whole frame; what recording_reader.h says.
/// Threads  any; uses oneTBB inside; same result for any number of threads.
/// Cost     memory about 150 MB for HS-1; time: benchmark process.throughput.
[[nodiscard]] Result<Measurement> process(const std::filesystem::path& recording,
                                          const ProcessOptions& options);

/// Albedo over the measured nodes of every part.
[[nodiscard]] std::vector<AlbedoRow> measured_albedo(const reflectance::GridBrdf& brdf);

/// Combines measurements of one sample: equal incidence and rotation average with weights
/// 1 / random^2 (the references' noise, common to repeats with one calibration, does not shrink);
/// different rotations become parts of one anisotropic BRDF. Adds the rows
/// "repeatability" or "isotropy" to the quality report.
/// Errors   kInvalidArgument: different grids, channels or types.
[[nodiscard]] Result<Measurement> combine(std::vector<Measurement> measurements);

}  // namespace scatter::measurement
