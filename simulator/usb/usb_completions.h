// Finished transfers on their way to the host.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "simulator/usb/usb_port.h"

namespace scatter::simulator {

/// In order of completion. Threads: one.
class UsbCompletions {
 public:
  /// A transfer to the host: `data` is what arrived.
  void add_in(std::uint64_t id, UsbOutcome outcome, std::vector<std::byte> data) {
    const std::size_t actual = data.size();
    queue_.push_back({.id = id, .outcome = outcome, .actual = actual, .data = std::move(data)});
  }
  /// One to the device: `actual` bytes went.
  void add_out(std::uint64_t id, UsbOutcome outcome, std::size_t actual) {
    queue_.push_back({.id = id, .outcome = outcome, .actual = actual, .data = {}});
  }
  [[nodiscard]] bool empty() const noexcept { return queue_.empty(); }
  [[nodiscard]] std::optional<UsbCompletion> take() {
    if (queue_.empty()) {
      return std::nullopt;
    }
    std::optional<UsbCompletion> first(std::move(queue_.front()));
    queue_.pop_front();
    return first;
  }

 private:
  std::deque<UsbCompletion> queue_;
};

}  // namespace scatter::simulator
