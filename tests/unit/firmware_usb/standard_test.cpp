// Control requests of USB 2.0 chapter 9 as hosts make them, and as they should not.
#include <catch2/catch.hpp>

#include "tests/unit/firmware_usb/descriptor_walk.h"
#include "tests/unit/firmware_usb/usb_board.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;

namespace {

constexpr std::uint8_t kBulkIn = 0x81;
constexpr std::uint8_t kBulkOut = 0x02;
constexpr std::uint8_t kRescueIn = 0x83;
constexpr std::uint8_t kRescueOut = 0x04;

}  // namespace

// PROVES: SPEC 11.6
TEST_CASE("A device is enumerated by the requests that Linux makes, in its order") {
  UsbBoard board;
  board.settle();
  REQUIRE(board.bus.on_bus);
  board.bus.reset();
  // hub_port_init: the old scheme asks for 64 bytes at address 0, resets, then gives an address.
  const Bytes first = board.get_descriptor(1, 0, 64).data;
  REQUIRE(first.size() == 18);
  CHECK(u8(first, 7) == 64);
  board.bus.reset();
  CHECK_FALSE(board.control(0x00, 5, 19, 0, 0).stalled);
  CHECK(board.bus.address == 19);
  const Bytes device = board.get_descriptor(1, 0, 8).data;
  CHECK(device == part(first, 0, 8));  // Only what was asked for.
  CHECK(board.get_descriptor(1, 0, 18).data == first);
  const Bytes bos = board.get_descriptor(15, 0, 5).data;
  CHECK(board.get_descriptor(15, 0, u16(bos, 2)).data.size() == u16(bos, 2));
  CHECK(board.get_descriptor(6, 0, 10).data.size() == 10);
  const Bytes head = board.get_descriptor(2, 0, 9).data;
  REQUIRE(head.size() == 9);
  CHECK(board.get_descriptor(2, 0, u16(head, 2)).data.size() == u16(head, 2));
  for (const std::uint8_t index : std::array<std::uint8_t, 4>{0, 2, 1, 3}) {
    CHECK_FALSE(board.get_descriptor(3, index, 255, index == 0 ? 0 : 0x0409).stalled);
  }
  CHECK(board.control(0x80, 8, 0, 0, 1).data == bytes({0}));
  CHECK(board.set_configuration(1));
  CHECK(board.control(0x80, 8, 0, 0, 1).data == bytes({1}));
  // usbhid: no repeats, then the reports.
  CHECK_FALSE(board.control(0x21, 10, 0, 1, 0).stalled);
  CHECK_FALSE(board.control(0x81, 6, 0x2200, 1, 256).stalled);
  CHECK(board.bus.misuse == std::vector<std::string>());
}

TEST_CASE("An answer is never longer than the host asked for, and never padded") {
  UsbBoard board;
  board.enumerate();
  const Bytes whole = board.get_descriptor(2, 0, 0xFFFF).data;
  for (std::uint16_t length = 1; length <= whole.size() + 3; ++length) {
    const Bytes got = board.get_descriptor(2, 0, length).data;
    CHECK(got == part(whole, 0, std::min<std::size_t>(length, whole.size())));
  }
  CHECK_FALSE(board.get_descriptor(2, 0, 0).stalled);  // No data stage at all.
  CHECK(board.bus.misuse == std::vector<std::string>());
}

// PROVES: SPEC 11.6
TEST_CASE("Before a configuration is chosen, interfaces and endpoints do not exist") {
  UsbBoard board;
  board.settle();
  board.bus.reset();
  (void)board.control(0x00, 5, 3, 0, 0);
  CHECK(board.control(0x81, 0, 0, 0, 2).stalled);                // GET_STATUS of an interface
  CHECK(board.control(0x82, 0, 0, kRescueIn, 2).stalled);        // and of an endpoint
  CHECK(board.control(0x82, 0, 0, 0, 2).data == bytes({0, 0}));  // but of endpoint 0
  CHECK(board.control(0x81, 10, 0, 0, 1).stalled);               // GET_INTERFACE
  CHECK_FALSE(board.set_interface(0, 0));
  CHECK(board.control(0x02, 3, 0, kRescueIn, 0).stalled);
  CHECK(board.control(0x81, 6, 0x2200, 1, 64).stalled);
  CHECK(board.control(0xA1, 1, 0x0300, 1, 64).stalled);  // GET_REPORT
  CHECK(board.control(0xA1, 3, 0, 2, 6).stalled);        // DFU_GETSTATUS
  CHECK(board.bus.endpoints.empty());
  CHECK_FALSE(board.usb->configured());
}

TEST_CASE("Configuration 0 takes the device back to the address state") {
  UsbBoard board;
  board.enumerate();
  CHECK(board.bus.endpoints.size() == 2);
  CHECK(board.set_configuration(0));
  CHECK(board.bus.endpoints.empty());
  CHECK(board.control(0x80, 8, 0, 0, 1).data == bytes({0}));
  CHECK(board.control(0x81, 0, 0, 0, 2).stalled);
  CHECK_FALSE(board.set_configuration(2));
  CHECK(board.set_configuration(1));
}

TEST_CASE("A configuration that does not exist changes nothing") {
  UsbBoard board;
  board.enumerate();
  CHECK_FALSE(board.set_configuration(2));
  CHECK_FALSE(board.set_configuration(0x0101));
  CHECK(board.control(0x80, 8, 0, 0, 1).data == bytes({1}));
}

// PROVES: SPEC 11.6
TEST_CASE("Requests with a wrong recipient, index, value or length are stalled and change nothing") {
  UsbBoard board;
  board.enumerate();
  struct Request {
    std::uint8_t type, request;
    std::uint16_t value, index, length;
  };
  const auto bad = GENERATE(values<Request>({
      {0x80, 0, 1, 0, 2},                                   // GET_STATUS with a wValue
      {0x80, 0, 0, 1, 2},                                   // of the device, with a wIndex
      {0x83, 0, 0, 0, 2},                                   // of "other"
      {0x81, 0, 0, 3, 2},                                   // of interface 3
      {0x82, 0, 0, 0x81, 2},                                // of an endpoint that the setting does not have
      {0x82, 0, 0, 0x03, 2},                                // of an endpoint that no setting has
      {0x82, 0, 0, 0x183, 2},     {0x00, 1, 1, 0, 0},       // CLEAR_FEATURE remote wakeup: there is none
      {0x00, 3, 1, 0, 0},         {0x00, 3, 2, 0x0100, 0},  // TEST_MODE
      {0x01, 3, 0, 0, 0},                                   // No feature of an interface
      {0x02, 3, 1, kRescueIn, 0},                           // No such feature of an endpoint
      {0x02, 3, 0, 0x81, 0},      {0x02, 3, 0, 0, 0},       // Endpoint 0 is never halted
      {0x00, 5, 9, 0, 0},                                   // SET_ADDRESS in the configured state
      {0x80, 6, 0x0101, 0, 18},                             // Device descriptor 1
      {0x80, 6, 0x0201, 0, 9},                              // Configuration 1
      {0x80, 6, 0x0400, 0, 9},  // Interface and endpoint descriptors are no objects of their own
      {0x80, 6, 0x0500, 0, 9},    {0x80, 6, 0x2100, 1, 9},   // HID: of the interface
      {0x81, 6, 0x2200, 0, 64},                              // Interface 0 is not HID
      {0x81, 6, 0x2300, 1, 64},                              // No physical descriptor
      {0x82, 6, 0x0100, 0, 18},   {0x00, 7, 0x0100, 0, 18},  // SET_DESCRIPTOR
      {0x80, 8, 1, 0, 1},                                    // GET_CONFIGURATION with a wValue
      {0x81, 8, 0, 0, 1},         {0x81, 10, 0, 3, 1},       // GET_INTERFACE 3
      {0x81, 10, 1, 0, 1},        {0x01, 11, 2, 0, 0},       // SET_INTERFACE: no setting 2
      {0x01, 11, 1, 1, 0},                                   // interfaces 1 and 2 have one setting
      {0x01, 11, 1, 2, 0},        {0x01, 11, 0, 3, 0},
      {0x82, 12, 0, 0x83, 2},                          // SYNCH_FRAME is for isochronous endpoints
      {0x80, 2, 0, 0, 2},                              // Reserved
      {0x80, 13, 0, 0, 6},        {0x60, 0, 0, 0, 0},  // Reserved kind
      {0x21, 9, 0x0200, 0, 64},                        // Class request to interface 0
      {0x20, 9, 0x0200, 1, 64},                        // Class request to the device
      {0xC1, 0x4D, 0, 7, 64},                          // Vendor request to an interface
  }));
  CAPTURE(int(bad.type), int(bad.request), bad.value, bad.index);
  CHECK(board.control(bad.type, bad.request, bad.value, bad.index, bad.length, Bytes(bad.length)).stalled);
  CHECK(board.bus.endpoints.size() == 2);
  CHECK(board.control(0x80, 8, 0, 0, 1).data == bytes({1}));
  CHECK(board.control(0x81, 10, 0, 0, 1).data == bytes({0}));
  CHECK(board.bus.misuse == std::vector<std::string>());
}

TEST_CASE("The device is bus-powered and wakes nobody, and its interfaces have no status") {
  UsbBoard board;
  board.enumerate();
  CHECK(board.control(0x80, 0, 0, 0, 2).data == bytes({0, 0}));
  for (const std::uint16_t interface : std::array<std::uint16_t, 3>{0, 1, 2}) {
    CHECK(board.control(0x81, 0, 0, interface, 2).data == bytes({0, 0}));
  }
}

TEST_CASE("A setting of interface 0 opens bulk endpoints of the bus's packet size") {
  const auto speed = GENERATE(UsbSpeed::kHigh, UsbSpeed::kFull);
  UsbBoard board;
  board.bus.its_speed = speed;
  board.enumerate();
  CHECK(board.bus.endpoints.count(kBulkIn) == 0);
  CHECK(board.set_interface(0, 1));
  CHECK(board.control(0x81, 10, 0, 0, 1).data == bytes({1}));
  REQUIRE(board.bus.endpoints.count(kBulkIn) == 1);
  REQUIRE(board.bus.endpoints.count(kBulkOut) == 1);
  const std::uint16_t packet = speed == UsbSpeed::kHigh ? 512 : 64;
  CHECK(board.bus.endpoints.at(kBulkIn).what.packet_bytes == packet);
  CHECK(board.bus.endpoints.at(kBulkOut).what.packet_bytes == packet);
  CHECK(board.bus.endpoints.at(kRescueIn).what.type == UsbEndpoint::Type::kInterrupt);
  CHECK(board.set_interface(0, 0));
  CHECK(board.bus.endpoints.count(kBulkIn) == 0);
  CHECK(board.control(0x81, 10, 0, 0, 1).data == bytes({0}));
}

// PROVES: SPEC 11.2
TEST_CASE("Choosing a setting leaves the endpoints of other interfaces as they are") {
  UsbBoard board;
  board.enumerate();
  const std::uint32_t rescue = board.bus.toggle_resets[kRescueIn];
  CHECK(board.set_interface(0, 1));
  const std::uint32_t bulk = board.bus.toggle_resets[kBulkIn];
  CHECK(board.set_interface(0, 1));  // Again: its own toggles begin anew (9.1.1.5).
  CHECK(board.bus.toggle_resets[kBulkIn] == bulk + 1);
  CHECK(board.bus.toggle_resets[kRescueIn] == rescue);
  CHECK(board.set_interface(1, 0));
  CHECK(board.bus.toggle_resets[kRescueIn] == rescue + 1);
  CHECK(board.bus.toggle_resets[kBulkIn] == bulk + 1);
}

TEST_CASE("A halted endpoint says so, and a cleared one begins with a new toggle") {
  const std::uint8_t endpoint = GENERATE(kBulkIn, kBulkOut, kRescueIn, kRescueOut);
  UsbBoard board;
  board.enumerate();
  REQUIRE(board.set_interface(0, 1));
  CHECK(board.control(0x82, 0, 0, endpoint, 2).data == bytes({0, 0}));
  CHECK_FALSE(board.control(0x02, 3, 0, endpoint, 0).stalled);
  CHECK(board.control(0x82, 0, 0, endpoint, 2).data == bytes({1, 0}));
  const std::uint32_t before = board.bus.toggle_resets[endpoint];
  CHECK_FALSE(board.control(0x02, 1, 0, endpoint, 0).stalled);
  CHECK(board.control(0x82, 0, 0, endpoint, 2).data == bytes({0, 0}));
  CHECK(board.bus.toggle_resets[endpoint] == before + 1);
  // 9.4.5: also when it was not halted.
  CHECK_FALSE(board.control(0x02, 1, 0, endpoint, 0).stalled);
  CHECK(board.bus.toggle_resets[endpoint] == before + 2);
}

TEST_CASE("Choosing the setting or the configuration anew ends a halt") {
  UsbBoard board;
  board.enumerate();
  REQUIRE(board.set_interface(0, 1));
  (void)board.control(0x02, 3, 0, kBulkIn, 0);
  (void)board.control(0x02, 3, 0, kRescueIn, 0);
  CHECK(board.set_interface(0, 1));
  CHECK(board.control(0x82, 0, 0, kBulkIn, 2).data == bytes({0, 0}));
  CHECK(board.control(0x82, 0, 0, kRescueIn, 2).data == bytes({1, 0}));
  CHECK(board.set_configuration(1));
  CHECK(board.control(0x82, 0, 0, kRescueIn, 2).data == bytes({0, 0}));
  CHECK(board.bus.endpoints.count(kBulkIn) == 0);  // Setting 0 again.
}

// PROVES: SPEC 11.2
TEST_CASE("A bus reset and an unplugged cable make the device as new") {
  const bool unplugged = GENERATE(false, true);
  UsbBoard board;
  board.enumerate();
  REQUIRE(board.set_interface(0, 1));
  if (unplugged) {
    board.bus.happen({.kind = UsbEvent::Kind::kUnplugged});
    board.settle();
    CHECK(board.bus.endpoints.empty());
  }
  board.bus.reset();
  board.settle();
  CHECK_FALSE(board.usb->configured());
  CHECK(board.bus.endpoints.empty());
  board.enumerate();
  CHECK(board.control(0x81, 10, 0, 0, 1).data == bytes({0}));
}

TEST_CASE("A new SETUP ends the control transfer before it") {
  UsbBoard board;
  board.enumerate();
  board.bus.setup({0x21, 9, 0x00, 0x02, 1, 0, 64, 0});  // SET_REPORT, whose data never comes
  board.settle();
  CHECK(board.bus.wanted == 64);
  CHECK(board.get_descriptor(1, 0, 18).data.size() == 18);
  CHECK(board.bus.misuse == std::vector<std::string>());
}

TEST_CASE("Suspend and resume change nothing") {
  UsbBoard board;
  board.enumerate();
  REQUIRE(board.set_interface(0, 1));
  board.bus.happen({.kind = UsbEvent::Kind::kSuspended});
  board.bus.happen({.kind = UsbEvent::Kind::kResumed});
  board.settle();
  CHECK(board.usb->configured());
  CHECK(board.link->connected());
}
