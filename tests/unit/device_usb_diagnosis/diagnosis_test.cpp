// PROVES: issue 6: doctor checks permissions, udev rule, usbfs memory, bus speed, firmware and protocol
// versions, free disk, and prints for each problem the exact command that mends it.
#include "host_sdk/device/usb/diagnosis.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "host_sdk/device/device.h"
#include "host_sdk/device/usb/udev_rule.h"
#include "tests/unit/device_usb_diagnosis/findings.h"
#include "tools/sim_scheme/sim_scheme.h"

using namespace scatter::device::usb;
using namespace scatter::diagnosis_test;
namespace device = scatter::device;
using scatter::ErrorCode;

namespace {

bool all_good(const std::vector<Finding>& findings) {
  return std::ranges::all_of(findings, [](const Finding& each) {
    UNSCOPED_INFO(each.check << ": " << each.found);
    return each.verdict == Verdict::kGood;
  });
}

}  // namespace

TEST_CASE(
    "A healthy computer with a healthy instrument has nothing but good findings, and every check is there") {
  MadeUpSystem system;
  system.plug_in({});
  const auto findings = findings_of(system);
  CHECK(all_good(findings));
  std::set<std::string> checks;
  for (const Finding& each : findings) {
    checks.insert(each.check);
    CHECK(each.why.empty());
    CHECK(each.command.empty());
    CHECK_FALSE(each.found.empty());
  }
  CHECK(checks == std::set<std::string>{"usb", "udev rule", "usbfs memory", "virtual bus", "disk", "identity",
                                        "permissions", "bus speed", "driver", "rescue channel", "firmware"});
}

TEST_CASE("Every finding that is not good says why it matters") {
  MadeUpSystem system;
  system.remove("usr/lib/udev/rules.d");
  system.remove("dev/bus");
  system.write("sys/module/usbcore/parameters/usbfs_memory_mb", "nonsense\n");
  auto options = options_for(system);
  options.free_disk_bytes = 0;
  for (const Finding& each : diagnose(options)) {
    INFO(each.check << ": " << each.found);
    CHECK((each.verdict == Verdict::kGood) == each.why.empty());
  }
}

TEST_CASE("Nothing plugged in is a warning, not a problem") {
  const MadeUpSystem system;
  const Finding none = the(findings_of(system), "instrument");
  CHECK(none.verdict == Verdict::kWarning);
}

TEST_CASE("A container without the bus is told which option gives it") {
  MadeUpSystem system;
  system.remove("dev/bus");
  system.write(".dockerenv", "");
  const Finding usb = the(findings_of(system), "usb");
  CHECK(usb.verdict == Verdict::kProblem);
  CHECK(usb.why.find("--device /dev/bus/usb") != std::string::npos);
  // Nothing that runs inside can mend it.
  CHECK(usb.command.empty());
}

TEST_CASE("Missing nodes are made by udev, a missing bus by its driver") {
  MadeUpSystem system;
  system.remove("dev/bus");
  const Finding nodes = the(findings_of(system), "usb");
  CHECK(nodes.verdict == Verdict::kProblem);
  CHECK(nodes.command == "sudo udevadm trigger --subsystem-match=usb --action=add");
  system.remove("sys/bus");
  const Finding bus = the(findings_of(system), "usb");
  CHECK(bus.verdict == Verdict::kProblem);
  CHECK(bus.command.find("modprobe") != std::string::npos);
}

TEST_CASE("The udev rule is found wherever udev looks for it") {
  for (const char* folder :
       {"etc/udev/rules.d", "run/udev/rules.d", "usr/local/lib/udev/rules.d", "lib/udev/rules.d"}) {
    MadeUpSystem system;
    system.remove("usr/lib/udev/rules.d");
    system.write(std::filesystem::path(folder) / kUdevRuleName, std::string(udev_rule()));
    const Finding rule = the(findings_of(system), "udev rule");
    INFO(rule.found);
    CHECK(rule.verdict == Verdict::kGood);
    CHECK(rule.found.find(folder) != std::string::npos);
  }
}

TEST_CASE("A missing udev rule is a problem with the command that installs it, and harmless to mend") {
  MadeUpSystem system;
  system.remove("usr/lib/udev/rules.d");
  const Finding rule = the(findings_of(system), "udev rule");
  CHECK(rule.verdict == Verdict::kProblem);
  CHECK(rule.harmless);
  CHECK(rule.command ==
        "scatter doctor --udev-rule | sudo tee /etc/udev/rules.d/60-openscatter.rules > /dev/null && sudo "
        "udevadm "
        "control --reload && sudo udevadm trigger --subsystem-match=usb --subsystem-match=hidraw");
  SECTION("where udev does not run, nothing would obey it") {
    system.remove("run/udev/control");
    const Finding idle = the(findings_of(system), "udev rule");
    CHECK(idle.verdict == Verdict::kWarning);
    CHECK(idle.command.empty());
  }
}

TEST_CASE("An edited or masked rule in /etc wins over the good one, and --fix leaves it alone") {
  MadeUpSystem system;
  const std::filesystem::path file = "etc/udev/rules.d/60-openscatter.rules";
  SECTION("another version") {
    system.write(file, "SUBSYSTEM==\"usb\"\n");
  }
  SECTION("one character changed") {
    std::string text(udev_rule());
    text[text.find("0660")] = '1';
    system.write(file, text);
  }
  SECTION("empty") {
    system.write(file, "");
  }
  SECTION("a link to nothing") {
    system.link("/dev/null", file);
  }
  const Finding rule = the(findings_of(system), "udev rule");
  CHECK(rule.verdict == Verdict::kProblem);
  CHECK(rule.found.find("/etc/udev/rules.d/60-openscatter.rules") != std::string::npos);
  CHECK_FALSE(rule.command.empty());
  CHECK_FALSE(rule.harmless);
}

TEST_CASE("Transfer memory: no limit and the kernel's limit are good, less is not") {
  struct Case {
    const char* text;
    Verdict verdict;
  };
  // An instrument takes up to 64 transfers of 16.9 kB: 1.1 MB.
  for (const Case& each :
       {Case{"0\n", Verdict::kGood}, Case{"16\n", Verdict::kGood}, Case{"1000\n", Verdict::kGood},
        Case{"15\n", Verdict::kWarning}, Case{"1\n", Verdict::kProblem}}) {
    MadeUpSystem system;
    system.plug_in({});
    system.write("sys/module/usbcore/parameters/usbfs_memory_mb", each.text);
    const Finding memory = the(findings_of(system), "usbfs memory");
    INFO(each.text);
    CHECK(memory.verdict == each.verdict);
    CHECK(
        (memory.command == "echo 64 | sudo tee /sys/module/usbcore/parameters/usbfs_memory_mb > /dev/null") ==
        (each.verdict != Verdict::kGood));
  }
  for (const char* text : {"", "much\n"}) {
    MadeUpSystem system;
    system.write("sys/module/usbcore/parameters/usbfs_memory_mb", text);
    CHECK(the(findings_of(system), "usbfs memory").verdict == Verdict::kUnknown);
  }
}

TEST_CASE("The virtual bus is told of, and never a problem") {
  MadeUpSystem system;
  system.remove("sys/devices/platform");
  const Finding bus = the(findings_of(system), "virtual bus");
  CHECK(bus.verdict == Verdict::kGood);
  CHECK(bus.found.find("modprobe vhci-hcd") != std::string::npos);
}

TEST_CASE("A disk that cannot take a measurement is a problem, one that takes few a warning") {
  const MadeUpSystem system;
  auto options = options_for(system);
  options.output_folder = (system.path() / "not/made/yet").string();
  options.free_disk_bytes = 200ULL << 20U;
  CHECK(the(diagnose(options), "disk").verdict == Verdict::kProblem);
  options.free_disk_bytes = kGigabyte;
  CHECK(the(diagnose(options), "disk").verdict == Verdict::kWarning);
  options.free_disk_bytes = 2 * kGigabyte;
  CHECK(the(diagnose(options), "disk").verdict == Verdict::kGood);
  options.free_disk_bytes = {};
  const Finding asked = the(diagnose(options), "disk");
  CHECK(asked.verdict != Verdict::kUnknown);
  CHECK(asked.subject == options.output_folder);
}

TEST_CASE("A user who may not open the instrument gets the command that fits the reason") {
  MadeUpSystem system;
  system.plug_in({});
  auto options = options_for(system);
  options.may_use = [](const std::filesystem::path&) { return false; };
  SECTION("no rule: install it") {
    system.remove("usr/lib/udev/rules.d");
    const Finding finding = the(diagnose(options), "permissions");
    CHECK(finding.command == kInstallUdevRule);
    CHECK(finding.harmless);
  }
  SECTION("the rule came after the instrument: apply it") {
    CHECK(the(diagnose(options), "permissions").command == kApplyUdevRule);
  }
  SECTION("the rule was applied, and the user sits elsewhere: let the user in") {
    // Major 189, minor (bus - 1) * 128 + address - 1: the kernel's devices.txt.
    system.write("run/udev/data/c189:6", "I:1\nG:uaccess\nQ:uaccess\n");
    CHECK(the(diagnose(options), "permissions").command ==
          "sudo setfacl -m \"u:$(id -un):rw\" /dev/bus/usb/001/007 /dev/hidraw0");
  }
  const Finding finding = the(diagnose(options), "permissions");
  CHECK(finding.verdict == Verdict::kProblem);
  CHECK(finding.subject == "usb:serial=SC42");
  CHECK(finding.found.find("/dev/bus/usb/001/007") != std::string::npos);
}

TEST_CASE("A hidraw node alone that may not be opened is a problem, too") {
  MadeUpSystem system;
  system.plug_in({});
  auto options = options_for(system);
  options.may_use = [](const std::filesystem::path& path) { return path.filename() != "hidraw0"; };
  const Finding finding = the(diagnose(options), "permissions");
  CHECK(finding.verdict == Verdict::kProblem);
  CHECK(finding.found == "this user may not open /dev/hidraw0");
}

TEST_CASE("A kernel driver on the stream interface is unbound by the command") {
  MadeUpSystem system;
  MadeUpDevice taken;
  taken.stream_driver = "cdc_acm";
  system.plug_in(taken);
  const Finding finding = the(findings_of(system), "driver");
  CHECK(finding.verdict == Verdict::kProblem);
  CHECK(finding.command == "echo 1-1.4:1.0 | sudo tee /sys/bus/usb/drivers/cdc_acm/unbind > /dev/null");
}

TEST_CASE("A slow bus and an unknown one are told from a fast one") {
  struct Case {
    const char* speed;
    Verdict verdict;
  };
  for (const Case& each :
       {Case{"1.5", Verdict::kWarning}, Case{"12", Verdict::kWarning}, Case{"480", Verdict::kGood},
        Case{"5000", Verdict::kGood}, Case{"unknown", Verdict::kUnknown}}) {
    MadeUpSystem system;
    MadeUpDevice plugged;
    plugged.speed = each.speed;
    system.plug_in(plugged);
    INFO(each.speed);
    CHECK(the(findings_of(system), "bus speed").verdict == each.verdict);
  }
}

TEST_CASE("A rescue channel that is missing is told from one that lacks its node") {
  MadeUpSystem system;
  MadeUpDevice plugged;
  SECTION("no HID interface") {
    plugged.hid = false;
    system.plug_in(plugged);
    const Finding finding = the(findings_of(system), "rescue channel");
    CHECK(finding.verdict == Verdict::kWarning);
    CHECK(finding.command.empty());
  }
  SECTION("no node") {
    plugged.hidraw = false;
    system.plug_in(plugged);
    const Finding finding = the(findings_of(system), "rescue channel");
    CHECK(finding.verdict == Verdict::kWarning);
    CHECK(finding.command ==
          "sudo modprobe usbhid && echo 1-1.4:1.1 | sudo tee /sys/bus/usb/drivers/usbhid/bind > /dev/null");
  }
}

TEST_CASE("A device in use is named with its program and not asked") {
  MadeUpSystem system;
  const MadeUpDevice plugged;
  system.plug_in(plugged);
  system.hold(plugged, 1234, "somebody");
  auto options = options_for(system);
  device::TransportRegistry registry;
  int opened = 0;
  registry.add({.name = "usb", .example = "usb:", .summary = "", .open = [&](const auto&, const auto&) {
                  ++opened;
                  return scatter::fail(ErrorCode::kBusy, "held", "wait");
                }});
  options.registry = &registry;
  const auto findings = diagnose(options);
  CHECK(opened == 0);
  CHECK(the(findings, "in use").found == "by somebody (1234)");
  CHECK(the(findings, "firmware").found.find("not asked") != std::string::npos);
}

TEST_CASE("A free instrument is asked for its firmware and protocol") {
  MadeUpSystem system;
  system.plug_in({});
  auto options = options_for(system);
  device::TransportRegistry registry;
  scatter::tools::register_sim_scheme(registry);
  registry.add(
      {.name = "usb", .example = "usb:", .summary = "", .open = [&](const auto&, const device::Wait& wait) {
         return registry.open("sim:", wait);
       }});
  options.registry = &registry;
  const auto findings = diagnose(options);
  CHECK(all_good(findings));
  device::OpenOptions opening;
  opening.registry = &registry;
  const auto direct = device::Device::open("sim:", opening);
  REQUIRE(direct);
  CHECK(the(findings, "firmware").found.starts_with(direct->hello().build_id.str()));
  CHECK(the(findings, "firmware").found.find("1.2.3") != std::string::npos);
  CHECK(the(findings, "protocol").found == "wire 1, schema 2 (this program: 1, 2)");
}

TEST_CASE("A free instrument of another protocol version, and one that fails to answer, are problems") {
  MadeUpSystem system;
  system.plug_in({});
  struct Case {
    ErrorCode code;
    const char* check;
    Verdict verdict;
  };
  for (const Case& each : {Case{ErrorCode::kVersionMismatch, "protocol", Verdict::kProblem},
                           Case{ErrorCode::kDeadlineExceeded, "firmware", Verdict::kProblem},
                           Case{ErrorCode::kBusy, "firmware", Verdict::kUnknown}}) {
    auto options = options_for(system);
    device::TransportRegistry registry;
    std::string asked;
    registry.add(
        {.name = "usb", .example = "usb:", .summary = "", .open = [&](const device::Uri& uri, const auto&) {
           asked = uri.text();
           return scatter::fail(each.code, "the cause", "the remedy");
         }});
    options.registry = &registry;
    const Finding finding = the(diagnose(options), each.check);
    CHECK(asked == "usb:serial=SC42");
    CHECK(finding.verdict == each.verdict);
    CHECK(finding.found.find("the cause") != std::string::npos);
    CHECK(finding.why == "the remedy");
    // DFU is the way to new firmware that needs no common wire version.
    CHECK((finding.command.find("dfu-util") != std::string::npos) ==
          (each.code == ErrorCode::kVersionMismatch));
    CHECK_FALSE(finding.harmless);
  }
}

TEST_CASE("A stranger's device with our numbers is a warning, and is neither examined nor asked") {
  MadeUpSystem system;
  MadeUpDevice stranger;
  stranger.stream_class = "03";
  stranger.product = "Somebody's joystick";
  system.plug_in(stranger);
  const auto findings = findings_of(system);
  const Finding identity = the(findings, "identity");
  CHECK(identity.verdict == Verdict::kWarning);
  CHECK(identity.found.find("Somebody's joystick") != std::string::npos);
  CHECK(std::ranges::none_of(findings, [](const Finding& each) { return each.check == "permissions"; }));
}

TEST_CASE("An instrument in DFU mode gets the command that gives it firmware") {
  MadeUpSystem system;
  MadeUpDevice waiting;
  waiting.product_id = "000e";
  system.plug_in(waiting);
  const auto findings = findings_of(system);
  const Finding identity = the(findings, "identity");
  CHECK(identity.verdict == Verdict::kProblem);
  CHECK(identity.command == "dfu-util -d 1209:000e -p 1-1.4 -D build/firmware/openscatter.dfu");
  CHECK_FALSE(identity.harmless);
  CHECK(the(findings, "permissions").verdict == Verdict::kGood);
}

TEST_CASE("Instruments without, or with the same, serial numbers are told of") {
  MadeUpSystem system;
  MadeUpDevice first;
  MadeUpDevice second;
  second.port = "1-2";
  second.address = 8;
  SECTION("the same") {
    system.plug_in(first);
    system.plug_in(second);
    const auto findings = findings_of(system);
    CHECK(std::ranges::any_of(findings, [](const Finding& each) {
      return each.verdict == Verdict::kProblem && each.found.find("ports 1-1.4, 1-2") != std::string::npos;
    }));
  }
  SECTION("none") {
    first.serial.clear();
    system.plug_in(first);
    const Finding identity = the(findings_of(system), "identity", "usb:port=1-1.4");
    CHECK(identity.verdict == Verdict::kWarning);
  }
}

TEST_CASE("Commands call this program by its name and need no sudo as root") {
  MadeUpSystem system;
  system.remove("usr/lib/udev/rules.d");
  auto options = options_for(system);
  options.program = "/opt/scatter/bin/scatter";
  options.as_root = true;
  CHECK(the(diagnose(options), "udev rule").command ==
        "/opt/scatter/bin/scatter doctor --udev-rule | tee /etc/udev/rules.d/60-openscatter.rules > "
        "/dev/null && "
        "udevadm control --reload && udevadm trigger --subsystem-match=usb --subsystem-match=hidraw");
}
