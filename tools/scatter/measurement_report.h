// A measurement in the words of the report page.
#pragma once

#include <string>
#include <vector>

#include "host_sdk/measurement/process.h"
#include "tools/plot/report.h"

namespace scatter::cli {

/// "HS-1 SIM-00000001".
[[nodiscard]] std::string report_subtitle(const measurement::Measurement& measurement);

/// Everything but the pictures.
[[nodiscard]] plot::ReportContent measurement_report(const measurement::Measurement& measurement,
                                                     const std::string& title,
                                                     const std::vector<std::string>& notes);

}  // namespace scatter::cli
