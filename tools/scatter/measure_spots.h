// scatter measure URI --spots N: several places of one sample, with one calibration.
#pragma once

#include <string>

#include "host_sdk/measurement/measure.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

struct SpotsRequest {
  std::string uri;
  std::string folder;  ///< Exists.
  std::string title;
  int spots = 2;
  measurement::MeasureOptions how;  ///< `recording` is overridden.
};

inline constexpr int kMostSpots = 1000;

/// Measures `spots` places and writes each one's files in FOLDER/spot-01, ...; in FOLDER itself the mean BRDF
/// with its report, the standard deviation between spots (deviation.exr, deviation.png) and spots.json.
///
/// A simulated sample that differs from place to place is moved: spot k lies at the sample's own place plus
/// k (0.7549, 0.5698) of the sheet, modulo 1 (the R2 sequence of Roberts 2018: spread evenly whatever the
/// number), so that another spot= gives other places. A sample that is the same everywhere is measured again.
/// A real or served instrument is moved by the person at the terminal. After a stop or a failure, finished
/// spots are kept and combined, and the answer says so and has failed. Errors    kFailedPrecondition: nobody
/// there to move the instrument; those of measuring the first spot.
[[nodiscard]] Result<Answer> measure_spots(const SpotsRequest& request, const Context& context,
                                           Progress& bar);

}  // namespace scatter::cli
