// scatter: composes the verbs, prints what they answer, and turns errors into exit statuses.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <vector>

#include "host_sdk/device/transport.h"
#include "host_sdk/device/usb/context.h"
#include "tools/scatter/interrupt.h"
#include "tools/scatter/nearest.h"
#include "tools/scatter/verb.h"
#include "tools/scatter/version.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace scatter::cli {
namespace {

enum ExitStatus { kDone = 0, kFailed = 1, kUsage = 2 };

bool wants_json(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    if (std::string_view(argv[i]) == "--json") {
      return true;
    }
  }
  return false;
}

/// False when standard output cannot take it (closed pipe, full disk).
bool print(const std::string& text) {
  return std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
}

int complain(const Error& error, bool json, ExitStatus status) {
  if (json) {
    const nlohmann::ordered_json answer = {
        {"error", {{"code", name(error.code)}, {"what", error.what}, {"remedy", error.remedy}}}};
    (void)print(answer.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  }
  std::fprintf(stderr, "error: %s\nremedy: %s\n", error.what.c_str(), error.remedy.c_str());
  return status;
}

int answer_with(const Answer& answer, bool json) {
  const std::string text =
      json ? answer.json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n"
           : answer.text;
  if (!print(text)) {
    return complain({ErrorCode::kResourceExhausted, "standard output does not take the answer",
                     "free some space, or do not close the pipe early"},
                    false, kFailed);
  }
  return answer.failed ? kFailed : kDone;
}

/// The first word that is no option, when it names no verb.
std::optional<std::string> unknown_verb(int argc, char** argv, const std::vector<std::string>& names) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (!word.starts_with('-')) {
      return std::ranges::find(names, word) == names.end() ? std::optional(word) : std::nullopt;
    }
  }
  return std::nullopt;
}

int run(int argc, char** argv) {
  CLI::App root("Measures how a surface scatters light, and works with what was measured.", "scatter");
  root.set_version_flag("--version", std::string("scatter ") + kVersion);
  root.require_subcommand(1);
  root.footer(
      "Try:  scatter measure 'sim:?sample=ggx:alpha=0.2,f0=0.04,albedo=0.3' -o out\n"
      "Exit status: 0 done, 1 failed, 2 wrong usage.");
  std::vector<Verb> verbs;
  for (const auto add : {add_list,     add_doctor,   add_rescue,  add_info,    add_calibrate, add_measure,
                         add_record,   add_process,  add_inspect, add_convert, add_merge,     add_atlas,
                         add_compare,  add_fit,      add_plot,    add_corrode, add_patinate,  add_conform,
                         add_selftest, add_simulate, add_flash,   add_firmware}) {
    verbs.push_back(add(root));
  }
  bool json = false;
  std::vector<std::string> names;
  for (const Verb& verb : verbs) {
    verb.app->add_flag("--json", json, "Answer in JSON on standard output");
    names.push_back(verb.app->get_name());
  }
  if (const auto word = unknown_verb(argc, argv, names)) {
    return complain({ErrorCode::kInvalidArgument, "there is no verb '" + *word + "'",
                     "use " + nearest_or_all(*word, names) + "; scatter --help says what each does"},
                    wants_json(argc, argv), kUsage);
  }
  try {
    root.parse(argc, argv);
  } catch (const CLI::Success& request) {  // --help, --version
    root.exit(request);
    return kDone;
  } catch (const CLI::ParseError& error) {
    const auto chosen = root.get_subcommands();
    const std::string verb = chosen.empty() ? "" : " " + chosen.front()->get_name();
    return complain({ErrorCode::kInvalidArgument, error.what(), "see scatter" + verb + " --help"},
                    wants_json(argc, argv), kUsage);
  }
  device::TransportRegistry registry;
  tools::register_sim_scheme(registry);
  device::usb::add_usb_scheme(registry);
  const Context context{.json = json, .stop = stop_on_interrupt(), .registry = registry};
  for (const Verb& verb : verbs) {
    if (verb.app->parsed()) {
      const auto answer = verb.run(context);
      return answer ? answer_with(*answer, json) : complain(answer.error(), json, kFailed);
    }
  }
  return kUsage;
}

}  // namespace
}  // namespace scatter::cli

int main(int argc, char** argv) {
  try {
    return scatter::cli::run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs("error: out of memory\nremedy: close other programs, or work on a smaller file\n", stderr);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: unexpected: %s\nremedy: report this with the command that led to it\n",
                 error.what());
  }
  return 1;
}
