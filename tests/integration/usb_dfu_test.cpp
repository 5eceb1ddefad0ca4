// Firmware over USB DFU 1.1, as dfu-util does it: detach, download, manifest, reset, restart into the new
// image.
#include <algorithm>

#include "firmware/core/dfu_device.h"
#include "host_sdk/firmware_files/dfu_suffix.h"
#include "host_sdk/firmware_files/signing.h"
#include "protocol/usb_identity.h"
#include "simulator/instrument/virtual_board.h"
#include "tests/integration/rig.h"
#include "tests/integration/usb_rig.h"
#include "tests/unit/firmware_files/made_release.h"

using namespace scatter;
using namespace scatter::integration;
using firmware::DfuRequestCode;
using firmware::DfuState;
using firmware::DfuStatus;
using usb_test::Bytes;
using usb_test::PortHost;

namespace usb = protocol::usb;

namespace {

constexpr std::uint8_t kClassToInterface = 0x21;
constexpr std::uint8_t kClassFromInterface = 0xA1;

std::uint16_t product_id(const PortHost& host) {
  const Bytes& bytes = host.device_descriptor();
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[10]) |
                                    std::to_integer<unsigned>(bytes[11]) << 8U);
}

firmware_files::Package release(const std::string& version) {
  auto what = firmware_files::test::made_release(version, 1, 50'000);
  what.product = "OpenScatter HS-1 (simulated)";
  const auto key = firmware_files::load_secret_key("firmware/keys/test.key");
  REQUIRE(key);
  auto package = firmware_files::sign(what, *key);
  REQUIRE(package);
  return *package;
}

class DfuHost {
 public:
  explicit DfuHost(PortHost& host) : host_(host) {}

  struct Status {
    DfuStatus status{};
    std::uint32_t poll_ms = 0;
    DfuState state{};
  };
  Status status() {
    const Bytes bytes = host_.control_in(
        {.type = kClassFromInterface, .request = code(DfuRequestCode::kGetStatus), .index = interface}, 6);
    REQUIRE(bytes.size() == 6);
    const auto at = [&](std::size_t i) { return std::to_integer<std::uint32_t>(bytes[i]); };
    return {.status = static_cast<DfuStatus>(at(0)),
            .poll_ms = at(1) | at(2) << 8U | at(3) << 16U,
            .state = static_cast<DfuState>(at(4))};
  }
  bool ask(DfuRequestCode request, std::uint16_t value = 0, Bytes data = {}) {
    return host_.control_out(
        {.type = kClassToInterface, .request = code(request), .value = value, .index = interface},
        std::move(data));
  }
  /// GETSTATUS until nothing is being stored, waiting as long as the device says.
  Status settle() {
    Status now = status();
    while (now.state == DfuState::kDnbusy || now.state == DfuState::kManifest) {
      host_.run_for(std::uint64_t{now.poll_ms} * 1000);
      now = status();
    }
    return now;
  }
  /// Every block and the empty one; the last status.
  Status download(const Bytes& file) {
    std::uint16_t block = 0;
    for (std::size_t at = 0; at < file.size(); at += firmware::kDfuTransferBytes) {
      const auto size = std::min<std::size_t>(firmware::kDfuTransferBytes, file.size() - at);
      const auto from = file.begin() + static_cast<std::ptrdiff_t>(at);
      if (!ask(DfuRequestCode::kDnload, block++, {from, from + static_cast<std::ptrdiff_t>(size)})) {
        return status();
      }
      const Status now = settle();
      if (now.state != DfuState::kDnloadIdle) {
        return now;
      }
    }
    if (!ask(DfuRequestCode::kDnload, block)) {
      return status();
    }
    return settle();
  }
  std::uint16_t interface = usb::kDfuModeInterface;

 private:
  static std::uint8_t code(DfuRequestCode request) { return static_cast<std::uint8_t>(request); }
  PortHost& host_;
};

/// From run time to DFU mode.
void detach(PortHost& host, DfuHost& dfu) {
  REQUIRE((host.plug() && host.enumerate()));
  REQUIRE(product_id(host) == usb::kProductId);
  const std::uint32_t joins = host.port().joins();
  dfu.interface = usb::kDfuInterface;
  REQUIRE(dfu.ask(DfuRequestCode::kDetach, 1000));
  host.run_for(500'000);
  REQUIRE(host.port().joins() == joins + 1);
  REQUIRE((host.plug() && host.enumerate()));
  REQUIRE(product_id(host) == usb::kDfuProductId);
  dfu.interface = usb::kDfuModeInterface;
}

}  // namespace

TEST_CASE("A firmware file over DFU: the device comes back with the new image") {
  const auto instrument = usb_instrument_of("");
  PortHost host(instrument);
  DfuHost dfu(host);
  detach(host, dfu);
  CHECK(dfu.status().state == DfuState::kIdle);
  const firmware_files::Package package = release("2.0.0");
  const auto done = dfu.download(package.bytes());
  CHECK(done.status == DfuStatus::kOk);
  REQUIRE(done.state == DfuState::kIdle);
  const std::uint32_t joins = host.port().joins();
  host.port().reset();
  host.run_for(1'000'000);
  CHECK(host.port().joins() == joins + 1);
  auto device = open_usb(instrument);
  REQUIRE(device.has_value());
  CHECK(device->hello().build_id.str() == "openscatter 2.0.0");
  CHECK(device->hello().reset_reason == static_cast<std::uint8_t>(protocol::ResetReason::kRequested));
  CHECK(run(*device, pattern_recipe(3)).complete == 3);
  CHECK(instrument->board().flash().violations() == 0);
}

TEST_CASE("The release in bcdDevice is that of the image that runs") {
  const auto instrument = usb_instrument_of("");
  PortHost host(instrument);
  DfuHost dfu(host);
  const auto release_of = [&] {
    return std::to_integer<unsigned>(host.device_descriptor()[12]) |
           std::to_integer<unsigned>(host.device_descriptor()[13]) << 8U;
  };
  REQUIRE((host.plug() && host.enumerate()));
  CHECK(release_of() == 0x0010);  // 0.1.0
  detach(host, dfu);
  REQUIRE(dfu.download(release("12.3.4").bytes()).state == DfuState::kIdle);
  host.port().reset();
  host.run_for(1'000'000);
  REQUIRE((host.plug() && host.enumerate()));
  CHECK(release_of() == 0x1234);
}

TEST_CASE("A file of another key is refused over DFU, and the old image goes on") {
  const auto instrument = usb_instrument_of("");
  PortHost host(instrument);
  DfuHost dfu(host);
  detach(host, dfu);
  auto what = firmware_files::test::made_release("2.0.0", 1, 50'000);
  what.product = "OpenScatter HS-1 (simulated)";
  const auto refused = dfu.download(firmware_files::test::made_package(what).bytes());
  CHECK(refused.state == DfuState::kError);
  CHECK(refused.status == DfuStatus::kErrFile);
  host.port().reset();
  auto device = open_usb(instrument);
  REQUIRE(device.has_value());
  CHECK(device->hello().build_id.str() == "openscatter 0.1.0");
}

TEST_CASE("Without an image that can start, the bootloader is on the bus in DFU mode and takes one") {
  const auto instrument = usb_instrument_of("");
  for (std::uint8_t slot = 0; slot < firmware::ImageSlots::kCount; ++slot) {
    firmware::Flash& flash = instrument->board().flash().slot(slot);
    for (std::uint32_t unit = 0; unit < flash.geometry().units; ++unit) {
      REQUIRE(flash.erase(unit));
    }
  }
  {
    auto device = open_usb(instrument);
    REQUIRE(device.has_value());
    REQUIRE(device->reboot().has_value());
    while (device->status()) {
    }
  }
  PortHost host(instrument);
  DfuHost dfu(host);
  REQUIRE((host.plug() && host.enumerate()));
  CHECK(product_id(host) == usb::kDfuProductId);
  CHECK(dfu.status().status == DfuStatus::kErrFirmware);
  // No watchdog ends it.
  host.run_for(20'000'000);
  REQUIRE(dfu.ask(DfuRequestCode::kClrStatus));
  REQUIRE(dfu.download(release("3.0.0").bytes()).state == DfuState::kIdle);
  host.port().reset();
  host.run_for(1'000'000);
  auto device = open_usb(instrument);
  REQUIRE(device.has_value());
  CHECK(device->hello().build_id.str() == "openscatter 3.0.0");
}
