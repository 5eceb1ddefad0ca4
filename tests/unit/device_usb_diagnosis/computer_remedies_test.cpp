// The details of the checks of the computer on which its remedies depend: each was once broken on purpose.
#include <unistd.h>

#include "host_sdk/device/usb/udev_rule.h"
#include "protocol/usb_identity.h"
#include "tests/unit/device_usb_diagnosis/findings.h"

using namespace scatter::device::usb;
using namespace scatter::diagnosis_test;

namespace {

const std::string kName = "60-openscatter.rules";
const std::string kMemory = "sys/module/usbcore/parameters/usbfs_memory_mb";

std::string another_rule() {
  return std::string(udev_rule()) + "# edited\n";
}

}  // namespace

TEST_CASE("Each sign of a container counts") {
  for (const char* sign : {".dockerenv", "run/.containerenv", "run/systemd/container"}) {
    INFO(sign);
    MadeUpSystem system;
    system.remove("dev/bus");
    system.write(sign, "");
    CHECK(the(findings_of(system), "usb").found.find("container") != std::string::npos);
  }
}

TEST_CASE("--fix may make missing nodes and load the bus driver: both are gone after the next boot") {
  MadeUpSystem system;
  system.remove("dev/bus");
  CHECK(the(findings_of(system), "usb").harmless);
  system.remove("sys/bus");
  CHECK(the(findings_of(system), "usb").harmless);
}

TEST_CASE("Of several rule files the one in udev's first folder counts") {
  // udev(7): /etc over /run over /usr/local/lib over /usr/lib.
  const std::vector<std::string> folders = {"etc/udev/rules.d/", "run/udev/rules.d/",
                                            "usr/local/lib/udev/rules.d/", "usr/lib/udev/rules.d/"};
  for (std::size_t first = 0; first < folders.size(); ++first) {
    for (std::size_t second = first + 1; second < folders.size(); ++second) {
      INFO(folders[first] << " over " << folders[second]);
      MadeUpSystem system;
      system.remove("usr/lib/udev/rules.d");
      system.write(folders[first] + kName, std::string(udev_rule()));
      system.write(folders[second] + kName, another_rule());
      CHECK(the(findings_of(system), "udev rule").verdict == Verdict::kGood);
      system.write(folders[first] + kName, another_rule());
      system.write(folders[second] + kName, std::string(udev_rule()));
      CHECK(the(findings_of(system), "udev rule").verdict == Verdict::kProblem);
    }
  }
}

TEST_CASE("A rule that is switched off is told from one that was edited") {
  MadeUpSystem system;
  const std::string file = "etc/udev/rules.d/" + kName;
  system.write(file, another_rule());
  CHECK(the(findings_of(system), "udev rule").found.find("differs") != std::string::npos);
  system.write(file, "");
  CHECK(the(findings_of(system), "udev rule").found.find("switches the rule off") != std::string::npos);
  // A name in /etc hides that of /usr/lib, wherever it points.
  system.link("/nowhere", file);
  const Finding rule = the(findings_of(system), "udev rule");
  CHECK(rule.found.find("switches the rule off") != std::string::npos);
  CHECK_FALSE(rule.harmless);
}

TEST_CASE("Where udev does not run, --fix has nothing to install") {
  MadeUpSystem system;
  system.remove("usr/lib/udev/rules.d");
  system.remove("run/udev/control");
  CHECK_FALSE(the(findings_of(system), "udev rule").harmless);
}

TEST_CASE("Transfer memory that cannot be read is told from one that is no number, and from no limit") {
  MadeUpSystem system;
  system.write(kMemory, "0\n");
  CHECK(the(findings_of(system), "usbfs memory").found == "no limit");
  system.write(kMemory, "much\n");
  CHECK(the(findings_of(system), "usbfs memory").found == "is no number");
  system.remove(kMemory);
  CHECK(the(findings_of(system), "usbfs memory").found == "cannot be read");
}

TEST_CASE("Every instrument counts for transfer memory, and raising the limit is harmless") {
  // 64 transfers of one wire frame each; whole megabytes, rounded up.
  const auto needed = [](std::uint64_t instruments) {
    const std::uint64_t bytes = instruments * 64 * scatter::protocol::usb::kTransferBytes;
    return (bytes + 1'048'575) / 1'048'576;
  };
  std::uint64_t most = 1;
  while (needed(most + 1) <= 16) {
    ++most;
  }
  MadeUpSystem system;
  for (std::uint64_t k = 0; k < most; ++k) {
    MadeUpDevice device;
    device.port = "1-" + std::to_string(k + 1);
    device.address = static_cast<int>(k + 2);
    device.serial = "SC" + std::to_string(k);
    system.plug_in(device);
  }
  CHECK(the(findings_of(system), "usbfs memory").verdict == Verdict::kGood);
  MadeUpDevice last;
  last.port = "1-100";
  last.address = 100;
  system.plug_in(last);
  const Finding memory = the(findings_of(system), "usbfs memory");
  CHECK(memory.verdict == Verdict::kProblem);
  CHECK(memory.harmless);
  CHECK(memory.found.find(std::to_string(most + 1) + " instruments take up to " +
                          std::to_string(needed(most + 1)) + " MB") != std::string::npos);
}

TEST_CASE("Free space is that of the folder's disk, in words a person reads") {
  const MadeUpSystem system;
  auto options = options_for(system);
  options.free_disk_bytes = {};
  options.output_folder = (system.path() / "not/made/yet/").string();
  const Finding asked = the(diagnose(options), "disk");
  CHECK(asked.subject == (system.path() / "not/made/yet").string());
  // A disk with nothing left would fail the rest of this suite, too.
  CHECK_FALSE(asked.found.starts_with("0 MB"));
  options.output_folder = (system.path() / "made/../here/.").string();
  CHECK(the(diagnose(options), "disk").subject == (system.path() / "here").string());
  options.free_disk_bytes = 2 * kGigabyte;
  CHECK(the(diagnose(options), "disk").found == "2 GB free");
  options.free_disk_bytes = 256ULL << 20U;
  CHECK(the(diagnose(options), "disk").verdict == Verdict::kWarning);
  CHECK(the(diagnose(options), "disk").found.starts_with("256 MB free"));
  --*options.free_disk_bytes;
  CHECK(the(diagnose(options), "disk").verdict == Verdict::kProblem);
}

TEST_CASE("Free space that cannot be told is unknown, neither good nor bad") {
  const MadeUpSystem system;
  auto options = options_for(system);
  options.free_disk_bytes = {};
  options.output_folder = "";
  CHECK(the(diagnose(options), "disk").verdict == Verdict::kUnknown);
}

TEST_CASE("Verdicts in words; whether commands need sudo is asked of the system") {
  CHECK(std::string(words(Verdict::kGood)) == "ok");
  CHECK(std::string(words(Verdict::kWarning)) == "warning");
  CHECK(std::string(words(Verdict::kProblem)) == "PROBLEM");
  CHECK(std::string(words(Verdict::kUnknown)) == "unknown");
  MadeUpSystem system;
  system.remove("dev/bus");
  auto options = options_for(system);
  options.as_root = {};
  CHECK(the(diagnose(options), "usb").command.starts_with("sudo ") == (geteuid() != 0));
}
