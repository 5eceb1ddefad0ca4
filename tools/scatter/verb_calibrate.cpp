// scatter calibrate URI: dark, reference and black frames of this session.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <memory>

#include "host_sdk/measurement/calibrate.h"
#include "tools/scatter/device_access.h"
#include "tools/scatter/files.h"
#include "tools/scatter/progress.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string uri;
  std::string output;
  bool transmission = false;
  bool reflection = false;
};

Result<Answer> run(const Options& options, const Context& context) {
  auto device = open_device(options.uri, context);
  if (!device) {
    return std::unexpected(device.error());
  }
  const bool transmission =
      options.transmission || (!options.reflection && device->descriptor().transmission_module != 0);
  Progress bar;
  measurement::CalibrateOptions how;
  how.geometry = transmission ? measurement::Geometry::kTransmission : measurement::Geometry::kReflection;
  how.ask_user = person_at_terminal(context.stop);
  how.progress = [&](double fraction, const std::string& what) { bar.show(fraction, what); };
  how.stop = context.stop;
  const auto calibration = measurement::calibrate(*device, how);
  bar.clear();
  if (!calibration) {
    return std::unexpected(calibration.error());
  }
  const std::string id = calibration->references->id_hex();
  std::filesystem::path file = options.output;
  if (file.empty()) {
    const auto folder = measurement::library_folder(std::string(device->descriptor().serial.str()));
    if (const auto ready = prepare_folder(folder); !ready) {
      return std::unexpected(ready.error());
    }
    file = folder / (id + ".scat");
  }
  const auto saved = write_atomically(file, [&](const std::filesystem::path& place) {
    return measurement::save(*calibration->references, place);
  });
  if (!saved) {
    return std::unexpected(saved.error());
  }
  Answer answer;
  answer.json = {{"id", id},
                 {"serial", device->descriptor().serial.str()},
                 {"instrument_seconds", calibration->instrument_seconds},
                 {"wall_seconds", calibration->wall_seconds},
                 {"file", file.string()}};
  answer.text = fmt::format(
      "calibrated {} in {:.1f} s on the instrument's clock ({:.1f} s here)\ncalibration {}\nkept in {}\n",
      device->descriptor().serial.str(), calibration->instrument_seconds, calibration->wall_seconds, id,
      file.string());
  return answer;
}

}  // namespace

Verb add_calibrate(CLI::App& root) {
  auto* app =
      root.add_subcommand("calibrate", "Take dark, white and black reference frames for this session");
  auto options = std::make_shared<Options>();
  app->add_option("uri", options->uri, "Instrument, for example sim: or tcp:127.0.0.1:7000")->required();
  app->add_option("-o,--output", options->output,
                  "Calibration file (.scat); without it, the calibration library of this computer");
  auto* transmission = app->add_flag("--transmission", options->transmission,
                                     "Calibrate the transmission module (the default when mounted)");
  app->add_flag("--reflection", options->reflection, "Calibrate the sources above the sample")
      ->excludes(transmission);
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
