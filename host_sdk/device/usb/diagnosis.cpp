#include "host_sdk/device/usb/diagnosis.h"

#include <fmt/format.h>
#include <unistd.h>

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "host_sdk/device/usb/computer_checks.h"
#include "host_sdk/device/usb/instrument_checks.h"

namespace scatter::device::usb {
namespace {

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

void check_serials(const std::vector<BusEntry>& entries, std::vector<Finding>& out) {
  std::map<std::string, std::vector<std::string>> ports;
  for (const BusEntry& entry : entries) {
    if (entry.ours && !entry.serial.empty()) {
      ports[entry.serial].push_back(entry.port);
    }
  }
  for (const auto& [serial, where] : ports) {
    if (where.size() > 1) {
      std::string text;
      for (const auto& port : where) {
        text += (text.empty() ? "" : ", ") + port;
      }
      out.push_back({.check = "identity",
                     .subject = fmt::format("usb:serial={}", serial),
                     .verdict = Finding::Verdict::kProblem,
                     .found = fmt::format("several instruments have this serial number: ports {}", text),
                     .why = "none of them can be named by it; name them by their sockets: usb:port=PORT"});
    }
  }
}

}  // namespace

const char* words(Finding::Verdict verdict) noexcept {
  switch (verdict) {
    case Finding::Verdict::kGood:
      return "ok";
    case Finding::Verdict::kWarning:
      return "warning";
    case Finding::Verdict::kProblem:
      return "PROBLEM";
    case Finding::Verdict::kUnknown:
      break;
  }
  return "unknown";
}

std::vector<Finding> diagnose(const DiagnosisOptions& options) {
  const std::vector<BusEntry> entries = scan_bus(options.root);
  std::vector<Finding> out;
  check_computer(options, entries.size(), out);
  const RuleState rule = rule_state(options.root);
  if (entries.empty()) {
    out.push_back(
        {.check = "instrument",
         .verdict = Finding::Verdict::kWarning,
         .found = "none is plugged in",
         .why = "plug it in and switch it on; a charging cable without data lines looks like this"});
  }
  check_serials(entries, out);
  for (const BusEntry& entry : entries) {
    check_instrument(options, entry, rule, out);
  }
  const bool root = options.as_root.value_or(geteuid() == 0);
  for (Finding& finding : out) {
    if (finding.command.starts_with("scatter ")) {
      finding.command.replace(0, std::string_view("scatter").size(), options.program);
    }
    if (root) {
      replace_all(finding.command, "sudo ", "");
    }
  }
  return out;
}

}  // namespace scatter::device::usb
