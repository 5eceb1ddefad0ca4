// scatter simulate --listen ADDRESS serves a virtual instrument to other programs, --usbip [PORT] to the USB
// bus of Linux machines.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <memory>

#include "simulator/emulator/emulated_board.h"
#include "simulator/instrument/instrument_options.h"
#include "simulator/instrument/server.h"
#include "simulator/instrument/virtual_instrument.h"
#include "simulator/usbip/usbip_protocol.h"
#include "simulator/usbip/usbip_server.h"
#include "simulator/usbip/vhci_bus.h"
#include "tools/scatter/button_signal.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

struct Options {
  std::string listen;
  bool usbip = false;
  std::string usbip_place;  ///< PORT or HOST:PORT; "": the usual port.
  bool plug_in = false;
  std::string speed = "high";
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

/// At once, not with the answer: whoever started this program waits for it.
void announce(const Context& context, const nlohmann::ordered_json& json, const std::string& text) {
  std::fprintf(stdout, "%s\n", context.json ? json.dump().c_str() : text.c_str());
  std::fflush(stdout);
}

/// Serves until the user ends it.
Status serve(simulator::Server& server, const Context& context, Answer& answer) {
  announce(context, {{"listening", server.address()}},
           "listening on " + server.address() + "; ctrl-C ends it");
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

/// "": the usual port; "7000"; "10.0.0.1:7000".
std::string tcp_address(const std::string& place) {
  if (place.empty()) {
    return fmt::format("tcp:127.0.0.1:{}", simulator::usbip::kDefaultPort);
  }
  return (place.find(':') == std::string::npos ? "tcp:127.0.0.1:" : "tcp:") + place;
}

std::string usbip_text(const simulator::UsbIpServer& server, bool plugged_in) {
  const std::string& address = server.address();  // usbip:HOST:PORT
  const std::size_t colon = address.rfind(':');
  const std::string host = address.substr(address.find(':') + 1, colon - address.find(':') - 1);
  const std::string port = address.substr(colon + 1);
  const bool usual = port == std::to_string(simulator::usbip::kDefaultPort);
  const std::string how =
      fmt::format("sudo modprobe vhci-hcd; sudo usbip{} attach -r {} -b {}",
                  usual ? "" : fmt::format(" --tcp-port {}", port), host, server.bus_id());
  return fmt::format("listening on {}; ctrl-C ends it\n{}", address,
                     plugged_in ? "plugged into this machine's own bus: lsusb -d 1209:"
                                : "put it on this machine's bus with: " + how);
}

Result<Answer> run_usbip(const Options& options, simulator::InstrumentOptions which, const Context& context) {
  which.carrier = simulator::Carrier::kUsb;
  const auto instrument = simulator::VirtualInstrument::make(which);
  if (!instrument) {
    return std::unexpected(instrument.error());
  }
  simulator::VhciBus own_bus;
  const auto server = simulator::UsbIpServer::listen(
      tcp_address(options.usbip_place), **instrument,
      {.allow_remote = options.allow_remote,
       .speed = options.speed == "full" ? simulator::UsbBusSpeed::kFull : simulator::UsbBusSpeed::kHigh,
       .plug_into = options.plug_in ? &own_bus : nullptr});
  if (!server) {
    return std::unexpected(server.error());
  }
  const ButtonSignal button([&server] { (*server)->press_button(); });
  announce(context, {{"listening", (*server)->address()}, {"busid", (*server)->bus_id()}},
           usbip_text(**server, options.plug_in));
  if (Status served = (*server)->serve(context.stop); !served) {
    return std::unexpected(served.error());
  }
  const auto statistics = (*server)->statistics();
  Answer answer;
  answer.json = {{"imports", statistics.imports},
                 {"refused_imports", statistics.refused_imports},
                 {"broken", statistics.broken},
                 {"transfers", statistics.transfers},
                 {"bytes_to_host", statistics.bytes_to_host},
                 {"bytes_to_device", statistics.bytes_to_device}};
  answer.text =
      fmt::format("attached {} times, refused {}; {} transfers, {} bytes to the host\n", statistics.imports,
                  statistics.refused_imports, statistics.transfers, statistics.bytes_to_host);
  if (statistics.broken > 0) {
    answer.text += fmt::format("{} connections did not keep to the protocol; the last: {}\n",
                               statistics.broken, statistics.last_problem);
  }
  return answer;
}

Result<Answer> run(const Options& options, const Context& context) {
  if (options.listen.empty() != options.usbip) {
    return fail(ErrorCode::kInvalidArgument, "expected one of --listen and --usbip",
                "scatter simulate --listen tcp:127.0.0.1:7000, or scatter simulate --usbip");
  }
  if (!options.usbip && (options.plug_in || options.speed != "high")) {
    return fail(ErrorCode::kInvalidArgument, "--plug-in and --speed belong to a USB bus", "add --usbip");
  }
  simulator::InstrumentOptions defaults;
  defaults.clock = simulator::ClockMode::kReal;
  const auto which = simulator::parse_instrument_options(query(options), defaults);
  if (!which) {
    return std::unexpected(which.error());
  }
  if (!options.board.empty() && options.usbip) {
    return fail(ErrorCode::kInvalidArgument, "--board: the emulated board has no USB controller",
                "use --listen with it, or leave --board out");
  }
  if (!options.board.empty()) {
    return run_board(options, *which, context);
  }
  if (!options.firmware.empty() || !options.state.empty()) {
    return fail(ErrorCode::kInvalidArgument, "--firmware and --state belong to an emulated board",
                "add --board mps2_an500, or leave them out");
  }
  if (options.usbip) {
    return run_usbip(options, *which, context);
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
  const ButtonSignal button([&server] { (*server)->press_button(); });
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
  app->add_option("--listen", options->listen, "tcp:127.0.0.1:PORT (0: a free one) or unix:PATH");
  const auto* usbip =
      app->add_option(
             "--usbip", options->usbip_place,
             "Put it on the USB bus of Linux machines: PORT (default 3240, 0: a free one) or HOST:PORT")
          ->expected(0, 1)
          ->type_name("[PORT]");
  app->add_flag("--plug-in", options->plug_in,
                "With --usbip: plug it into this machine's own bus (root, vhci-hcd)");
  app->add_option("--speed", options->speed, "With --usbip: speed of the bus")
      ->check(CLI::IsMember({"high", "full"}));
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
  return {app, [options, usbip](const Context& context) {
            options->usbip = usbip->count() > 0;
            return run(*options, context);
          }};
}

}  // namespace scatter::cli
