#include <catch2/catch.hpp>
#include <random>

#include "firmware/core/usb/usb_descriptors.h"
#include "host_sdk/device/usb/usb_shape.h"
#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

using firmware::UsbMode;
namespace told = firmware::usb_descriptors;

/// What the kernel gives of our own device: device descriptor and configuration.
std::vector<std::byte> of_firmware(UsbMode mode, firmware::UsbSpeed speed) {
  told::Buffer buffer{};
  const auto device = told::device(buffer, mode, {});
  std::vector<std::byte> out(device.begin(), device.end());
  const auto configuration = told::configuration(mode, speed, told::Type::kConfiguration);
  out.insert(out.end(), configuration.begin(), configuration.end());
  return out;
}

TEST_CASE("The firmware's own descriptors are those of an instrument, in both modes and at both speeds") {
  for (const auto speed : {firmware::UsbSpeed::kFull, firmware::UsbSpeed::kHigh}) {
    const auto running = read_shape(of_firmware(UsbMode::kRunTime, speed));
    REQUIRE(running);
    CHECK(running->vendor_id == protocol::usb::kVendorId);
    CHECK(running->product_id == protocol::usb::kProductId);
    CHECK(running->streams());
    CHECK(running->has_hid());
    CHECK_FALSE(running->dfu_mode());
    const auto waiting = read_shape(of_firmware(UsbMode::kDfu, speed));
    REQUIRE(waiting);
    CHECK(waiting->product_id == protocol::usb::kDfuProductId);
    CHECK(waiting->dfu_mode());
    CHECK_FALSE(waiting->streams());
  }
}

TEST_CASE("Descriptors that are cut anywhere are not taken for whole") {
  const std::vector<std::byte> whole = of_firmware(UsbMode::kRunTime, firmware::UsbSpeed::kHigh);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    CHECK_FALSE(read_shape(std::span(whole).first(size)));
  }
}

TEST_CASE("Any bytes read as nothing or as interfaces that lie in them") {
  std::mt19937 random(1);
  const std::vector<std::byte> whole = of_firmware(UsbMode::kRunTime, firmware::UsbSpeed::kHigh);
  for (int turn = 0; turn < 20000; ++turn) {
    std::vector<std::byte> bytes = whole;
    for (int change = 0; change < 1 + turn % 4; ++change) {
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    }
    if (const auto shape = read_shape(bytes)) {
      std::size_t least = 18 + 9;
      for (const UsbInterfaceShape& one : shape->interfaces) {
        least += 9 + 7 * one.endpoints.size();
      }
      CHECK(least <= bytes.size());
    }
  }
}

TEST_CASE("An interface of another class, or without its endpoints, is a stranger's") {
  const std::vector<std::byte> whole = of_firmware(UsbMode::kRunTime, firmware::UsbSpeed::kHigh);
  std::vector<std::byte> other = whole;
  for (std::size_t at = 18 + 9; at + 8 < other.size(); at += static_cast<std::size_t>(other[at])) {
    if (other[at + 1] == std::byte{4} && other[at + 5] == std::byte{protocol::usb::kStreamClass}) {
      other[at + 6] = std::byte{protocol::usb::kStreamSubClass + 1};
    }
  }
  CHECK_FALSE(read_shape(other)->streams());
  std::vector<std::byte> deaf = whole;
  for (std::size_t at = 18 + 9; at + 6 < deaf.size(); at += static_cast<std::size_t>(deaf[at])) {
    if (deaf[at + 1] == std::byte{5} && deaf[at + 2] == std::byte{protocol::usb::kBulkOut}) {
      deaf[at + 2] = std::byte{protocol::usb::kBulkOut + 1};
    }
  }
  CHECK_FALSE(read_shape(deaf)->streams());
}

}  // namespace
}  // namespace scatter::device::usb
