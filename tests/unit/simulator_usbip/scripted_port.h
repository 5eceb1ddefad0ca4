// A USB socket whose device does what the test says; it answers the requests of enumeration by itself.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "simulator/usb/usb_port.h"

namespace scatter::simulator {

class ScriptedPort final : public UsbPort {
 public:
  void plug(UsbBusSpeed speed) override {
    speed_ = speed;
    plugged_ = true;
    ++joins_;
  }
  void unplug() override {
    plugged_ = false;
    end_all();
  }
  [[nodiscard]] bool plugged() const override { return plugged_; }
  [[nodiscard]] bool present() const override { return plugged_ && !away_; }
  [[nodiscard]] std::uint32_t joins() const override { return joins_; }
  void reset() override {
    ++resets;
    end_all();
  }
  void submit(UsbTransfer transfer) override { transfers.push_back(std::move(transfer)); }
  bool cancel(std::uint64_t id) override {
    const auto found = find(id);
    if (found == transfers.end()) {
      return false;
    }
    std::vector<std::byte> data(moved_before_cancel);
    completions_.push_back({id, UsbOutcome::kCancelled, data.size(), std::move(data)});
    transfers.erase(found);
    return true;
  }
  [[nodiscard]] std::optional<UsbCompletion> next_completion() override {
    if (completions_.empty()) {
      return std::nullopt;
    }
    UsbCompletion first = std::move(completions_.front());
    completions_.pop_front();
    return first;
  }
  [[nodiscard]] std::size_t under_way() const override { return transfers.size(); }
  [[nodiscard]] bool host_is_slow() const override { return false; }

  // What the test makes the device do.

  void complete(std::uint64_t id, UsbOutcome outcome, std::vector<std::byte> data = {}) {
    const auto found = find(id);
    if (found != transfers.end()) {
      const std::size_t actual = (found->endpoint & 0x80U) != 0 ? data.size() : found->data.size();
      completions_.push_back(
          {id, outcome, outcome == UsbOutcome::kDone ? actual : data.size(), std::move(data)});
      transfers.erase(found);
    }
  }
  void leave() {
    away_ = true;
    end_all();
  }
  void join() {
    away_ = false;
    ++joins_;
  }
  /// Accepts SET_ requests and gives the descriptors.
  void enumerate() {
    const auto waiting = transfers;
    for (const UsbTransfer& each : waiting) {
      if ((each.endpoint & 0x0FU) != 0) {
        continue;
      }
      if (each.setup[1] == 6) {
        auto data = each.setup[3] == 1 ? device_descriptor : configuration_descriptor;
        data.resize(std::min(data.size(), each.length));
        complete(each.id, UsbOutcome::kDone, std::move(data));
      } else {
        complete(each.id, UsbOutcome::kDone);
      }
    }
  }

  static std::vector<std::byte> bytes(std::initializer_list<int> values) {
    std::vector<std::byte> out;
    for (const int value : values) {
      out.push_back(static_cast<std::byte>(value));
    }
    return out;
  }

  std::deque<UsbTransfer> transfers;  ///< Under way.
  int resets = 0;
  std::size_t moved_before_cancel = 0;
  std::vector<std::byte> device_descriptor =
      bytes({18, 1, 0, 2, 0, 0, 0, 64, 0x09, 0x12, 0x0D, 0, 0, 1, 0, 0, 0, 1});
  std::vector<std::byte> configuration_descriptor =
      bytes({9, 2, 18, 0, 1, 1, 0, 0x80, 50, 9, 4, 0, 0, 0, 0xFF, 5, 1, 0});

 private:
  std::deque<UsbTransfer>::iterator find(std::uint64_t id) {
    return std::ranges::find(transfers, id, &UsbTransfer::id);
  }
  void end_all() {
    for (const UsbTransfer& each : transfers) {
      completions_.push_back({each.id, UsbOutcome::kGone, 0, {}});
    }
    transfers.clear();
  }

  UsbBusSpeed speed_ = UsbBusSpeed::kHigh;
  bool plugged_ = false;
  bool away_ = false;
  std::uint32_t joins_ = 0;
  std::deque<UsbCompletion> completions_;
};

}  // namespace scatter::simulator
