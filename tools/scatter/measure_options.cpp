#include "tools/scatter/measure_options.h"

#include <CLI/CLI.hpp>
#include <cmath>

#include "tools/scatter/device_access.h"

namespace scatter::cli {

void add_options(CLI::App& app, RecordingChoice& choice) {
  app.add_option("uri", choice.uri, "Instrument, for example 'sim:?sample=lambertian:0.5&seed=1'")
      ->required();
  app.add_option("--calibration", choice.calibration, "Use this calibration file (.scat)");
  app.add_flag("--no-calibrate", choice.no_calibrate,
               "Never calibrate: fail when there is no valid calibration");
  auto* transmission = app.add_flag("--transmission", choice.transmission,
                                    "Light from below (the default when that module is mounted)");
  app.add_flag("--reflection", choice.reflection, "Light from above")->excludes(transmission);
  app.add_option("--budget", choice.budget_s, "Time on the instrument's clock [s]")
      ->check(CLI::Range(0.1, 600.0));
  app.add_option("--repeats", choice.repeats, "Sweeps over all illuminations")->check(CLI::Range(1, 1000));
}

Result<measurement::MeasureOptions> measure_options(const RecordingChoice& choice, const Context& context,
                                                    Progress& bar) {
  measurement::MeasureOptions options;
  if (choice.transmission || choice.reflection) {
    options.geometry =
        choice.transmission ? measurement::Geometry::kTransmission : measurement::Geometry::kReflection;
  }
  if (!choice.calibration.empty()) {
    auto references = measurement::load_references(choice.calibration);
    if (!references) {
      return std::unexpected(references.error());
    }
    options.references = *references;
    options.process.references = *references;
  }
  // A simulated instrument is new each time: what it forgets is not worth keeping.
  options.use_library = !choice.uri.starts_with("sim:") || choice.uri.find("flash=") != std::string::npos;
  options.calibrate_if_needed = !choice.no_calibrate;
  options.time_budget_ms = static_cast<std::uint32_t>(std::lround(choice.budget_s * 1000));
  options.repeats = static_cast<std::uint16_t>(choice.repeats);
  options.calibrate.ask_user = person_at_terminal(context.stop);
  options.calibrate.progress = [&bar](double fraction, const std::string& what) { bar.show(fraction, what); };
  options.calibrate.stop = context.stop;
  return options;
}

}  // namespace scatter::cli
