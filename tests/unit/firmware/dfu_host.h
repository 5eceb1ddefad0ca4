// A device in the hands of a DFU host: slots on strict flash behind a DfuDevice, and the requests of a host
// that does what dfu-util does. The .scfw comes from the host's own writer, so that firmware and host agree
// on it.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/core/dfu_device.h"
#include "host_sdk/firmware_files/dfu_suffix.h"
#include "host_sdk/firmware_files/signing.h"
#include "protocol/endian.h"
#include "tests/unit/firmware/fake_board.h"
#include "tests/unit/firmware/test_images.h"

namespace scatter::firmware::fake {

using Bytes = std::vector<std::byte>;

struct PackageSpec {
  std::string product = "HS-1 test";
  std::string version = "2.0.0";
  std::uint32_t counter = 1;
  std::array<std::uint32_t, 2> body_bytes{9000, 9001};
  std::uint32_t slot_bytes = 5 * 4096;
  Signer signer = Signer::kTestKey;
};

/// Bodies begin with a vector table and differ in every slot and version.
inline firmware_files::Package make_package(const PackageSpec& spec = {}) {
  firmware_files::Release release;
  release.product = spec.product;
  release.version = spec.version;
  release.security_counter = spec.counter;
  for (std::uint32_t slot = 0; slot < 2; ++slot) {
    auto& linking = release.linkings[slot];
    linking.name = "slot";
    linking.address = kFirstSlotAddress + slot * spec.slot_bytes + protocol::kImageBodyOffset;
    linking.body =
        make_image({.version = spec.version + (slot == 0 ? "a" : "b"), .body_bytes = spec.body_bytes[slot]})
            .body;
    protocol::store_le(linking.body.data(), std::uint32_t{0x2001'0000});
    protocol::store_le(linking.body.data() + 4, linking.address + 9);
  }
  firmware_files::SecretKey::Seed seed{};
  std::ranges::copy(seed_of(spec.signer), seed.begin());
  auto package = sign(release, firmware_files::SecretKey(seed));
  if (!package) {
    std::abort();
  }
  return *package;
}

inline Bytes with_suffix(Bytes file) {
  const auto suffix = firmware_files::dfu_suffix(file);
  file.insert(file.end(), suffix.begin(), suffix.end());
  return file;
}

class DfuHost {
 public:
  static constexpr std::uint16_t kInterface = 3;
  static constexpr std::string_view kProduct = "HS-1 test";
  struct Status {
    DfuStatus status{};
    std::uint32_t poll_ms = 0;
    DfuState state{};
  };

  /// Runs image 1.0.0, confirmed, from `running`.
  explicit DfuHost(std::uint8_t running = 0,
                   Flash::Geometry geometry = {.unit_bytes = 4096, .units = 5, .program_bytes = 32})
      : slots(geometry) {
    if (running < ImageSlots::kCount) {
      slots.install(make_image({.slot = running}), {{MarkKind::kConfirmed, 1}});
    }
    slots.runs = running;
    boot();
  }
  DfuHost(const DfuHost&) = delete;
  DfuHost& operator=(const DfuHost&) = delete;

  /// New RAM.
  void boot() {
    slots.supply.power_on();
    receiver = std::make_unique<UpdateReceiver>(slots, verifier, kProduct);
    device = std::make_unique<DfuDevice>(clock, slots, *receiver, kProduct, kInterface);
  }
  DfuReply ask(std::uint8_t code, std::uint16_t value = 0, std::span<const std::byte> data = {},
               std::optional<std::uint16_t> length = {}) {
    return device->request({.request = code,
                            .value = value,
                            .index = kInterface,
                            .length = length.value_or(static_cast<std::uint16_t>(data.size())),
                            .data = data});
  }
  DfuReply ask(DfuRequestCode code, std::uint16_t value = 0, std::span<const std::byte> data = {},
               std::optional<std::uint16_t> length = {}) {
    return ask(static_cast<std::uint8_t>(code), value, data, length);
  }
  /// Nothing when it was stalled.
  std::optional<Status> status() {
    const DfuReply reply = ask(DfuRequestCode::kGetStatus, 0, {}, 6);
    if (reply.stall || reply.size != 6) {
      return std::nullopt;
    }
    const auto at = [&](std::size_t i) { return std::to_integer<std::uint32_t>(reply.bytes[i]); };
    return Status{.status = static_cast<DfuStatus>(at(0)),
                  .poll_ms = at(1) | at(2) << 8U | at(3) << 16U,
                  .state = static_cast<DfuState>(at(4))};
  }
  /// The main loop turns `turns` times in each millisecond of `ms`.
  void pass(std::uint32_t ms, int turns = 1) {
    for (std::uint32_t i = 0; i < ms; ++i) {
      clock.time_us += 1000;
      for (int k = 0; k < turns; ++k) {
        device->poll();
      }
    }
  }
  /// DETACH, the device leaves the bus, and the resets of an enumeration.
  void enter_dfu_mode() {
    if (device->state() == DfuState::kAppIdle) {
      (void)ask(DfuRequestCode::kDetach, 1000);
      (void)device->bus_reset();
      (void)device->bus_reset();
    }
    if (device->state() == DfuState::kError) {
      (void)ask(DfuRequestCode::kClrStatus);
    }
  }
  /// GETSTATUS until the device is neither busy nor manifesting, waiting as long as it says.
  Status settle() {
    for (int i = 0; i < 100'000; ++i) {
      const auto now = status();
      if (!now) {
        return {.status = device->status(), .state = device->state()};
      }
      if (now->state != DfuState::kDnbusy && now->state != DfuState::kManifest &&
          now->state != DfuState::kDnloadSync && now->state != DfuState::kManifestSync) {
        return *now;
      }
      pass(now->poll_ms);
    }
    return {.status = DfuStatus::kErrUnknown, .state = device->state()};
  }
  /// All blocks of `file` up to `end`; stops at the first that is refused. The last status.
  Status send(std::span<const std::byte> file, std::size_t block, std::uint16_t first_number = 0) {
    Status now{.state = device->state()};
    for (std::size_t at = 0; at < file.size(); at += block) {
      if (ask(DfuRequestCode::kDnload, first_number++, file.subspan(at, std::min(block, file.size() - at)))
              .stall) {
        return *status();
      }
      now = settle();
      if (now.state != DfuState::kDnloadIdle) {
        return now;
      }
    }
    return now;
  }
  /// What `dfu-util -D` does: DFU mode, all blocks, the empty one, manifestation.
  Status download(std::span<const std::byte> file, std::size_t block) {
    enter_dfu_mode();
    const Status sent = send(file, block);
    if (sent.state != DfuState::kDnloadIdle) {
      return sent;
    }
    if (ask(DfuRequestCode::kDnload).stall) {
      return *status();
    }
    return settle();
  }
  Bytes cells(std::uint8_t slot) {
    Bytes bytes(slots.slot_bytes());
    (void)slots.parts[slot].read(0, bytes);
    return bytes;
  }
  /// The slot holds this image of the package, whole and marked ready.
  bool ready_with(const firmware_files::Package& package, std::uint8_t slot) {
    const Bytes all = cells(slot);
    const auto header = firmware_files::header_bytes(package.image(slot).header);
    const Bytes& body = package.image(slot).body;
    return std::ranges::equal(std::span(all).first(header.size()), std::as_bytes(std::span(header))) &&
           std::ranges::equal(std::span(all).subspan(protocol::kImageBodyOffset, body.size()), body) &&
           read_marks(slots.parts[slot]).last == MarkKind::kReady;
  }

  FakeClock clock;
  TestSlots slots;
  RememberingVerifier verifier;
  std::unique_ptr<UpdateReceiver> receiver;
  std::unique_ptr<DfuDevice> device;
};

}  // namespace scatter::firmware::fake
