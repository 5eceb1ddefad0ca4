#include "tools/scatter/measurement_json.h"

#include <fmt/format.h>

#include "host_sdk/reflectance/direction.h"

namespace scatter::cli {

using nlohmann::ordered_json;

ordered_json to_json(const protocol::Ledger& ledger) {
  return {{"exposed", ledger.exposed},         {"delivered", ledger.delivered},
          {"lost_sensor", ledger.lost_sensor}, {"lost_firmware", ledger.lost_firmware},
          {"lost_link", ledger.lost_link},     {"lost_host", ledger.lost_host},
          {"corrupt", ledger.corrupt}};
}

ordered_json to_json(const std::vector<measurement::QualityItem>& items) {
  ordered_json rows = ordered_json::array();
  for (const auto& item : items) {
    rows.push_back({{"name", item.name},
                    {"value", item.value},
                    {"limit", item.limit},
                    {"verdict", measurement::name(item.verdict)},
                    {"advice", item.advice}});
  }
  return rows;
}

ordered_json to_json(const std::vector<measurement::AlbedoRow>& rows) {
  ordered_json list = ordered_json::array();
  for (const auto& row : rows) {
    list.push_back({{"theta_i_deg", reflectance::degrees(row.theta_i_rad)},
                    {"phi_i_deg", reflectance::degrees(row.phi_i_rad)},
                    {"albedo", row.albedo},
                    {"standard_uncertainty", row.standard_uncertainty}});
  }
  return list;
}

std::string words(const protocol::Ledger& ledger) {
  std::string text = fmt::format("{} of {} frames", ledger.delivered, ledger.exposed);
  const auto add = [&](std::uint64_t count, const char* where) {
    if (count > 0) {
      text += fmt::format(", {} {}", count, where);
    }
  };
  add(ledger.lost_sensor, "lost by the sensor");
  add(ledger.lost_firmware, "lost by the instrument");
  add(ledger.lost_link, "lost on the link");
  add(ledger.lost_host, "lost by this computer");
  add(ledger.corrupt, "corrupt");
  return ledger.balances() ? text : text + " (the ledger does not balance)";
}

}  // namespace scatter::cli
