// scatter record URI -o FILE.scat: raw frames only, to be processed later.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "tools/scatter/device_access.h"
#include "tools/scatter/measure_options.h"
#include "tools/scatter/measurement_json.h"

namespace scatter::cli {
namespace {

struct Options {
  RecordingChoice recording;
  std::string output;
};

Result<Answer> run(const Options& options, const Context& context) {
  Progress bar;
  auto how = measure_options(options.recording, context, bar);
  if (!how) {
    return std::unexpected(how.error());
  }
  auto device = open_device(options.recording.uri, context);
  if (!device) {
    return std::unexpected(device.error());
  }
  how->recording = options.output;
  const auto ledger = measurement::record(*device, *how);
  bar.clear();
  if (!ledger) {
    return std::unexpected(ledger.error());
  }
  Answer answer;
  answer.json = {{"ledger", to_json(*ledger)}, {"files", {options.output}}};
  answer.text = fmt::format("recorded {}\n{}\n", words(*ledger), options.output);
  answer.failed = !ledger->balances();
  return answer;
}

}  // namespace

Verb add_record(CLI::App& root) {
  auto* app = root.add_subcommand("record", "Record raw frames, to be processed later with any calibration");
  auto options = std::make_shared<Options>();
  add_options(*app, options->recording);
  app->add_option("-o,--output", options->output, "Recording (.scat)")->required();
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
