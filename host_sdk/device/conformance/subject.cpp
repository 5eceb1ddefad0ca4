#include "host_sdk/device/conformance/subject.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace scatter::conformance {

namespace {
constexpr std::uint16_t kSmallSide = 32;
constexpr std::uint32_t kSmallExposureUs = 1000;
}  // namespace

Result<std::unique_ptr<device::Transport>> Subject::carrier() {
  auto transport = options_.open(wait());
  if (transport && nonce_ == 0) {
    // Not the nonce of an earlier program on the same device.
    const std::uint64_t time = (*transport)->system_time_unix_ns() / 1000;
    nonce_ = static_cast<std::uint16_t>(time ^ (time >> 16U) ^ (time >> 32U));
  }
  return transport;
}

std::uint16_t Subject::next_nonce() noexcept {
  if (++nonce_ == 0) {
    nonce_ = 1;
  }
  return nonce_;
}

bool Subject::pause(std::chrono::milliseconds time) const {
  const auto end = std::chrono::steady_clock::now() + time;
  while (std::chrono::steady_clock::now() < end && !options_.stop.stop_requested()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return !options_.stop.stop_requested();
}

Result<device::Device> Subject::device(std::chrono::milliseconds patience) {
  const auto end = std::chrono::steady_clock::now() + patience;
  for (;;) {
    auto transport = carrier();
    Result<device::Device> opened = std::unexpected(transport ? Error{} : transport.error());
    if (transport) {
      device::OpenOptions options;
      options.wait = wait(std::chrono::seconds(20));
      options.host_name = "scatter conform";
      options.nonce = next_nonce();
      opened = device::Device::open(std::move(*transport), options);
    }
    const bool passing =
        !opened &&
        (opened.error().code == ErrorCode::kBusy || opened.error().code == ErrorCode::kUnavailable ||
         opened.error().code == ErrorCode::kDisconnected || opened.error().code == ErrorCode::kNotFound);
    if (!passing || std::chrono::steady_clock::now() >= end || !pause(std::chrono::milliseconds(50))) {
      return opened;
    }
  }
}

Result<protocol::Descriptor> Subject::descriptor() {
  if (!descriptor_) {
    const auto opened = device();
    if (!opened) {
      return std::unexpected(opened.error());
    }
    descriptor_ = opened->descriptor();
  }
  return *descriptor_;
}

protocol::Recipe small_recipe(const protocol::Descriptor& descriptor) {
  const protocol::SensorInfo& sensor = descriptor.sensor;
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(
      std::max(sensor.min_exposure_us, std::min(kSmallExposureUs, sensor.max_exposure_us)));
  recipe.region_width = std::min(kSmallSide, sensor.width_px);
  recipe.region_height = std::min(kSmallSide, sensor.height_px);
  recipe.region_x = static_cast<std::uint16_t>((sensor.width_px - recipe.region_width) / 2);
  recipe.region_y = static_cast<std::uint16_t>((sensor.height_px - recipe.region_height) / 2);
  return recipe;
}

}  // namespace scatter::conformance
