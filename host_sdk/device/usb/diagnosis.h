// What stands between this computer and its instruments: each finding with the command that mends it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/device/transport.h"
#include "host_sdk/device/usb/availability.h"
#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/device/wait.h"

namespace scatter::device::usb {

struct Finding {
  enum class Verdict { kGood, kWarning, kProblem, kUnknown };
  std::string check = {};    ///< "usb", "udev rule", "usbfs memory", "virtual bus", "disk", "instrument"; for
                             ///< each instrument: "identity", "permissions", "driver", "rescue channel", "bus
                             ///< speed", "in use", "firmware", "protocol".
  std::string subject = {};  ///< Which instrument or file; "" for the computer.
  Verdict verdict = Verdict::kGood;
  std::string found = {};  ///< What is there, and what was expected.
  std::string why = {};    ///< What goes wrong because of it; "" when good.
  std::string command =
      {};                 ///< Exact command that mends it; "" where a person must act (then `why` says how).
  bool harmless = false;  ///< `command` changes nothing that somebody may want to keep: --fix may run it.
};

struct DiagnosisOptions {
  SystemRoot root = {};
  const TransportRegistry* registry =
      nullptr;                      ///< To ask free instruments for their versions; null: not asked.
  std::string output_folder = ".";  ///< Where recordings would go, for free disk space.
  Wait wait = {.timeout = std::chrono::seconds(2)};  ///< For each instrument that is asked.
  std::string program = "scatter";                   ///< How commands call this program.
  MayUse may_use = nullptr;
  std::optional<std::uint64_t> free_disk_bytes = {};  ///< Empty: asks the system.
  std::optional<bool> as_root = {};                   ///< Commands need no sudo then. Empty: asks the system.
};

/// Everything that can be checked, good ones included, the computer first. Devices in use are not opened.
/// The same tree, registry and options give the same findings.
/// Cost  a few file reads, and one HELLO per free instrument.
[[nodiscard]] std::vector<Finding> diagnose(const DiagnosisOptions& options);

[[nodiscard]] const char* words(Finding::Verdict verdict) noexcept;

}  // namespace scatter::device::usb
