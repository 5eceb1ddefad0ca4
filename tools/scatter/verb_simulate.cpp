// scatter simulate --listen ADDRESS: serves a virtual instrument to other programs.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <memory>

#include "simulator/emulator/emulated_board.h"
#include "simulator/instrument/instrument_options.h"
#include "simulator/instrument/server.h"
#include "simulator/instrument/virtual_instrument.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string listen;
  bool allow_remote = false;
  std::string board;                                        ///< "": the virtual board.
  std::string firmware;                                     ///< .scfw of an emulated board.
  std::string state;                                        ///< Folder of an emulated board.
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

/// Serves until the user ends it.
Status serve(simulator::Server& server, const Context& context, Answer& answer) {
  // At once, not with the answer: whoever started this program waits for it.
  const std::string line = context.json ? nlohmann::ordered_json{{"listening", server.address()}}.dump()
                                        : "listening on " + server.address() + "; ctrl-C ends it";
  std::fprintf(stdout, "%s\n", line.c_str());
  std::fflush(stdout);
  Status served = server.serve(context.stop);
  const auto statistics = server.statistics();
  answer.json = {{"hosts", statistics.hosts}, {"turned_away", statistics.turned_away}};
  answer.text = fmt::format("served {} hosts, turned {} away\n", statistics.hosts, statistics.turned_away);
  return served;
}

Result<Answer> run_board(const Options& options, const simulator::InstrumentOptions& which,
                         const Context& context) {
  const auto files = simulator::find_firmware(options.firmware);
  if (!files) {
    return std::unexpected(files.error());
  }
  const auto board = simulator::EmulatedBoard::start({.instrument = which,
                                                      .bootloader = files->bootloader,
                                                      .firmware = files->firmware,
                                                      .state = options.state});
  if (!board) {
    return std::unexpected(board.error());
  }
  const auto server =
      simulator::Server::listen(options.listen, **board, {.allow_remote = options.allow_remote});
  if (!server) {
    return std::unexpected(server.error());
  }
  Answer answer;
  if (Status served = serve(**server, context, answer); !served) {
    return std::unexpected(served.error());
  }
  const auto bench = (*board)->statistics().bench;
  answer.json["bench"] = {{"boots", bench.boots}, {"frames", bench.frames}, {"refused", bench.refused}};
  answer.text += fmt::format("the board booted {} times; {} frames drawn, {} commands refused\n", bench.boots,
                             bench.frames, bench.refused);
  return answer;
}

Result<Answer> run(const Options& options, const Context& context) {
  simulator::InstrumentOptions defaults;
  defaults.clock = simulator::ClockMode::kReal;
  const auto which = simulator::parse_instrument_options(query(options), defaults);
  if (!which) {
    return std::unexpected(which.error());
  }
  if (!options.board.empty()) {
    return run_board(options, *which, context);
  }
  if (!options.firmware.empty() || !options.state.empty()) {
    return fail(ErrorCode::kInvalidArgument, "--firmware and --state belong to an emulated board",
                "add --board mps2_an500, or leave them out");
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
  Answer answer;
  if (Status served = serve(**server, context, answer); !served) {
    return std::unexpected(served.error());
  }
  return answer;
}

}  // namespace

Verb add_simulate(CLI::App& root) {
  auto* app = root.add_subcommand("simulate", "Serve a virtual instrument to other programs");
  auto options = std::make_shared<Options>();
  app->add_option("--listen", options->listen, "tcp:127.0.0.1:PORT (0: a free one) or unix:PATH")->required();
  app->add_flag("--allow-remote", options->allow_remote, "Listen on addresses that other computers reach");
  app->add_option("--board", options->board,
                  "Run the firmware's image on this board under QEMU instead of in this program")
      ->check(CLI::IsMember({"mps2_an500"}));
  app->add_option("--firmware", options->firmware,
                  "With --board: image (.scfw) of a new board; default: that of ./run firmware");
  app->add_option("--state", options->state, "With --board: folder that keeps its memory between runs");
  options->single = {{"sample", {}},     {"seed", {}},  {"profile", {}}, {"calibration", {}},
                     {"references", {}}, {"clock", {}}, {"module", {}},  {"flash", {}}};
  const auto value = [&](std::size_t k, const char* help) {
    app->add_option("--" + options->single[k].first, options->single[k].second, help);
  };
  value(0, "What lies under it: a model, file:PATH, with defects such as +tilt=1.0@30");
  value(1, "Number that decides every random draw");
  value(2, "hs1, fine or binned (small frames for slow links)");
  value(3, "session, stale or none");
  value(4, "exact or drawn");
  value(5, "real (default) or virtual");
  value(6, "transmission or none");
  value(7, "File that keeps the instrument's memory between runs");
  app->add_option("--fault", options->faults, "Fault such as drop:1e-3; may be given several times");
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
