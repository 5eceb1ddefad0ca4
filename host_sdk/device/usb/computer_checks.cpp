#include "host_sdk/device/usb/computer_checks.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>

#include "host_sdk/device/usb/udev_rule.h"
#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

namespace fs = std::filesystem;
using Verdict = Finding::Verdict;

/// Where udev looks, the first one that has the name counts.
constexpr std::array kRuleFolders = {"etc/udev/rules.d", "run/udev/rules.d", "usr/local/lib/udev/rules.d",
                                     "usr/lib/udev/rules.d", "lib/udev/rules.d"};
/// The kernel's own limit; cameras share it.
constexpr std::uint64_t kUsualUsbfs_MB = 16;
/// ContextOptions::transfers at most.
constexpr std::uint64_t kMostTransfers = 64;
/// A measurement with its results is about 130 MB.
constexpr std::uint64_t kLeastDisk_B = 256ULL << 20U;
constexpr std::uint64_t kGoodDisk_B = 2ULL << 30U;

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The rule file that udev obeys; "" when there is none.
fs::path rule_file(const SystemRoot& root) {
  for (const char* folder : kRuleFolders) {
    const fs::path file = root.path / folder / kUdevRuleName;
    std::error_code error;
    if (fs::exists(fs::symlink_status(file, error))) {
      return file;
    }
  }
  return {};
}

bool in_container(const SystemRoot& root) {
  return is_there(root.path / ".dockerenv") || is_there(root.path / "run/.containerenv") ||
         is_there(root.path / "run/systemd/container");
}

void check_usb(const DiagnosisOptions& options, std::vector<Finding>& out) {
  Finding finding{.check = "usb"};
  const fs::path& root = options.root.path;
  const bool tables = is_there(root / "sys/bus/usb/devices");
  const bool nodes = is_there(root / "dev/bus/usb");
  if (tables && nodes) {
    finding.found = "/dev/bus/usb is there";
  } else if (in_container(options.root)) {
    finding.verdict = Verdict::kProblem;
    finding.found = "this is a container without /dev/bus/usb";
    finding.why =
        "no instrument can be opened; start the container again with these options: --device /dev/bus/usb "
        "--volume /run/udev:/run/udev:ro (docker and podman alike; instruments plugged in later need "
        "--volume /dev:/dev and --device-cgroup-rule 'c 189:* rmw' instead)";
  } else if (tables) {
    finding.verdict = Verdict::kProblem;
    finding.found = "the kernel has USB, but /dev/bus/usb is missing";
    finding.why = "no instrument can be opened; udev makes it";
    finding.command = "sudo udevadm trigger --subsystem-match=usb --action=add";
    finding.harmless = true;
  } else {
    finding.verdict = Verdict::kProblem;
    finding.found = "the kernel shows no USB (/sys/bus/usb/devices is missing)";
    finding.why = "this computer has no USB controller, or its driver is not loaded";
    finding.command = "sudo modprobe xhci_pci";
    finding.harmless = true;
  }
  out.push_back(std::move(finding));
}

void check_rule(const DiagnosisOptions& options, RuleState state, std::vector<Finding>& out) {
  const fs::path file = rule_file(options.root);
  Finding finding{.check = "udev rule", .subject = std::string(kUdevRuleName)};
  const std::string shown =
      file.empty() ? "" : fmt::format("/{}", file.lexically_relative(options.root.path).string());

  if (state == RuleState::kCurrent) {
    finding.found = fmt::format("{} is the one of this version", shown);
    out.push_back(std::move(finding));
    return;
  }
  finding.verdict = Verdict::kProblem;
  finding.why = "only root may use instruments, and ModemManager may disturb them";
  finding.command = kInstallUdevRule;
  finding.harmless = true;
  if (state == RuleState::kMissing) {
    finding.found = "not installed";
    if (!is_there(options.root.path / "run/udev/control")) {
      // Nobody here would obey it: a container, or a system that makes its nodes another way.
      finding.verdict = Verdict::kWarning;
      finding.found = "not installed, and udev does not run here";
      finding.why = "rules count where udev runs: in a container, on its host";
      finding.command.clear();
      finding.harmless = false;
    }
  } else if (state == RuleState::kMasked) {
    finding.found = fmt::format("{} is empty, which switches the rule off", shown);
    // Somebody did that on purpose.
    finding.harmless = false;
  } else {
    finding.found = fmt::format("{} differs from the one of this version", shown);
    finding.why = "it is of another version, or was edited; instruments may be left out by it";
    finding.harmless = false;
  }
  out.push_back(std::move(finding));
}

void check_usbfs(const DiagnosisOptions& options, std::size_t instruments, std::vector<Finding>& out) {
  const fs::path file = "/sys/module/usbcore/parameters/usbfs_memory_mb";
  Finding finding{.check = "usbfs memory", .subject = file.string()};
  const std::string text = content(under(options.root, file));
  std::uint64_t limit_MB = 0;
  if (std::from_chars(text.data(), text.data() + text.size(), limit_MB).ec != std::errc()) {
    finding.verdict = Verdict::kUnknown;
    finding.found = text.empty() ? "cannot be read" : "is no number";
    finding.why = "whether transfers find memory shows only when an instrument is opened";
    out.push_back(std::move(finding));
    return;
  }
  const std::uint64_t each_B = kMostTransfers * protocol::usb::kTransferBytes;
  const std::uint64_t needed_MB = (instruments * each_B + (1U << 20U) - 1) >> 20U;
  finding.found = limit_MB == 0 ? "no limit" : fmt::format("{} MB for all programs together", limit_MB);
  if (limit_MB != 0 && (limit_MB < kUsualUsbfs_MB || limit_MB < needed_MB)) {
    finding.verdict = limit_MB < needed_MB ? Verdict::kProblem : Verdict::kWarning;
    finding.found +=
        fmt::format("; {} instruments take up to {} MB, cameras much more", instruments, needed_MB);
    finding.why = "opening fails, or transfers stop, when it is used up";
    finding.command = fmt::format("echo 64 | sudo tee {} > /dev/null", file.string());
    finding.harmless = true;  // Until the next boot.
  }
  out.push_back(std::move(finding));
}

void check_virtual_bus(const DiagnosisOptions& options, std::vector<Finding>& out) {
  Finding finding{.check = "virtual bus"};
  if (is_there(options.root.path / "sys/devices/platform/vhci_hcd.0")) {
    finding.found = "vhci-hcd is loaded: simulated instruments can be plugged in";
  } else {
    finding.found =
        "vhci-hcd is not loaded, which only scatter simulate --plug-in needs: sudo modprobe vhci-hcd";
  }
  out.push_back(std::move(finding));
}

std::string amount(std::uint64_t bytes) {
  return bytes >= kGoodDisk_B ? fmt::format("{} GB", bytes >> 30U) : fmt::format("{} MB", bytes >> 20U);
}

void check_disk(const DiagnosisOptions& options, std::vector<Finding>& out) {
  std::error_code error;
  fs::path folder = fs::absolute(options.output_folder, error).lexically_normal();
  if (!folder.has_filename() && folder.has_relative_path()) {
    folder = folder.parent_path();  // "here/." and "here/" are "here".
  }
  Finding finding{.check = "disk", .subject = folder.string()};
  while (!is_there(folder) && folder.has_parent_path() && folder != folder.parent_path()) {
    folder = folder.parent_path();  // It will be made.
  }
  std::uint64_t free_B = options.free_disk_bytes.value_or(0);
  if (!options.free_disk_bytes) {
    free_B = fs::space(folder, error).available;
  }
  if (error) {
    finding.verdict = Verdict::kUnknown;
    finding.found = fmt::format("free space cannot be told: {}", error.message());
    finding.why = "name another folder with --output";
    out.push_back(std::move(finding));
    return;
  }
  finding.found = fmt::format("{} free", amount(free_B));
  if (free_B < kGoodDisk_B) {
    finding.verdict = free_B < kLeastDisk_B ? Verdict::kProblem : Verdict::kWarning;
    finding.found += "; a measurement takes about 130 MB";
    finding.why = "a recording ends when the disk is full; free some space, or name another folder with -o";
  }
  out.push_back(std::move(finding));
}

}  // namespace

RuleState rule_state(const SystemRoot& root) {
  const fs::path file = rule_file(root);
  if (file.empty()) {
    return RuleState::kMissing;
  }
  const std::string text = content(file);
  if (text.empty()) {
    return RuleState::kMasked;  // Empty, or a link to /dev/null: udev's way of switching a rule off.
  }
  return text == udev_rule() ? RuleState::kCurrent : RuleState::kOther;
}

void check_computer(const DiagnosisOptions& options, std::size_t instruments, std::vector<Finding>& out) {
  check_usb(options, out);
  check_rule(options, rule_state(options.root), out);
  check_usbfs(options, instruments, out);
  check_virtual_bus(options, out);
  check_disk(options, out);
}

}  // namespace scatter::device::usb
