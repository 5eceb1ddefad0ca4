// What can be wrong with a bus and with what is plugged in: a clear error with a remedy, in bounded time.
#include <algorithm>

#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/device/usb/diagnosis.h"
#include "tests/usb/child.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using device::Device;
using integration::pattern_recipe;

namespace {

/// Opens, and expects this error within the limit, with a remedy.
Error refused(Host& host, ErrorCode code, const std::string& uri = "usb:", double limit_ms = 1000,
              const device::Wait& wait = {}) {
  const Clock::time_point begin = Clock::now();
  Result<Device> device = host.try_open(uri, wait);
  CHECK(ms_since(begin) < limit_ms);
  REQUIRE_FALSE(device.has_value());
  INFO(device.error().what << " / " << device.error().remedy);
  CHECK(device.error().code == code);
  CHECK_FALSE(device.error().remedy.empty());
  return device.error();
}

bool says(const Error& error, std::string_view text) {
  return (error.what + "\n" + error.remedy).find(text) != std::string::npos;
}

/// Plugged in anew and as it should be.
void check_usable(Host& host) {
  host.bus().unplug();
  host.bus().plug();
  Device device = host.open_soon();
  check_whole(integration::run(device, pattern_recipe(3)), 3);
}

}  // namespace

TEST_CASE("No instrument plugged in: not found, and what to look at") {
  Host host;
  host.bus().unplug();
  (void)refused(host, ErrorCode::kNotFound);
  (void)refused(host, ErrorCode::kNotFound, "usb:serial=SIM-00000001");
  host.bus().plug();
}

TEST_CASE("Another serial number than the one plugged in: those there are listed") {
  Host host;
  CHECK(says(refused(host, ErrorCode::kNotFound, "usb:serial=NOSUCH"), "SIM-00000001"));
}

TEST_CASE("A key that usb: does not know is refused by name") {
  Host host;
  CHECK(says(refused(host, ErrorCode::kInvalidArgument, "usb:sereal=SIM-00000001"), "sereal"));
}

TEST_CASE("No permission: the udev rule is named with the command that installs it") {
  Host host;
  host.allow_warnings();
  host.bus().set_access(false);
  const Error error = refused(host, ErrorCode::kPermissionDenied);
  CHECK(says(error, "udev"));
  CHECK(says(error, "sudo"));
  host.bus().set_access(true);
  check_usable(host);
}

TEST_CASE("Held by another program: busy, and the program is named") {
  Host host;
  host.bus().allow_abandoned();
  Child holder({SCATTER_USB_HOLDER, "usb:"});
  REQUIRE(holder.line() == "streaming");
  const Error error = refused(host, ErrorCode::kBusy);
  CHECK(says(error, "usb_holder"));
  CHECK(says(error, std::to_string(holder.process())));
  holder.kill();
  check_usable(host);
}

TEST_CASE("Held by a program that cannot be seen: busy all the same") {
  Host host;
  host.bus().hold_interface(0, true);
  (void)refused(host, ErrorCode::kBusy);
  host.bus().hold_interface(0, false);
  check_usable(host);
}

TEST_CASE("Opened twice by one program: busy, and said to be its own doing") {
  Host host;
  {
    Device first = host.open();
    const Error error = refused(host, ErrorCode::kBusy);
    CHECK(says(error, "this program has it open already"));
    CHECK_FALSE(says(error, "in use by"));
    check_whole(integration::run(first, pattern_recipe(3)), 3);
  }
  // Held by another, this program is no holder just because it tried.
  host.bus().hold_interface(0, true);
  CHECK_FALSE(says(refused(host, ErrorCode::kBusy), "this program"));
  host.bus().hold_interface(0, false);
  check_usable(host);
}

TEST_CASE("Firmware of another wire version: said as such, which side is older, and how to mend it") {
  struct Case {
    int major;
    bool refuses;
    const char* older;
    const char* remedy;
  };
  for (const Case& each : {Case{2, true, "this program is older", "update OpenScatter"},
                           Case{2, false, "this program is older", "update OpenScatter"},
                           Case{0, false, "firmware is older", "update the firmware"}}) {
    INFO("wire major " << each.major << (each.refuses ? ", refuses" : ", answers"));
    Host host;
    host.bus().unplug();
    const int slot = host.bus().add_of_other_wire(each.major, each.refuses, "seed=5");
    host.bus().plug(slot);
    REQUIRE(soon([&] { return device::usb::scan_bus().size() == 1; }));
    CHECK(device::usb::scan_bus().front().ours);
    const Error error = refused(host, ErrorCode::kVersionMismatch);
    CHECK(says(error, each.older));
    CHECK(error.remedy.find(each.remedy) != std::string::npos);
    // And again: the refusal leaves nothing behind.
    (void)refused(host, ErrorCode::kVersionMismatch);

    device::usb::DiagnosisOptions options;
    options.registry = &host.registry();
    const auto findings = device::usb::diagnose(options);
    const auto found =
        std::ranges::find_if(findings, [](const auto& finding) { return finding.check == "protocol"; });
    REQUIRE(found != findings.end());
    CHECK(found->verdict == device::usb::Finding::Verdict::kProblem);
    CHECK(found->found.find(each.older) != std::string::npos);
    CHECK(found->why.find(each.remedy) != std::string::npos);
    CHECK(found->command.find("dfu-util -d 1209:000d") != std::string::npos);
    host.bus().unplug(slot);
    host.bus().plug();
  }
}

TEST_CASE("A stranger's device with our numbers is never spoken to, and told apart from an instrument") {
  Host host;
  host.bus().unplug();
  const int slot = host.bus().add_stranger();
  host.bus().plug(slot);
  REQUIRE(soon([&] { return device::usb::scan_bus().size() == 1; }));
  CHECK_FALSE(device::usb::scan_bus().front().ours);
  const Statistics before = host.bus().statistics();
  CHECK(says(refused(host, ErrorCode::kFailedPrecondition), "Thermostat"));
  CHECK(host.bus().statistics()["bytes_out"] == before.at("bytes_out"));
  // Beside it the instrument is found without a name.
  host.bus().plug();
  Device device = host.open_soon();
  CHECK(device.descriptor().serial.str() == "SIM-00000001");
  host.bus().unplug(slot);
}

TEST_CASE("Descriptors cut anywhere or full of random bytes: an error, never a hang or a crash") {
  Host host;
  host.allow_warnings();
  const int whole = 18 + 0x5B;  // Device descriptor and configuration of ours.
  for (int bytes = 0; bytes < whole; bytes += 3) {
    INFO("cut to " << bytes << " bytes");
    host.bus().unplug();
    host.bus().cut_descriptors(bytes);
    host.bus().plug();
    (void)device::usb::scan_bus();
    const Clock::time_point begin = Clock::now();
    Result<Device> device = host.try_open();
    CHECK(ms_since(begin) < 1000);
    REQUIRE_FALSE(device.has_value());
    const bool known =
        device.error().code == ErrorCode::kNotFound || device.error().code == ErrorCode::kFailedPrecondition;
    CHECK(known);
    CHECK_FALSE(device.error().remedy.empty());
  }
  host.bus().cut_descriptors(-1);
  for (std::uint32_t seed = 1; seed <= 50; ++seed) {
    INFO("random bytes of seed " << seed);
    host.bus().unplug();
    host.bus().scramble_descriptors(seed);
    host.bus().plug();
    (void)device::usb::scan_bus();
    const Clock::time_point begin = Clock::now();
    CHECK_FALSE(host.try_open().has_value());
    CHECK(ms_since(begin) < 1000);
  }
  host.bus().scramble_descriptors(0);
  check_usable(host);
}

TEST_CASE("A device that answers nothing is given up at the deadline") {
  Host host;
  host.allow_warnings();
  host.bus().hang();
  const device::Wait wait{.timeout = std::chrono::milliseconds(500)};
  (void)refused(host, ErrorCode::kDeadlineExceeded, "usb:", 800, wait);
  check_usable(host);
}

TEST_CASE("A stop request ends the opening of a device that answers nothing") {
  Host host;
  host.allow_warnings();
  host.bus().hang();
  std::stop_source source;
  std::jthread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    source.request_stop();
  });
  const device::Wait wait{.timeout = std::chrono::seconds(4), .stop = source.get_token()};
  (void)refused(host, ErrorCode::kAborted, "usb:", 200, wait);
  check_usable(host);
}

TEST_CASE("Without the HID interface's driver frames come all the same") {
  Host host;
  host.bus().unplug();
  host.bus().set_hid_driver(false);
  host.bus().plug();
  Device device = host.open_soon();
  check_whole(integration::run(device, pattern_recipe(3)), 3);
  host.bus().set_hid_driver(true);
}

TEST_CASE("A hub that loses power in a stream: disconnected within 300 ms, and the ledger balances") {
  Host host;
  Device device = host.open();
  REQUIRE(device.configure(endless_recipe()).has_value());
  auto stream = device.start();
  REQUIRE(stream.has_value());
  REQUIRE(stream->next().has_value());
  const Clock::time_point begin = Clock::now();
  host.bus().cut_power();
  std::optional<Error> error;
  while (!error) {
    if (const auto frame = stream->next(); !frame) {
      error = frame.error();
    }
  }
  CHECK(error->code == ErrorCode::kDisconnected);
  CHECK(ms_since(begin) < 300);
  CHECK(stream->summary().ledger.balances());
}

TEST_CASE("usbfs without memory: said as such, with the command that raises the limit") {
  Host host;
  host.allow_warnings();
  host.bus().unplug();
  host.bus().plug();
  (void)host.open_soon();
  host.bus().set_memory(100'000);
  Result<Device> device = host.try_open();
  if (device) {
    // Fewer transfers do as well: then frames come.
    check_whole(integration::run(*device, pattern_recipe(3)), 3);
  } else {
    CHECK(device.error().code == ErrorCode::kResourceExhausted);
    CHECK(says(device.error(), "usbfs_memory_mb"));
  }
  CHECK(host.bus().statistics()["refused_memory"] > 0);
  host.bus().set_memory(16'000'000);
}

TEST_CASE("An instrument on a 12 Mb/s bus works and says that it is slow") {
  Host host;
  host.bus().unplug();
  host.bus().plug(0, 12);
  Device device = host.open_soon();
  check_whole(integration::run(device, pattern_recipe(3)), 3);
  const auto notices = device.notices();
  REQUIRE_FALSE(notices.empty());
  CHECK(notices.front().what.find("12") != std::string::npos);
  CHECK_FALSE(notices.front().remedy.empty());
  host.bus().unplug();
  host.bus().plug();
  CHECK(host.open_soon().notices().empty());
}
