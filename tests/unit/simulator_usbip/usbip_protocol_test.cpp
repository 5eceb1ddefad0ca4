// PROVES: Linux, Documentation/usb/usbip_protocol.rst, message format tables.
#include "simulator/usbip/usbip_protocol.h"

#include <catch2/catch.hpp>

#include <random>
#include <string>
#include <variant>
#include <vector>

namespace {

using namespace scatter::simulator::usbip;

std::vector<std::byte> bytes_of(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (const int value : values) {
    bytes.push_back(static_cast<std::byte>(value));
  }
  return bytes;
}

void append(std::vector<std::byte>& to, const std::vector<std::byte>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

/// CMD_SUBMIT as the table has it: offsets 0x00 to 0x2F, then the buffer.
std::vector<std::byte> submit_bytes(int endpoint, bool to_host, int length, int flags = 0, int packets = 0) {
  auto bytes = bytes_of({0,
                         0,
                         0,
                         1,
                         0,
                         0,
                         0x0D,
                         0x05,
                         0,
                         1,
                         0,
                         2,
                         0,
                         0,
                         0,
                         to_host ? 1 : 0,
                         0,
                         0,
                         0,
                         endpoint,
                         0,
                         0,
                         0,
                         flags,
                         (length >> 24) & 0xFF,
                         (length >> 16) & 0xFF,
                         (length >> 8) & 0xFF,
                         length & 0xFF,
                         0,
                         0,
                         0,
                         0,
                         0,
                         0,
                         0,
                         packets,
                         0,
                         0,
                         0,
                         0,
                         0x80,
                         6,
                         0,
                         1,
                         0,
                         0,
                         18,
                         0});
  if (!to_host) {
    bytes.resize(bytes.size() + static_cast<std::size_t>(length), std::byte{0x5A});
  }
  return bytes;
}

std::vector<std::byte> import_bytes(const std::string& bus_id) {
  auto bytes = bytes_of({0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0});
  bytes.resize(40);
  for (std::size_t k = 0; k < bus_id.size(); ++k) {
    bytes[8 + k] = static_cast<std::byte>(bus_id[k]);
  }
  return bytes;
}

const std::vector<std::byte> kList = bytes_of({0x01, 0x11, 0x80, 0x05, 0, 0, 0, 0});

TEST_CASE("A request for the list and one for a device are told apart") {
  std::vector<std::byte> stream = kList;
  append(stream, import_bytes("1-1"));
  RequestReader reader;
  std::span<const std::byte> rest(stream);
  CHECK(reader.next(rest) == Request(ListDevices{}));
  CHECK(reader.next(rest) == Request(ImportDevice{"1-1"}));
  CHECK(rest.empty());
  CHECK_FALSE(reader.next(rest).has_value());
  CHECK_FALSE(reader.broken());
}

TEST_CASE("A bus id without an end is taken as 32 characters") {
  const std::string longest(32, '7');
  const auto stream = import_bytes(longest);
  RequestReader reader;
  std::span<const std::byte> rest(stream);
  CHECK(reader.next(rest) == Request(ImportDevice{longest}));
}

TEST_CASE("Every field of a submitted transfer arrives") {
  RequestReader reader;
  reader.start_transfers();
  const auto stream = submit_bytes(2, false, 3, 0x41);
  std::span<const std::byte> rest(stream);
  const auto request = reader.next(rest);
  REQUIRE(request.has_value());
  const auto& urb = std::get<SubmitUrb>(*request);
  CHECK(urb.sequence == 0x0D05);
  CHECK(urb.device == 0x10002);
  CHECK(urb.endpoint == 2);
  CHECK(urb.short_not_ok);
  CHECK(urb.length == 3);
  CHECK(urb.setup == std::array<std::uint8_t, 8>{0x80, 6, 0, 1, 0, 0, 18, 0});
  CHECK(urb.data == bytes_of({0x5A, 0x5A, 0x5A}));
}

TEST_CASE("A transfer to the host brings no data with it") {
  RequestReader reader;
  reader.start_transfers();
  auto stream = submit_bytes(1, true, 4096);
  append(stream, submit_bytes(3, true, 64));
  std::span<const std::byte> rest(stream);
  const auto first = reader.next(rest);
  REQUIRE(first.has_value());
  CHECK(std::get<SubmitUrb>(*first).endpoint == 0x81);
  CHECK(std::get<SubmitUrb>(*first).length == 4096);
  CHECK(std::get<SubmitUrb>(*first).data.empty());
  CHECK_FALSE(std::get<SubmitUrb>(*first).short_not_ok);
  const auto second = reader.next(rest);
  REQUIRE(second.has_value());
  CHECK(std::get<SubmitUrb>(*second).endpoint == 0x83);
}

TEST_CASE("A request to unlink names itself and its victim") {
  RequestReader reader;
  reader.start_transfers();
  auto stream = bytes_of({0, 0, 0, 2, 0, 0, 0, 9, 0, 1, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7});
  stream.resize(48);
  std::span<const std::byte> rest(stream);
  CHECK(reader.next(rest) == Request(UnlinkUrb{.sequence = 9, .device = 0x10002, .victim = 7}));
}

TEST_CASE("The same bytes give the same requests however they are cut") {
  std::vector<std::byte> stream;
  append(stream, submit_bytes(2, false, 1000));
  append(stream, submit_bytes(1, true, 512));
  append(stream, submit_bytes(0, false, 0));
  append(stream, submit_bytes(4, false, 64));
  const auto read_all = [&](auto next_size) {
    RequestReader reader;
    reader.start_transfers();
    std::vector<Request> requests;
    std::span<const std::byte> left(stream);
    while (!left.empty()) {
      const std::size_t size = std::min<std::size_t>(left.size(), next_size());
      auto piece = left.first(size);
      left = left.subspan(size);
      while (auto request = reader.next(piece)) {
        requests.push_back(std::move(*request));
      }
      CHECK(piece.empty());
    }
    CHECK_FALSE(reader.broken());
    return requests;
  };
  const auto whole = read_all([&] { return stream.size(); });
  REQUIRE(whole.size() == 4);
  CHECK(read_all([] { return std::size_t{1}; }) == whole);
  std::mt19937 random(7);
  CHECK(read_all([&] { return std::size_t{1} + random() % 97; }) == whole);
}

TEST_CASE("What is not USB/IP 1.1.1 breaks the reader, with the reason") {
  const auto problem_of = [](const std::vector<std::byte>& stream, bool transfers) {
    RequestReader reader;
    if (transfers) {
      reader.start_transfers();
    }
    std::span<const std::byte> rest(stream);
    CHECK_FALSE(reader.next(rest).has_value());
    CHECK(reader.broken());
    CHECK_FALSE(reader.next(rest).has_value());  // And stays so.
    return reader.problem();
  };
  using Catch::Matchers::Contains;
  CHECK_THAT(problem_of(bytes_of({0x01, 0x06, 0x80, 0x05, 0, 0, 0, 0}), false), Contains("0x0106"));
  CHECK_THAT(problem_of(bytes_of({0x01, 0x11, 0x80, 0x07, 0, 0, 0, 0}), false), Contains("0x8007"));
  CHECK_THAT(problem_of(submit_bytes(16, true, 1), true), Contains("endpoint 16"));
  CHECK_THAT(problem_of(submit_bytes(1, true, 1, 0, 1), true), Contains("1 isochronous"));
  CHECK_THAT(problem_of(submit_bytes(1, true, static_cast<int>(kMostTransferBytes + 1)), true),
             Contains("16777217"));
  CHECK_THAT(problem_of(submit_bytes(1, true, -1), true), Contains("4294967295"));
  auto unknown = submit_bytes(1, true, 1);
  unknown[3] = std::byte{3};
  CHECK_THAT(problem_of(unknown, true), Contains("command 3"));
}

const auto kDeviceDescriptor =
    bytes_of({18, 1, 0x10, 0x02, 0xEF, 2, 1, 64, 0x09, 0x12, 0x0D, 0x00, 0x34, 0x12, 1, 2, 3, 1});
// Configuration with interface 0 (alternate settings 0 and 1, an endpoint) and interface 1.
const auto kConfigurationDescriptor =
    bytes_of({9, 2,    43, 0, 2, 1, 0, 0x80, 50, 9, 4, 0, 0, 0, 0xFF, 5, 1, 0, 9, 4, 0, 1,
              1, 0xFF, 5,  1, 0, 7, 5, 0x81, 2,  0, 2, 0, 9, 4, 1,    0, 0, 3, 0, 0, 0});

TEST_CASE("A device's record says what its descriptors say, alternate settings counted once") {
  const auto record = read_descriptors(kDeviceDescriptor, kConfigurationDescriptor);
  REQUIRE(record.has_value());
  CHECK(record->vendor == 0x1209);
  CHECK(record->product == 0x000D);
  CHECK(record->release_bcd == 0x1234);
  CHECK(record->device.device_class == 0xEF);
  CHECK(record->configurations == 1);
  REQUIRE(record->interfaces.size() == 2);
  CHECK(record->interfaces[0].sub_class == 5);
  CHECK(record->interfaces[1].device_class == 3);
}

TEST_CASE("Descriptors that are cut short or contradict themselves give no record") {
  for (std::size_t size = 0; size < kConfigurationDescriptor.size(); ++size) {
    CHECK_FALSE(
        read_descriptors(kDeviceDescriptor, std::span(kConfigurationDescriptor).first(size)).has_value());
  }
  CHECK_FALSE(read_descriptors(std::span(kDeviceDescriptor).first(17), kConfigurationDescriptor).has_value());
  auto endless = kConfigurationDescriptor;
  endless[9] = std::byte{0};
  CHECK_FALSE(read_descriptors(kDeviceDescriptor, endless).has_value());
}

DeviceRecord example() {
  auto record = *read_descriptors(kDeviceDescriptor, kConfigurationDescriptor);
  record.bus_id = "1-1";
  record.bus_number = 1;
  record.device_number = 2;
  record.speed = Speed::kHigh;
  return record;
}

TEST_CASE("The list of devices has the layout that the usbip program reads") {
  const auto record = example();
  const auto list = device_list(&record);
  REQUIRE(list.size() == 12 + 312 + 2 * 4);
  const auto at = [&](std::size_t offset, std::initializer_list<int> expected) {
    const auto wanted = bytes_of(expected);
    return std::equal(wanted.begin(), wanted.end(), list.begin() + static_cast<std::ptrdiff_t>(offset));
  };
  CHECK(at(0, {0x01, 0x11, 0x00, 0x05, 0, 0, 0, 0}));
  CHECK(at(0x08, {0, 0, 0, 1}));         // Number of exported devices.
  CHECK(at(0x10C, {'1', '-', '1', 0}));  // busid
  CHECK(at(0x12C, {0, 0, 0, 1}));        // busnum
  CHECK(at(0x130, {0, 0, 0, 2}));        // devnum
  CHECK(at(0x134, {0, 0, 0, 3}));        // speed
  CHECK(at(0x138, {0x12, 0x09}));        // idVendor
  CHECK(at(0x13A, {0x00, 0x0D}));        // idProduct
  CHECK(at(0x13C, {0x12, 0x34}));        // bcdDevice
  CHECK(
      at(0x13E, {0xEF, 2, 1, 0, 1, 2}));  // Classes, bConfigurationValue, bNumConfigurations, bNumInterfaces
  CHECK(at(0x144, {0xFF, 5, 1, 0}));      // First interface.
  CHECK(at(0x148, {3, 0, 0, 0}));
  CHECK(device_list(nullptr) == bytes_of({0x01, 0x11, 0x00, 0x05, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST_CASE("A granted import carries the device, a refused one its status alone") {
  const auto record = example();
  const auto granted = import_reply(OpStatus::kOk, &record);
  CHECK(granted.size() == 8 + 312);
  CHECK(std::vector(granted.begin(), granted.begin() + 8) == bytes_of({0x01, 0x11, 0x00, 0x03, 0, 0, 0, 0}));
  CHECK(import_reply(OpStatus::kBusy, &record) == bytes_of({0x01, 0x11, 0x00, 0x03, 0, 0, 0, 2}));
}

TEST_CASE("Replies to transfers have the layout of RET_SUBMIT and RET_UNLINK") {
  auto submit = bytes_of(
      {0, 0, 0, 3, 0, 0, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xE0, 0, 1, 0, 0});
  submit.resize(48);
  const auto made = submit_reply(0x102, UrbStatus::kStalled, 0x10000);
  CHECK(std::vector(made.begin(), made.end()) == submit);
  auto unlink =
      bytes_of({0, 0, 0, 4, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0x98});
  unlink.resize(48);
  const auto made_unlink = unlink_reply(5, UrbStatus::kUnlinked);
  CHECK(std::vector(made_unlink.begin(), made_unlink.end()) == unlink);
}

}  // namespace
