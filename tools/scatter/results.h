// The files that a measurement hands over.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_sdk/measurement/process.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

struct ResultsRequest {
  std::filesystem::path folder;    ///< Exists.
  std::string title;               ///< What was measured, for people.
  std::vector<std::string> notes;  ///< Lines for the provenance: "corrected for tilt", ...
};

/// Writes brdf.exr, brdf.bsdf, quality.json, lobe.png and report.html, each whole or not at all, the
/// slow ones at the same time. Files carry no clock of this computer: the same measurement gives the same
/// bytes. Errors   the first file's that could not be written. Returns  the paths written, in the order
/// above.
[[nodiscard]] Result<std::vector<std::string>> write_results(const measurement::Measurement& measurement,
                                                             const ResultsRequest& request);

/// Keys that `measure` and `process` have in common: ledger, instrument_seconds, quality, albedo, tilt,
/// recording_id, calibration_id.
[[nodiscard]] nlohmann::ordered_json summary_json(const measurement::Measurement& measurement);

/// The same for people: albedo, and every quality row that is not ok.
[[nodiscard]] std::string summary_text(const measurement::Measurement& measurement);

}  // namespace scatter::cli
