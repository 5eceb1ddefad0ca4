// What every verb of the command line is made of.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <stop_token>
#include <string>

#include "host_sdk/error/error.h"

namespace CLI {  // NOLINT(readability-identifier-naming): theirs
class App;
}
namespace scatter::device {
class TransportRegistry;
}

namespace scatter::cli {

/// What a verb gets to work with.
struct Context {
  bool json = false;     ///< A machine reads standard output.
  std::stop_token stop;  ///< Requested by ctrl-C and SIGTERM.
  const device::TransportRegistry& registry;
};

/// What a verb found out, in both languages; main prints one of them.
struct Answer {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  std::string text;     ///< For people, with its line ends.
  bool failed = false;  ///< Exit status 1 although there is an answer (a ledger that does not balance).
};

struct Verb {
  CLI::App* app = nullptr;
  std::function<Result<Answer>(const Context&)> run;
};

// One function per verb, each in the file verb_NAME.cpp: adds its options to the root.
[[nodiscard]] Verb add_list(CLI::App& root);
[[nodiscard]] Verb add_info(CLI::App& root);
[[nodiscard]] Verb add_calibrate(CLI::App& root);
[[nodiscard]] Verb add_measure(CLI::App& root);
[[nodiscard]] Verb add_record(CLI::App& root);
[[nodiscard]] Verb add_process(CLI::App& root);
[[nodiscard]] Verb add_inspect(CLI::App& root);
[[nodiscard]] Verb add_conform(CLI::App& root);
[[nodiscard]] Verb add_convert(CLI::App& root);
[[nodiscard]] Verb add_corrode(CLI::App& root);
[[nodiscard]] Verb add_merge(CLI::App& root);
[[nodiscard]] Verb add_atlas(CLI::App& root);
[[nodiscard]] Verb add_compare(CLI::App& root);
[[nodiscard]] Verb add_doctor(CLI::App& root);
[[nodiscard]] Verb add_fit(CLI::App& root);
[[nodiscard]] Verb add_patinate(CLI::App& root);
[[nodiscard]] Verb add_plot(CLI::App& root);
[[nodiscard]] Verb add_rescue(CLI::App& root);
[[nodiscard]] Verb add_selftest(CLI::App& root);
[[nodiscard]] Verb add_simulate(CLI::App& root);
[[nodiscard]] Verb add_flash(CLI::App& root);
[[nodiscard]] Verb add_firmware(CLI::App& root);

}  // namespace scatter::cli
