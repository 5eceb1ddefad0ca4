#include "host_sdk/device/usb/instrument_checks.h"

#include <fmt/format.h>

#include <fstream>
#include <string>
#include <system_error>
#include <utility>

#include "host_sdk/device/device.h"
#include "host_sdk/device/usb/udev_rule.h"

namespace scatter::device::usb {
namespace {

namespace fs = std::filesystem;
using Verdict = Finding::Verdict;

constexpr unsigned kUsbMajor = 189;  // Of device nodes; the kernel's devices.txt.

/// udev's database says that the tag was put on this device: the rule has been applied to it.
bool rule_applied(const DiagnosisOptions& options, const BusEntry& entry) {
  const unsigned minor = (entry.bus - 1U) * 128U + entry.address - 1U;
  std::ifstream record(options.root.path / "run/udev/data" / fmt::format("c{}:{}", kUsbMajor, minor));
  for (std::string line; std::getline(record, line);) {
    if (line == "G:uaccess") {
      return true;
    }
  }
  return false;
}

/// What lets this user at the nodes.
void mend_permission(const DiagnosisOptions& options, const BusEntry& entry, RuleState rule,
                     const std::string& nodes, Finding& finding) {
  finding.verdict = Verdict::kProblem;
  finding.harmless = true;
  if (rule == RuleState::kCurrent && rule_applied(options, entry)) {
    finding.why =
        "the udev rule gives instruments to whoever sits at this computer; over ssh, a user must be let in";
    finding.command = fmt::format("sudo setfacl -m \"u:$(id -un):rw\" {}", nodes);
  } else if (rule == RuleState::kCurrent) {
    finding.why = "the udev rule was installed after this instrument was plugged in";
    finding.command = kApplyUdevRule;
  } else {
    finding.why = "the udev rule is missing or another one";
    finding.command = kInstallUdevRule;
    finding.harmless = rule == RuleState::kMissing;
  }
}

void check_permissions(const DiagnosisOptions& options, const BusEntry& entry, RuleState rule,
                       const std::string& subject, std::vector<Finding>& out) {
  const auto may_use = [&](const fs::path& node) {
    const fs::path path = under(options.root, node);
    return options.may_use ? options.may_use(path) : may_read_and_write(path);
  };
  Finding finding{.check = "permissions", .subject = subject};
  std::string refused;
  const auto look = [&](const fs::path& node) {
    if (!may_use(node)) {
      refused += fmt::format("{}{}", refused.empty() ? "" : " ", node.string());
    }
  };
  look(entry.node());
  for (const auto& node : entry.hidraw) {
    look(node);
  }
  std::error_code error;
  if (refused.empty()) {
    finding.found = fmt::format("this user may open {}", entry.node().string());
  } else if (!fs::exists(under(options.root, entry.node()), error)) {
    finding.verdict = Verdict::kProblem;
    finding.found = fmt::format("{} is missing", entry.node().string());
    finding.why = "the instrument cannot be opened; in a container, see the check usb";
    finding.command = "sudo udevadm trigger --subsystem-match=usb --action=add";
    finding.harmless = true;
  } else {
    finding.found = fmt::format("this user may not open {}", refused);
    mend_permission(options, entry, rule, refused, finding);
  }
  out.push_back(std::move(finding));
}

void check_driver(const BusEntry& entry, const std::string& subject, std::vector<Finding>& out) {
  Finding finding{.check = "driver", .subject = subject, .found = "no kernel driver on the stream interface"};
  if (!entry.stream_driver.empty() && entry.stream_driver != "usbfs") {
    finding.verdict = Verdict::kProblem;
    finding.found = fmt::format("the kernel driver '{}' holds the stream interface", entry.stream_driver);
    finding.why = "no program can read frames while it does";
    finding.command = fmt::format("echo {}:1.0 | sudo tee /sys/bus/usb/drivers/{}/unbind > /dev/null",
                                  entry.port, entry.stream_driver);
    finding.harmless = true;
  }
  out.push_back(std::move(finding));
}

void check_rescue_channel(const BusEntry& entry, const std::string& subject, std::vector<Finding>& out) {
  Finding finding{.check = "rescue channel", .subject = subject};
  if (!entry.rescue_interface) {
    finding.verdict = Verdict::kWarning;
    finding.found = "the instrument has no HID interface";
    finding.why = "neither scatter rescue nor the measure button work; newer firmware has it";
  } else if (entry.hidraw.empty()) {
    finding.verdict = Verdict::kWarning;
    finding.found = "the HID interface has no hidraw node";
    finding.why = "neither scatter rescue nor the measure button work";
    finding.command = fmt::format(
        "sudo modprobe usbhid && echo {}:1.1 | sudo tee /sys/bus/usb/drivers/usbhid/bind > /dev/null",
        entry.port);
    finding.harmless = true;
  } else {
    finding.found = entry.hidraw.front().string();
  }
  out.push_back(std::move(finding));
}

void check_speed(const BusEntry& entry, const std::string& subject, std::vector<Finding>& out) {
  Finding finding{.check = "bus speed", .subject = subject};
  if (entry.speed_mbps == 0) {
    finding.verdict = Verdict::kUnknown;
    finding.found = "the system does not say";
    finding.why = "frames may come slowly";
  } else {
    finding.found = fmt::format("{} Mb/s", entry.speed_mbps);
  }
  if (slow_bus(entry)) {
    finding.verdict = Verdict::kWarning;
    finding.found += ", expected 480 or more";
    finding.why =
        "frames come slower than the sensor takes them; use another socket, a shorter cable and no old hub";
  }
  out.push_back(std::move(finding));
}

std::string release_of(const BusEntry& entry) {
  return fmt::format("release {}", release_words(entry.release));
}

void ask_versions(const DiagnosisOptions& options, const BusEntry& entry, const std::string& subject,
                  std::vector<Finding>& out) {
  Finding firmware{.check = "firmware", .subject = subject};
  const std::string release = release_of(entry);
  if (options.registry == nullptr || entry.in_use) {
    firmware.found = fmt::format("{}{}", release, entry.in_use ? "; not asked while it is in use" : "");
    out.push_back(std::move(firmware));
    return;
  }
  const Result<Device> device = Device::open(uri_of(entry), {.registry = options.registry,
                                                             .wait = options.wait,
                                                             .host_name = "scatter doctor",
                                                             .build_id = "",
                                                             .nonce = {}});
  if (!device) {
    const Error& error = device.error();
    const bool version = error.code == ErrorCode::kVersionMismatch;
    firmware.check = version ? "protocol" : "firmware";
    firmware.verdict = error.code == ErrorCode::kBusy ? Verdict::kUnknown : Verdict::kProblem;
    firmware.found = fmt::format("{}; {}", release, error.what);
    firmware.why = error.remedy;
    if (version) {
      // Neither side can ask the other for an update over the wire; DFU needs no common version.
      firmware.command = fmt::format(
          "dfu-util -d 1209:000d,1209:000e -p {} -E 1 -R -D build/firmware/openscatter.dfu", entry.port);
    }
    out.push_back(std::move(firmware));
    return;
  }
  check_answer(options, entry, device->hello(), out);
}

}  // namespace

void check_answer(const DiagnosisOptions& options, const BusEntry& entry, const protocol::HelloReply& hello,
                  std::vector<Finding>& out) {
  const std::string subject = uri_of(entry);
  Finding firmware{.check = "firmware", .subject = subject};
  firmware.found = fmt::format("{}, {}", hello.build_id.str(), release_of(entry));
  if ((hello.capabilities & protocol::kCapabilityRescue) != 0) {
    firmware.verdict = Verdict::kProblem;
    firmware.found += "; the bootloader answers: no firmware could be started";
    firmware.why = "it cannot measure";
    firmware.command =
        fmt::format("{} flash {} build/firmware/openscatter.scfw", options.program, uri_of(entry));
  }
  out.push_back(std::move(firmware));
  Finding wire{.check = "protocol", .subject = subject};
  wire.found = fmt::format("wire {}, schema {} (this program: {}, {})", hello.wire_major,
                           hello.schema_revision, protocol::kWireMajor, protocol::kSchemaRevision);
  if (hello.schema_revision < protocol::kSchemaRevision) {
    wire.verdict = Verdict::kWarning;
    wire.why = "its firmware is older than this program, so it lacks some requests; update it";
  } else if (hello.schema_revision > protocol::kSchemaRevision) {
    wire.verdict = Verdict::kWarning;
    wire.why = "this program is older than its firmware and cannot use all of it; update OpenScatter";
  }
  out.push_back(std::move(wire));
}

void check_instrument(const DiagnosisOptions& options, const BusEntry& entry, RuleState rule,
                      std::vector<Finding>& out) {
  const std::string subject = uri_of(entry);
  Finding identity{.check = "identity", .subject = subject, .found = entry.product};
  if (!entry.ours) {
    identity.verdict = Verdict::kWarning;
    identity.found =
        fmt::format("the device at port {} has an instrument's numbers but not its interfaces{}", entry.port,
                    entry.product.empty() ? "" : fmt::format(": '{}'", entry.product));
    identity.why = "the numbers are for tests, so that others may use them, too; it is left alone";
    out.push_back(std::move(identity));
    return;
  }
  if (entry.dfu_mode) {
    identity.verdict = Verdict::kProblem;
    identity.found = "waits for firmware (DFU mode)";
    identity.why = "it cannot measure; unplug it and plug it in again, and if it stays so, give it firmware";
    identity.command =
        fmt::format("dfu-util -d 1209:000e -p {} -D build/firmware/openscatter.dfu", entry.port);
  } else if (entry.serial.empty()) {
    identity.verdict = Verdict::kWarning;
    identity.found = "no serial number";
    identity.why = "it can be named by its socket only";
  }
  out.push_back(std::move(identity));
  check_permissions(options, entry, rule, subject, out);
  const bool usable = out.back().verdict == Verdict::kGood;
  check_speed(entry, subject, out);
  if (entry.dfu_mode) {
    return;
  }
  check_driver(entry, subject, out);
  const bool driverless = out.back().verdict == Verdict::kGood;
  check_rescue_channel(entry, subject, out);
  if (entry.in_use) {
    out.push_back(
        {.check = "in use", .subject = subject, .found = fmt::format("by {}", holder_words(entry))});
  }
  if (usable && driverless) {
    ask_versions(options, entry, subject, out);
  }
}

}  // namespace scatter::device::usb
