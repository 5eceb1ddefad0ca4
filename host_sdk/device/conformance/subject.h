// The device under test: how a check reaches it.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>

#include "host_sdk/device/conformance/conformance.h"
#include "host_sdk/device/device.h"
#include "protocol/types.h"

namespace scatter::conformance {

class Subject {
 public:
  explicit Subject(const Options& options) noexcept : options_(options) {}

  /// The bare carrier. Errors  those of Options::open.
  [[nodiscard]] Result<std::unique_ptr<device::Transport>> carrier();
  /// A session. A device that still holds an earlier connection (BUSY) or restarts is asked again for
  /// `patience`, on the wall clock.
  [[nodiscard]] Result<device::Device> device(
      std::chrono::milliseconds patience = std::chrono::milliseconds(3000));

  /// Read once, over a connection of its own.
  [[nodiscard]] Result<protocol::Descriptor> descriptor();

  /// Never the one before, never 0 (SPEC 6.1).
  [[nodiscard]] std::uint16_t next_nonce() noexcept;
  [[nodiscard]] device::Wait wait(std::chrono::milliseconds timeout = std::chrono::seconds(10)) const {
    return {.timeout = timeout, .stop = options_.stop};
  }
  [[nodiscard]] const std::stop_token& stop() const noexcept { return options_.stop; }
  /// Sleeps on the wall clock; false when a stop was requested.
  [[nodiscard]] bool pause(std::chrono::milliseconds time) const;

 private:
  const Options& options_;
  std::uint16_t nonce_ = 0;
  std::optional<protocol::Descriptor> descriptor_;
};

/// A light frame of illumination 0 in a window of at most 32 x 32 pixels at the sensor's middle, 1 ms or what
/// the sensor allows.
[[nodiscard]] protocol::Recipe small_recipe(const protocol::Descriptor& descriptor);

}  // namespace scatter::conformance
