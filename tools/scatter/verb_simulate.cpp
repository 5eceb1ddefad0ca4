// scatter simulate --listen ADDRESS: serves a virtual instrument to other programs.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <memory>

#include "simulator/instrument/instrument_options.h"
#include "simulator/instrument/server.h"
#include "simulator/instrument/virtual_instrument.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string listen;
  bool allow_remote = false;
  std::vector<std::pair<std::string, std::string>> single;  ///< Key of the sim: query and its value.
  std::vector<std::string> faults;
};

/// Percent-encodes what would end a value.
std::string encoded(const std::string& value) {
  std::string text;
  for (const char c : value) {
    if (c == '%' || c == '&') {
      text += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    } else {
      text += c;
    }
  }
  return text;
}

std::string query(const Options& options) {
  std::string text = "?";
  const auto add = [&](const std::string& key, const std::string& value) {
    if (!value.empty()) {
      text += (text.size() > 1 ? "&" : "") + key + "=" + encoded(value);
    }
  };
  for (const auto& [key, value] : options.single) {
    add(key, value);
  }
  for (const auto& fault : options.faults) {
    add("fault", fault);
  }
  return text;
}

Result<Answer> run(const Options& options, const Context& context) {
  simulator::InstrumentOptions defaults;
  defaults.clock = simulator::ClockMode::kReal;
  const auto which = simulator::parse_instrument_options(query(options), defaults);
  if (!which) {
    return std::unexpected(which.error());
  }
  const auto instrument = simulator::VirtualInstrument::make(*which);
  if (!instrument) {
    return std::unexpected(instrument.error());
  }
  const auto server =
      simulator::Server::listen(options.listen, **instrument, {.allow_remote = options.allow_remote});
  if (!server) {
    return std::unexpected(server.error());
  }
  // At once, not with the answer: whoever started this program waits for it.
  const std::string line = context.json ? nlohmann::ordered_json{{"listening", (*server)->address()}}.dump()
                                        : "listening on " + (*server)->address() + "; ctrl-C ends it";
  std::fprintf(stdout, "%s\n", line.c_str());
  std::fflush(stdout);
  if (const auto served = (*server)->serve(context.stop); !served) {
    return std::unexpected(served.error());
  }
  const auto statistics = (*server)->statistics();
  Answer answer;
  answer.json = {{"hosts", statistics.hosts}, {"turned_away", statistics.turned_away}};
  answer.text = fmt::format("served {} hosts, turned {} away\n", statistics.hosts, statistics.turned_away);
  return answer;
}

}  // namespace

Verb add_simulate(CLI::App& root) {
  auto* app = root.add_subcommand("simulate", "Serve a virtual instrument to other programs");
  auto options = std::make_shared<Options>();
  app->add_option("--listen", options->listen, "tcp:127.0.0.1:PORT (0: a free one) or unix:PATH")->required();
  app->add_flag("--allow-remote", options->allow_remote, "Listen on addresses that other computers reach");
  options->single = {{"sample", {}},     {"seed", {}},  {"profile", {}}, {"calibration", {}},
                     {"references", {}}, {"clock", {}}, {"module", {}},  {"flash", {}}};
  const auto value = [&](std::size_t k, const char* help) {
    app->add_option("--" + options->single[k].first, options->single[k].second, help);
  };
  value(0, "What lies under it: a model, file:PATH, with defects such as +tilt=1.0@30");
  value(1, "Number that decides every random draw");
  value(2, "hs1 or fine");
  value(3, "session, stale or none");
  value(4, "exact or drawn");
  value(5, "real (default) or virtual");
  value(6, "transmission or none");
  value(7, "File that keeps the instrument's memory between runs");
  app->add_option("--fault", options->faults, "Fault such as drop:1e-3; may be given several times");
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
