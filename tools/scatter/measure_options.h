// Options that `measure`, `record` and `process` share.
#pragma once

#include <memory>
#include <string>

#include "host_sdk/measurement/measure.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

/// How to record a run.
struct RecordingChoice {
  std::string uri;
  std::string calibration;  ///< File; empty: the instrument's own.
  bool no_calibrate = false;
  bool transmission = false;
  bool reflection = false;
  double budget_s = 0;  ///< 0: the library's default.
  int repeats = 0;      ///< 0: the library's default.
};

/// Adds uri, --calibration, --no-calibrate, --transmission, --reflection, --budget and --repeats.
void add_options(CLI::App& app, RecordingChoice& choice);

/// Options for measurement::measure and record. `bar` must outlive the run.
/// Errors   of reading the calibration file.
[[nodiscard]] Result<measurement::MeasureOptions> measure_options(const RecordingChoice& choice,
                                                                  const Context& context, Progress& bar);

}  // namespace scatter::cli
