#include "tools/scatter/firmware_description.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <string_view>

#include "host_sdk/device/update_check.h"
#include "host_sdk/firmware_files/keys.h"

namespace scatter::cli {
namespace {

struct Slot {
  unsigned index = 0;
  std::string version;
  protocol::SlotVerdict verdict = protocol::SlotVerdict::kEmpty;
  std::uint32_t counter = 0;
  bool running = false;
};

std::array<Slot, 2> slots_of(const protocol::UpdateState& state, bool rescue) {
  const unsigned running = state.running_slot == 0 ? 0 : 1;
  std::array<Slot, 2> slots;
  slots[running] = {.index = running,
                    .version = std::string(state.running_version.str()),
                    .verdict = state.running_verdict,
                    .counter = state.running_counter,
                    .running = !rescue};
  slots[1 - running] = {.index = 1 - running,
                        .version = std::string(state.other_version.str()),
                        .verdict = state.other_verdict,
                        .counter = state.other_counter,
                        .running = false};
  return slots;
}

struct Reason {
  unsigned bit;
  std::string_view words;
};

/// CFSR: Armv7-M Architecture Reference Manual, B3.2.15.
constexpr std::array kFaultStatus = {
    Reason{0, "instruction fetched from forbidden memory"},
    Reason{1, "forbidden memory accessed"},
    Reason{3, "forbidden memory while leaving an exception"},
    Reason{4, "forbidden memory while entering an exception (stack overflow)"},
    Reason{5, "forbidden memory while saving floating-point state"},
    Reason{8, "bus fault on an instruction fetch"},
    Reason{9, "bus fault on a data access"},
    Reason{10, "bus fault on a data access, reported late"},
    Reason{11, "bus fault while leaving an exception"},
    Reason{12, "bus fault while entering an exception"},
    Reason{13, "bus fault while saving floating-point state"},
    Reason{16, "undefined instruction"},
    Reason{17, "invalid processor state"},
    Reason{18, "invalid return from an exception"},
    Reason{19, "coprocessor or floating-point unit used while off"},
    Reason{24, "unaligned access"},
    Reason{25, "division by zero"},
};
/// HFSR: B3.2.16. FORCED (bit 30) only says that CFSR has the reason.
constexpr std::array kHardFaultStatus = {
    Reason{1, "vector table cannot be read"},
    Reason{31, "breakpoint without a debugger"},
};

std::string hex(std::uint32_t value) {
  return fmt::format("0x{:08x}", value);
}

}  // namespace

nlohmann::ordered_json to_json(const protocol::UpdateState& state, bool rescue) {
  nlohmann::ordered_json slots = nlohmann::ordered_json::array();
  for (const Slot& slot : slots_of(state, rescue)) {
    slots.push_back({{"slot", slot.index},
                     {"version", slot.version},
                     {"verdict", device::words(slot.verdict)},
                     {"security_counter", slot.counter},
                     {"running", slot.running},
                     {"trial", slot.running && state.phase == protocol::UpdatePhase::kTrial}});
  }
  return {{"slots", std::move(slots)},
          {"update", device::words(state.phase)},
          {"received_bytes", state.received},
          {"lowest_security_counter", state.lowest_counter},
          {"slot_bytes", state.slot_bytes}};
}

TextRows rows_of(const protocol::UpdateState& state, bool rescue) {
  TextRows rows;
  for (const Slot& slot : slots_of(state, rescue)) {
    std::string text = slot.version.empty() ? std::string(device::words(slot.verdict))
                                            : fmt::format("{}, security counter {}: {}", slot.version,
                                                          slot.counter, device::words(slot.verdict));
    rows.push_back({fmt::format("slot {}{}", slot.index, slot.running ? ", runs" : ""), std::move(text)});
  }
  std::string update(device::words(state.phase));
  if (state.phase == protocol::UpdatePhase::kReceiving) {
    update += fmt::format(" ({} bytes so far)", state.received);
  }
  rows.push_back(
      {"update", fmt::format("{}; takes security counter {} or higher", update, state.lowest_counter)});
  return rows;
}

std::vector<std::string> fault_reasons(std::uint32_t fault_status, std::uint32_t hard_fault_status) {
  std::vector<std::string> out;
  const auto collect = [&](const auto& table, std::uint32_t bits) {
    for (const Reason& reason : table) {
      if ((bits >> reason.bit & 1U) != 0) {
        out.emplace_back(reason.words);
      }
    }
  };
  collect(kFaultStatus, fault_status);
  collect(kHardFaultStatus, hard_fault_status);
  return out;
}

nlohmann::ordered_json to_json(const protocol::FaultRecord& record) {
  if (record.present == 0) {
    return nullptr;
  }
  return {{"reason", device::words(static_cast<protocol::ResetReason>(record.reason))},
          {"reasons", fault_reasons(record.fault_status, record.hard_fault_status)},
          {"exception", record.exception},
          {"firmware", record.build_id.str()},
          {"boot_count", record.boot_count},
          {"uptime_s", double(record.uptime_us) * 1e-6},
          {"pc", hex(record.pc)},
          {"lr", hex(record.lr)},
          {"sp", hex(record.sp)},
          {"psr", hex(record.psr)},
          {"cfsr", hex(record.fault_status)},
          {"hfsr", hex(record.hard_fault_status)},
          {"fault_address", hex(record.fault_address)}};
}

std::string words(const protocol::FaultRecord& record) {
  if (record.present == 0) {
    return "none since power-on";
  }
  const auto reasons = fault_reasons(record.fault_status, record.hard_fault_status);
  const bool watchdog = record.reason == static_cast<std::uint8_t>(protocol::ResetReason::kWatchdog);
  std::string what = watchdog          ? "the main loop hung (watchdog)"
                     : reasons.empty() ? fmt::format("exception {}", record.exception)
                                       : fmt::format("{}", fmt::join(reasons, "; "));
  if (record.fault_address != 0) {
    what += fmt::format(", at address {}", hex(record.fault_address));
  }
  return fmt::format("{}; pc {}, lr {}, {:.3f} s after boot {}, in {}", what, hex(record.pc), hex(record.lr),
                     double(record.uptime_us) * 1e-6, record.boot_count, record.build_id.str());
}

nlohmann::ordered_json to_json(const firmware_files::Package& package) {
  nlohmann::ordered_json images = nlohmann::ordered_json::array();
  for (std::size_t slot = 0; slot < firmware_files::kImages; ++slot) {
    const auto& header = package.image(slot).header;
    images.push_back(
        {{"slot", slot}, {"address", hex(header.load_address)}, {"body_bytes", header.body_bytes}});
  }
  return {{"product", package.product()},
          {"version", package.version()},
          {"security_counter", package.security_counter()},
          {"key", firmware_files::text(package.key())},
          {"test_key", package.for_test()},
          {"images", std::move(images)}};
}

std::string key_words(const protocol::KeyId& id, bool for_test) {
  return fmt::format("key {}{}", firmware_files::text(id),
                     for_test ? " (the test key, which everybody has)" : "");
}

}  // namespace scatter::cli
