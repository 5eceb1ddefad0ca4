// The descriptors against the rules of their specifications: USB 2.0 chapter 9, HID 1.11, DFU 1.1, Microsoft
// OS 2.0.
#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "tests/unit/firmware_usb/descriptor_walk.h"
#include "tests/unit/firmware_usb/usb_board.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;

namespace {

constexpr std::uint16_t kAll = 0xFFFF;

/// What a HID report descriptor says, HID 1.11 section 6.2.2: short items only.
struct HidReports {
  std::uint32_t usage_page = 0;
  std::uint32_t collection_usage = 0;
  std::map<unsigned, std::uint32_t> bits;  ///< By main item: 8 input, 9 output, 11 feature.
  bool report_ids = false;
  int depth = 0;
};
HidReports walk_reports(const Bytes& all) {
  HidReports found;
  std::uint32_t size = 0;
  std::uint32_t count = 0;
  std::uint32_t usage = 0;
  for (std::size_t at = 0; at < all.size();) {
    const unsigned head = u8(all, at);
    REQUIRE(head != 0xFE);  // No long items.
    const std::size_t bytes = (head & 3U) == 3 ? 4 : head & 3U;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i) {
      value |= static_cast<std::uint32_t>(u8(all, at + 1 + i)) << 8 * i;
    }
    at += 1 + bytes;
    const unsigned type = head >> 2U & 3U;
    const unsigned tag = head >> 4U;
    if (type == 1) {  // Global
      found.usage_page = tag == 0 ? value : found.usage_page;
      size = tag == 7 ? value : size;
      count = tag == 9 ? value : count;
      found.report_ids = found.report_ids || tag == 8;
    } else if (type == 2) {  // Local
      usage = tag == 0 ? value : usage;
    } else if (type == 0) {  // Main
      if (tag == 10) {
        CHECK(value == 1);  // Application
        found.collection_usage = usage;
        ++found.depth;
      } else if (tag == 12) {
        --found.depth;
      } else {
        CHECK(usage != 0);
        CHECK((value & 1U) == 0);  // Data, not constant.
        found.bits[tag] += size * count;
      }
      usage = 0;
    }
  }
  return found;
}

/// Microsoft OS 2.0 Descriptors Specification, tables 10 to 15: who gets which driver. -1: the whole device.
struct MicrosoftFunction {
  std::string compatible_id;
  std::u16string property;
  std::u16string value;
};
std::map<int, MicrosoftFunction> walk_microsoft(const Bytes& set) {
  std::map<int, MicrosoftFunction> found;
  REQUIRE(u16(set, 0) == 10);
  CHECK(u16(set, 2) == 0);  // MS_OS_20_SET_HEADER_DESCRIPTOR
  CHECK(u32(set, 4) == 0x0603'0000);
  CHECK(u16(set, 8) == set.size());
  int function = -1;
  std::size_t configuration_end = set.size();
  std::size_t function_end = set.size();
  for (std::size_t at = 10; at < set.size();) {
    const std::size_t size = u16(set, at);
    const unsigned type = u16(set, at + 2);
    REQUIRE(size >= 8);
    const Bytes one = part(set, at, size);
    if (type == 1) {  // Subset of a configuration
      CHECK(size == 8);
      CHECK(u8(one, 4) == 0);
      configuration_end = at + u16(one, 6);
      CHECK(configuration_end == set.size());
    } else if (type == 2) {  // Subset of a function
      CHECK(size == 8);
      CHECK(function_end == (function < 0 ? set.size() : at));
      function = u8(one, 4);
      function_end = at + u16(one, 6);
      CHECK(function_end <= configuration_end);
      CHECK(found.count(function) == 0);
    } else if (type == 3) {  // Compatible ID
      REQUIRE(size == 20);
      for (std::size_t i = 4; i < 12 && u8(one, i) != 0; ++i) {
        found[function].compatible_id.push_back(static_cast<char>(u8(one, i)));
      }
      CHECK(part(one, 12, 8) == Bytes(8));  // No sub-compatible ID.
    } else {
      REQUIRE(type == 4);       // Registry property
      CHECK(u16(one, 4) == 7);  // REG_MULTI_SZ
      const std::size_t name = u16(one, 6);
      const std::size_t data = u16(one, 8 + name);
      CHECK(size == 10 + name + data);
      for (std::size_t i = 0; i < name; i += 2) {
        found[function].property.push_back(static_cast<char16_t>(u16(one, 8 + i)));
      }
      for (std::size_t i = 0; i < data; i += 2) {
        found[function].value.push_back(static_cast<char16_t>(u16(one, 10 + name + i)));
      }
    }
    at += size;
    CHECK(at <= function_end);
  }
  if (function >= 0) {
    CHECK(function_end == set.size());
  }
  return found;
}

Bytes configuration(UsbBoard& board, std::uint8_t type = 2) {
  const ControlResult head = board.get_descriptor(type, 0, 9);
  REQUIRE_FALSE(head.stalled);
  return board.get_descriptor(type, 0, u16(head.data, 2)).data;
}

}  // namespace

// PROVES: SPEC 11.1
TEST_CASE("The device descriptor is that of table 9-8, with the numbers of SPEC 11") {
  UsbBoard board;
  board.enumerate();
  CHECK(board.get_descriptor(1, 0, 18).data ==
        bytes({18, 1, 0x10, 0x02, 0, 0, 0, 64, 0x09, 0x12, 0x0D, 0x00, 0x02, 0x01, 1, 2, 3, 1}));
}

TEST_CASE("A device without a serial number says so in its device descriptor") {
  UsbBoard board(false, {.manufacturer = "", .product = "X", .serial = ""});
  board.enumerate();
  const Bytes device = board.get_descriptor(1, 0, 18).data;
  CHECK(u8(device, 14) == 0);
  CHECK(u8(device, 15) == 2);
  CHECK(u8(device, 16) == 0);
  CHECK(board.get_descriptor(3, 1, 255, 0x0409).stalled);
  CHECK(board.get_descriptor(3, 3, 255, 0x0409).stalled);
}

// PROVES: SPEC 11.1
TEST_CASE("The run-time configuration has bulk, HID and DFU interfaces as USB 2.0 has them") {
  const auto speed = GENERATE(UsbSpeed::kHigh, UsbSpeed::kFull);
  const std::uint16_t bulk = speed == UsbSpeed::kHigh ? 512 : 64;  // 5.8.3
  UsbBoard board;
  board.bus.its_speed = speed;
  board.enumerate();
  const WalkedConfiguration found = walk_configuration(configuration(board));
  REQUIRE(found.settings.size() == 4);

  const auto class_of = [&](std::size_t i) {
    const Bytes& b = found.settings[i].interface;
    return std::array{u8(b, 2), u8(b, 3), u8(b, 5), u8(b, 6), u8(b, 7)};
  };
  CHECK(class_of(0) == std::array<std::uint8_t, 5>{0, 0, 0xFF, 5, 1});
  CHECK(class_of(1) == std::array<std::uint8_t, 5>{0, 1, 0xFF, 5, 1});
  CHECK(class_of(2) == std::array<std::uint8_t, 5>{1, 0, 3, 0, 0});
  CHECK(class_of(3) == std::array<std::uint8_t, 5>{2, 0, 0xFE, 1, 1});

  CHECK(found.settings[0].endpoints.empty());
  REQUIRE(found.settings[1].endpoints.size() == 2);
  CHECK(u8(found.settings[1].endpoints[0], 2) == 0x81);
  CHECK(u8(found.settings[1].endpoints[1], 2) == 0x02);
  for (const Bytes& endpoint : found.settings[1].endpoints) {
    CHECK(u8(endpoint, 3) == 2);
    CHECK(u16(endpoint, 4) == bulk);
  }
  REQUIRE(found.settings[2].endpoints.size() == 2);
  CHECK(u8(found.settings[2].endpoints[0], 2) == 0x83);
  CHECK(u8(found.settings[2].endpoints[1], 2) == 0x04);
  for (const Bytes& endpoint : found.settings[2].endpoints) {
    CHECK(u8(endpoint, 3) == 3);
    CHECK(u16(endpoint, 4) == 64);  // 5.7.3: the most at full speed.
    // 9.6.6: 2^(bInterval-1) microframes of 125 us at high speed, frames of 1 ms at full speed.
    const unsigned interval = u8(endpoint, 6);
    const unsigned period_us = speed == UsbSpeed::kHigh ? 125U << (interval - 1) : 1000U * interval;
    CHECK(period_us == 1000);
  }
  REQUIRE(found.settings[2].others.size() == 1);
  const Bytes& hid = found.settings[2].others[0];
  CHECK(hid.size() == 9);  // HID 1.11, 6.2.1
  CHECK(u8(hid, 1) == 0x21);
  CHECK(u16(hid, 2) == 0x0111);
  CHECK(u8(hid, 5) == 1);
  CHECK(u8(hid, 6) == 0x22);
  CHECK(u16(hid, 7) == board.control(0x81, 6, 0x2200, 1, kAll).data.size());
  CHECK(board.control(0x81, 6, 0x2100, 1, kAll).data == hid);

  REQUIRE(found.settings[3].others.size() == 1);
  const Bytes& dfu = found.settings[3].others[0];  // DFU 1.1, 4.1.3
  CHECK(dfu == bytes({9, 0x21, 0x0D, 0xE8, 0x03, 0x00, 0x10, 0x10, 0x01}));
}

TEST_CASE("A full-speed host learns what the device would be at high speed, and the reverse") {
  const auto speed = GENERATE(UsbSpeed::kHigh, UsbSpeed::kFull);
  UsbBoard board;
  board.bus.its_speed = speed;
  board.enumerate();
  CHECK(board.get_descriptor(6, 0, kAll).data == bytes({10, 6, 0x10, 0x02, 0, 0, 0, 64, 1, 0}));
  const Bytes now = configuration(board);
  const Bytes other = configuration(board, 7);
  const WalkedConfiguration found = walk_configuration(other, 7);
  CHECK(u16(found.settings[1].endpoints[0], 4) == (speed == UsbSpeed::kHigh ? 64 : 512));

  UsbBoard twin;
  twin.bus.its_speed = speed == UsbSpeed::kHigh ? UsbSpeed::kFull : UsbSpeed::kHigh;
  twin.enumerate();
  Bytes expected = configuration(twin);
  expected[1] = std::byte{7};
  CHECK(other == expected);
  CHECK(now != expected);
}

TEST_CASE("A full-speed controller has no device qualifier") {
  UsbIdentity identity = UsbBoard::default_identity();
  identity.high_speed_capable = false;
  UsbBoard board(false, identity);
  board.bus.its_speed = UsbSpeed::kFull;
  board.enumerate();
  CHECK(board.get_descriptor(6, 0, 10).stalled);
  CHECK(board.get_descriptor(7, 0, 9).stalled);
  CHECK_FALSE(board.get_descriptor(2, 0, 9).stalled);
}

// PROVES: SPEC 11.1
TEST_CASE("The HID reports are 64 bytes each way on a vendor page, without report ids") {
  UsbBoard board;
  board.enumerate();
  const HidReports found = walk_reports(board.control(0x81, 6, 0x2200, 1, kAll).data);
  CHECK(found.usage_page == 0xFF00);
  CHECK(found.collection_usage == 1);
  CHECK(found.depth == 0);
  CHECK_FALSE(found.report_ids);
  CHECK(found.bits.size() == 3);
  CHECK(found.bits.at(8) == 64 * 8);
  CHECK(found.bits.at(9) == 64 * 8);
  CHECK(found.bits.at(11) == 64 * 8);
}

// PROVES: SPEC 11.1
TEST_CASE("The BOS names a Microsoft OS 2.0 set of exactly the length that is sent") {
  const bool rescue = GENERATE(false, true);
  UsbBoard board(rescue);
  board.enumerate();
  const Bytes head = board.get_descriptor(15, 0, 5).data;
  const Bytes bos = board.get_descriptor(15, 0, u16(head, 2)).data;
  const auto parts = split(bos);
  REQUIRE(parts.size() == 3);
  CHECK(u16(parts[0], 2) == bos.size());
  CHECK(u8(parts[0], 4) == 2);                         // bNumDeviceCaps
  CHECK(parts[1] == bytes({7, 0x10, 2, 0, 0, 0, 0}));  // USB 2.0 extension without LPM
  REQUIRE(parts[2].size() == 28);
  CHECK(part(parts[2], 1, 3) == bytes({0x10, 5, 0}));
  // {D8DD60DF-4589-4CC7-9CD2-659D9E648A9F}: the first three groups little endian.
  CHECK(part(parts[2], 4, 16) == bytes({0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C, 0x9C, 0xD2, 0x65,
                                        0x9D, 0x9E, 0x64, 0x8A, 0x9F}));
  CHECK(u32(parts[2], 20) == 0x0603'0000);  // Windows 8.1
  const std::uint8_t code = u8(parts[2], 26);
  CHECK(u8(parts[2], 27) == 0);
  const Bytes set = board.control(0xC0, code, 0, 7, kAll).data;
  CHECK(u16(parts[2], 24) == set.size());
  CHECK(board.control(0xC0, code, 0, 7, 10).data == part(set, 0, 10));
  CHECK(board.control(0xC0, code, 0, 8, kAll).stalled);
  CHECK(board.control(0xC0, static_cast<std::uint8_t>(code + 1), 0, 7, kAll).stalled);
  CHECK(board.control(0x40, code, 0, 7, 0).stalled);
}

// PROVES: SPEC 11.1
TEST_CASE("Windows gives WinUSB to the bulk and the DFU function and finds them by an interface class") {
  UsbBoard board;
  board.enumerate();
  const auto found = walk_microsoft(board.control(0xC0, 0x4D, 0, 7, kAll).data);
  REQUIRE(found.size() == 2);
  REQUIRE(found.count(0) == 1);
  REQUIRE(found.count(2) == 1);
  std::set<std::u16string> classes;
  for (const auto& [interface, function] : found) {
    CHECK(function.compatible_id == "WINUSB");
    CHECK(function.property == std::u16string(u"DeviceInterfaceGUIDs\0", 21));
    // REG_MULTI_SZ: one GUID, its zero, and the zero that ends the list.
    REQUIRE(function.value.size() == 40);
    CHECK(function.value[0] == u'{');
    CHECK(function.value[37] == u'}');
    CHECK(function.value[38] == u'\0');
    CHECK(function.value[39] == u'\0');
    for (const std::size_t dash : {9U, 14U, 19U, 24U}) {
      CHECK(function.value[dash] == u'-');
    }
    classes.insert(function.value);
  }
  CHECK(classes.size() == 2);
}

// PROVES: SPEC 11.1
TEST_CASE("In DFU mode there is one interface, and the set is that of a device that is not composite") {
  UsbBoard board(true);
  board.enumerate();
  CHECK(board.get_descriptor(1, 0, 18).data ==
        bytes({18, 1, 0x10, 0x02, 0, 0, 0, 64, 0x09, 0x12, 0x0E, 0x00, 0x02, 0x01, 1, 2, 3, 1}));
  const WalkedConfiguration found = walk_configuration(configuration(board));
  REQUIRE(found.settings.size() == 1);
  const Bytes& interface = found.settings[0].interface;  // DFU 1.1, 4.2.3
  CHECK(part(interface, 0, 8) == bytes({9, 4, 0, 0, 0, 0xFE, 1, 2}));
  REQUIRE(found.settings[0].others.size() == 1);
  CHECK(found.settings[0].others[0] == bytes({9, 0x21, 0x0D, 0xE8, 0x03, 0x00, 0x10, 0x10, 0x01}));
  const auto functions = walk_microsoft(board.control(0xC0, 0x4D, 0, 7, kAll).data);
  REQUIRE(functions.size() == 1);
  CHECK(functions.at(-1).compatible_id == "WINUSB");
  CHECK(board.control(0x81, 6, 0x2200, 1, kAll).stalled);  // No HID here.
}

// PROVES: SPEC 11.1
TEST_CASE("Strings are UTF-16LE, and every index that a descriptor names exists") {
  UsbBoard board(false,
                 {.manufacturer = "\xC2\xB5m \xF0\x9F\x98\x80", .product = "HS\xFF", .serial = "T0001"});
  board.enumerate();
  CHECK(board.get_descriptor(3, 0, 255).data == bytes({4, 3, 0x09, 0x04}));
  CHECK(board.get_descriptor(3, 3, 255, 0x0409).data ==
        bytes({12, 3, 'T', 0, '0', 0, '0', 0, '0', 0, '1', 0}));
  CHECK(text_of(board.get_descriptor(3, 1, 255, 0x0409).data) == u"\u00B5m \U0001F600");
  CHECK(text_of(board.get_descriptor(3, 2, 255, 0x0409).data) == u"HS\uFFFD");
  CHECK(board.get_descriptor(3, 3, 255, 0x0407).stalled);  // Not in the list of languages.
  CHECK(board.get_descriptor(3, 99, 255, 0x0409).stalled);
  std::set<std::u16string> names;
  for (const WalkedSetting& setting : walk_configuration(configuration(board)).settings) {
    const std::uint8_t index = u8(setting.interface, 8);
    REQUIRE(index != 0);
    names.insert(text_of(board.get_descriptor(3, index, 255, 0x0409).data));
  }
  CHECK(names.size() == 3);
}

TEST_CASE("Bytes that are no UTF-8 become replacement characters, one for each broken sequence") {
  // The Unicode Standard, table 3-7: well-formed byte sequences.
  const auto& [utf8, expected] = GENERATE(table<std::string, std::u16string>({
      {"\xC0\x80", u"\uFFFD\uFFFD"},    // Overlong.
      {"\xE0\x80\x80", u"\uFFFD"},      // Overlong.
      {"\xED\xA0\x80", u"\uFFFD"},      // A surrogate.
      {"\xF4\x90\x80\x80", u"\uFFFD"},  // Above U+10FFFF.
      {"a\xE2\x82", u"a\uFFFD"},        // Cut.
      {"\xE2\x82\xAC", u"\u20AC"},
      {"\x80z", u"\uFFFDz"},
  }));
  UsbBoard board(false, {.manufacturer = "", .product = utf8, .serial = ""});
  board.enumerate();
  CHECK(text_of(board.get_descriptor(3, 2, 255, 0x0409).data) == expected);
}

TEST_CASE("A text too long for a string descriptor is cut between characters") {
  // 126 units fit; the last character here needs the 126th and 127th.
  const std::string text = std::string(125, 'x') + "\xF0\x9F\x98\x80";
  UsbBoard board(false, {.manufacturer = "", .product = text, .serial = ""});
  board.enumerate();
  CHECK(text_of(board.get_descriptor(3, 2, 255, 0x0409).data) == std::u16string(125, u'x'));
}
