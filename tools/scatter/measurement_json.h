// The ledger of frames and the quality report, for machines and for people.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "host_sdk/measurement/process.h"
#include "host_sdk/measurement/quality.h"
#include "protocol/types.h"

namespace scatter::cli {

/// {"exposed": .., "delivered": .., "lost_sensor": .., "lost_firmware": .., "lost_link": .., "lost_host": ..,
/// "corrupt": ..}
[[nodiscard]] nlohmann::ordered_json to_json(const protocol::Ledger& ledger);

/// [{"name", "value", "limit", "verdict", "advice"}, ...]
[[nodiscard]] nlohmann::ordered_json to_json(const std::vector<measurement::QualityItem>& items);

/// [{"theta_i_deg", "phi_i_deg", "albedo", "standard_uncertainty"}, ...]
[[nodiscard]] nlohmann::ordered_json to_json(const std::vector<measurement::AlbedoRow>& rows);

/// "48 of 48 frames" or what was lost where.
[[nodiscard]] std::string words(const protocol::Ledger& ledger);

}  // namespace scatter::cli
