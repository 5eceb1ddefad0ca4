// The details of the checks of an instrument on which its remedies depend: each was once broken on purpose.
#include <set>

#include "host_sdk/device/usb/instrument_checks.h"
#include "host_sdk/device/usb/udev_rule.h"
#include "tests/unit/device_usb_diagnosis/findings.h"

using namespace scatter::device::usb;
using namespace scatter::diagnosis_test;
namespace device = scatter::device;

namespace {

/// As if no node could be opened.
DiagnosisOptions shut_out(const MadeUpSystem& system) {
  auto options = options_for(system);
  options.may_use = [](const std::filesystem::path&) { return false; };
  return options;
}

std::set<std::string> checks_of(const std::vector<Finding>& findings, const std::string& subject) {
  std::set<std::string> checks;
  for (const Finding& each : findings) {
    if (each.subject == subject) {
      checks.insert(each.check);
    }
  }
  return checks;
}

std::vector<Finding> answered(const scatter::protocol::HelloReply& hello) {
  BusEntry entry;
  entry.serial = "SC42";
  std::vector<Finding> findings;
  check_answer({.program = "scatter"}, entry, hello, findings);
  return findings;
}

/// Counts how often usb: is opened.
class Counted {
 public:
  Counted() {
    registry_.add(
        {.name = "usb", .example = "usb:", .summary = "", .open = [this](const auto&, const auto& wait) {
           ++opened_;
           timeout_ = wait.timeout;
           return scatter::fail(scatter::ErrorCode::kBusy, "held", "wait");
         }});
  }
  [[nodiscard]] const device::TransportRegistry& registry() const { return registry_; }
  [[nodiscard]] int opened() const { return opened_; }
  [[nodiscard]] device::Duration timeout() const { return timeout_; }

 private:
  device::TransportRegistry registry_;
  int opened_ = 0;
  device::Duration timeout_{};
};

}  // namespace

TEST_CASE("Whether the rule was applied is read from this device's record, on any bus") {
  MadeUpSystem system;
  MadeUpDevice device;
  device.bus = 2;
  device.port = "2-1";
  system.plug_in(device);
  // Minor (2 - 1) * 128 + 7 - 1: the kernel's devices.txt.
  system.write("run/udev/data/c189:134", "I:1\nG:systemd\n");
  CHECK(the(diagnose(shut_out(system)), "permissions").command == kApplyUdevRule);
  system.write("run/udev/data/c189:134", "I:1\nG:systemd\nG:uaccess\n");
  const Finding elsewhere = the(diagnose(shut_out(system)), "permissions");
  CHECK(elsewhere.command.find("setfacl") != std::string::npos);
  CHECK(elsewhere.harmless);
  // A record that outlived its rule does not count.
  system.remove("usr/lib/udev/rules.d");
  CHECK(the(diagnose(shut_out(system)), "permissions").command == kInstallUdevRule);
}

TEST_CASE("A rule that was edited is not overwritten by --fix for the permission's sake either") {
  MadeUpSystem system;
  system.plug_in({});
  CHECK(the(diagnose(shut_out(system)), "permissions").harmless);
  system.write("etc/udev/rules.d/60-openscatter.rules", "# mine\n");
  const Finding finding = the(diagnose(shut_out(system)), "permissions");
  CHECK(finding.command == kInstallUdevRule);
  CHECK_FALSE(finding.harmless);
}

TEST_CASE("Permissions are asked of the nodes below the root, and by default of the system") {
  MadeUpSystem system;
  system.plug_in({});
  auto options = options_for(system);
  std::set<std::string> asked;
  options.may_use = [&](const std::filesystem::path& path) {
    asked.insert(path.string());
    return true;
  };
  (void)diagnose(options);
  CHECK(asked == std::set<std::string>{(system.path() / "dev/bus/usb/001/007").string(),
                                       (system.path() / "dev/hidraw0").string()});
  options.may_use = nullptr;
  CHECK(the(diagnose(options), "permissions").verdict == Verdict::kGood);
  system.remove("dev/bus/usb/001/007");
  const Finding missing = the(diagnose(options), "permissions");
  CHECK(missing.verdict == Verdict::kProblem);
  CHECK(missing.found == "/dev/bus/usb/001/007 is missing");
  CHECK(missing.command == "sudo udevadm trigger --subsystem-match=usb --action=add");
  CHECK(missing.harmless);
}

TEST_CASE("Binding and unbinding drivers is harmless; the rescue channel is told by its node") {
  MadeUpSystem system;
  MadeUpDevice device;
  device.stream_driver = "cdc_acm";
  device.hidraw = false;
  system.plug_in(device);
  CHECK(the(findings_of(system), "driver").harmless);
  CHECK(the(findings_of(system), "rescue channel").harmless);
  MadeUpSystem healthy;
  healthy.plug_in({});
  CHECK(the(findings_of(healthy), "rescue channel").found == "/dev/hidraw0");
}

TEST_CASE("Only an instrument that can be opened is asked for its versions, within the time given") {
  MadeUpDevice device;
  const auto opened = [&](bool allowed) {
    MadeUpSystem system;
    system.plug_in(device);
    Counted usb;
    auto options = allowed ? options_for(system) : shut_out(system);
    options.registry = &usb.registry();
    options.wait.timeout = std::chrono::milliseconds(123);
    (void)diagnose(options);
    CHECK(usb.timeout() <= std::chrono::milliseconds(123));
    return usb.opened();
  };
  CHECK(opened(true) == 1);
  CHECK(opened(false) == 0);
  device.stream_driver = "cdc_acm";
  CHECK(opened(true) == 0);
  CHECK(opened(false) == 0);
}

TEST_CASE("In DFU mode only what there is then is examined") {
  MadeUpSystem system;
  MadeUpDevice waiting;
  waiting.product_id = "000e";
  system.plug_in(waiting);
  CHECK(checks_of(findings_of(system), "usb:serial=SC42") ==
        std::set<std::string>{"identity", "permissions", "bus speed"});
}

TEST_CASE("Neither two instruments without a serial number nor a stranger with the same count as several") {
  MadeUpSystem system;
  MadeUpDevice first;
  MadeUpDevice second;
  second.port = "1-2";
  second.address = 8;
  SECTION("without") {
    first.serial.clear();
    second.serial.clear();
  }
  SECTION("a stranger") {
    second.stream_class = "03";
  }
  system.plug_in(first);
  system.plug_in(second);
  for (const Finding& each : findings_of(system)) {
    CHECK(each.found.find("several instruments") == std::string::npos);
  }
}

TEST_CASE("A bootloader that answers is a problem, and the command gives it firmware") {
  scatter::protocol::HelloReply hello;
  hello.capabilities = scatter::protocol::kCapabilityRescue;
  const Finding firmware = the(answered(hello), "firmware");
  CHECK(firmware.verdict == Verdict::kProblem);
  CHECK(firmware.command == "scatter flash usb:serial=SC42 build/firmware/openscatter.scfw");
  CHECK_FALSE(firmware.harmless);
  hello.capabilities = 0;
  CHECK(the(answered(hello), "firmware").verdict == Verdict::kGood);
}

TEST_CASE("A schema that differs is a warning that says which side is older") {
  scatter::protocol::HelloReply hello;
  CHECK(the(answered(hello), "protocol").verdict == Verdict::kGood);
  hello.schema_revision = scatter::protocol::kSchemaRevision - 1;
  const Finding old = the(answered(hello), "protocol");
  CHECK(old.verdict == Verdict::kWarning);
  CHECK(old.why.find("firmware is older") != std::string::npos);
  hello.schema_revision = scatter::protocol::kSchemaRevision + 1;
  const Finding young = the(answered(hello), "protocol");
  CHECK(young.verdict == Verdict::kWarning);
  CHECK(young.why.find("this program is older") != std::string::npos);
}
