// Firmware slots, updates and crashes in words and in JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_sdk/firmware_files/package.h"
#include "protocol/messages.h"

namespace scatter::cli {

/// Rows for text_table(): one per slot, and one for the update.
using TextRows = std::vector<std::vector<std::string>>;

[[nodiscard]] nlohmann::ordered_json to_json(const protocol::UpdateState& state, bool rescue);
[[nodiscard]] TextRows rows_of(const protocol::UpdateState& state, bool rescue);

/// The reasons that Cortex-M's fault status registers (CFSR, HFSR) name, in words; empty when they name none.
[[nodiscard]] std::vector<std::string> fault_reasons(std::uint32_t fault_status,
                                                     std::uint32_t hard_fault_status);
[[nodiscard]] nlohmann::ordered_json to_json(const protocol::FaultRecord& record);
/// "none since power-on", or what happened, where and when.
[[nodiscard]] std::string words(const protocol::FaultRecord& record);

/// Product, version, counter, key and both images of a firmware file.
[[nodiscard]] nlohmann::ordered_json to_json(const firmware_files::Package& package);
/// "key c407... (the test key, which everybody has)"
[[nodiscard]] std::string key_words(const protocol::KeyId& id, bool for_test);

}  // namespace scatter::cli
