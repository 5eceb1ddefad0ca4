// PROVES: issue 6: `scatter list` never opens or disturbs a device in use.
#include "host_sdk/device/usb/availability.h"

#include <catch2/catch.hpp>

#include "tests/unit/device_usb_diagnosis/made_up_system.h"

using namespace scatter::device::usb;

namespace {

SystemRoot root_of(const MadeUpSystem& system) {
  return {.path = system.path()};
}

Availability of(const MadeUpSystem& system, bool allowed = true) {
  const auto entries = scan_bus(root_of(system));
  REQUIRE(entries.size() == 1);
  return availability(entries.front(), root_of(system),
                      [&](const std::filesystem::path&) { return allowed; });
}

}  // namespace

TEST_CASE("An instrument is free, in use, closed to this user, in DFU mode, or somebody else's") {
  MadeUpSystem system;
  MadeUpDevice plugged;
  SECTION("free") {
    system.plug_in(plugged);
    CHECK(of(system) == Availability::kFree);
  }
  SECTION("in use") {
    system.plug_in(plugged);
    system.hold(plugged, 77, "scatter");
    CHECK(of(system) == Availability::kInUse);
    CHECK(holder_words(scan_bus(root_of(system)).front()) == "scatter (77)");
  }
  SECTION("closed") {
    system.plug_in(plugged);
    CHECK(of(system, false) == Availability::kNoPermission);
  }
  SECTION("DFU mode") {
    plugged.product_id = "000e";
    system.plug_in(plugged);
    CHECK(of(system) == Availability::kDfuMode);
  }
  SECTION("not ours") {
    plugged.stream_subclass = "00";
    system.plug_in(plugged);
    CHECK(of(system) == Availability::kNotOurs);
  }
}

TEST_CASE("The system is asked for the node under the given root") {
  MadeUpSystem system;
  system.plug_in({});
  const auto entries = scan_bus(root_of(system));
  REQUIRE(entries.size() == 1);
  CHECK(availability(entries.front(), root_of(system)) == Availability::kFree);
  system.remove("dev/bus/usb/001/007");
  CHECK(availability(entries.front(), root_of(system)) == Availability::kNoPermission);
}

TEST_CASE("Names and releases read as people write them") {
  BusEntry entry;
  entry.port = "2-3";
  CHECK(uri_of(entry) == "usb:port=2-3");
  entry.serial = "SC7";
  CHECK(uri_of(entry) == "usb:serial=SC7");
  CHECK(release_words(0x0123) == "1.2.3");
  CHECK(release_words(0x1234) == "12.3.4");
}
