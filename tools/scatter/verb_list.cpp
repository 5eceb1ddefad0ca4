// scatter list: which instruments are there, and how others are named.
#include <CLI/CLI.hpp>

#include <memory>

#include "host_sdk/device/discovery.h"
#include "host_sdk/device/transport.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/usb_listing.h"
#include "tools/scatter/usb_watch.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

struct Options {
  bool watch = false;
  std::string root = "/";
};

const char* state_name(device::Listing::State state) {
  switch (state) {
    case device::Listing::State::kFree:
      return "free";
    case device::Listing::State::kInUse:
      return "in use";
    case device::Listing::State::kUnreachable:
      return "unreachable";
  }
  return "unreachable";
}

Result<Answer> list(const Options& options, const Context& context) {
  Answer answer;
  auto& devices = answer.json["devices"] = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> rows;
  const device::usb::SystemRoot root{.path = options.root};
  for (const auto& entry : device::usb::scan_bus(root)) {
    devices.push_back(to_json(entry, root));
    rows.push_back(row_of(entry, root));
  }
  for (const auto& found :
       device::list_devices(context.registry, {.timeout = std::chrono::seconds(1), .stop = context.stop})) {
    devices.push_back({{"uri", found.uri},
                       {"state", state_name(found.state)},
                       {"product", found.product},
                       {"serial", found.serial},
                       {"detail", found.detail},
                       {"remedy", found.remedy}});
    rows.push_back({found.uri, state_name(found.state), found.product, found.serial, "", "",
                    found.remedy.empty() ? found.detail : found.detail + ": " + found.remedy});
  }
  answer.text = rows.empty()
                    ? "No instrument found. scatter doctor looks for the cause when one is plugged in. "
                      "Instruments on the network or on sockets are named in the environment variable "
                      "SCATTER_URIS.\n"
                    : text_table(rows);
  auto& schemes = answer.json["schemes"] = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> known;
  for (const auto& scheme : context.registry.schemes()) {
    schemes.push_back({{"name", scheme.name}, {"example", scheme.example}, {"summary", scheme.summary}});
    known.push_back({scheme.example, scheme.summary});
  }
  answer.text += "\nAn instrument can always be named by its URI:\n" + text_table(known, "  ");
  return answer;
}

}  // namespace

Verb add_list(CLI::App& root) {
  auto* app = root.add_subcommand("list", "Show the instruments that can be reached; disturbs none");
  auto options = std::make_shared<Options>();
  app->add_flag("--watch", options->watch, "Print USB instruments as they come and go, until ctrl-C");
  app->add_option("--root", options->root, "Read the system's tables under this folder")
      ->check(CLI::ExistingDirectory);
  return {app, [options](const Context& context) {
            return options->watch ? watch_bus(context) : list(*options, context);
          }};
}

}  // namespace scatter::cli
