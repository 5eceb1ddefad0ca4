// scatter list: which instruments are there, and how others are named.
#include <CLI/CLI.hpp>

#include "host_sdk/device/discovery.h"
#include "host_sdk/device/transport.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

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

Result<Answer> list(const Context& context) {
  Answer answer;
  auto& devices = answer.json["devices"] = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> rows;
  for (const auto& found :
       device::list_devices(context.registry, {.timeout = std::chrono::seconds(1), .stop = context.stop})) {
    devices.push_back({{"uri", found.uri},
                       {"state", state_name(found.state)},
                       {"product", found.product},
                       {"serial", found.serial},
                       {"detail", found.detail},
                       {"remedy", found.remedy}});
    rows.push_back({found.uri, state_name(found.state), found.product, found.serial,
                    found.remedy.empty() ? found.detail : found.detail + ": " + found.remedy});
  }
  answer.text = rows.empty()
                    ? "No instrument found. Instruments on the network or on sockets are named in the "
                      "environment variable SCATTER_URIS.\n"
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
  return {root.add_subcommand("list", "Show the instruments that can be reached"), list};
}

}  // namespace scatter::cli
