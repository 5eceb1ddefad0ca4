// A device controller in memory, which notes every misuse, and the host's side of its cable.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "firmware/ports/usb_controller.h"

namespace scatter::firmware::fake {

using Bytes = std::vector<std::byte>;

struct FakeEndpoint {
  UsbEndpoint what{};
  bool halted = false;
  Bytes in{};                       ///< To the host, not taken yet.
  std::vector<std::size_t> ends{};  ///< Lengths of `in` at which a transfer ends.
  std::deque<Bytes> out{};          ///< Packets from the host.
};

class FakeController final : public UsbController {
 public:
  enum class Answer : std::uint8_t { kNone, kSent, kAccepted, kStalled };

  UsbSpeed its_speed = UsbSpeed::kHigh;
  std::size_t in_capacity = 64 * 1024;  ///< Of each IN endpoint.
  std::vector<std::string> misuse;      ///< What a real controller could not have done.

  // --- what the host did and saw
  bool on_bus = false;
  std::uint32_t joins = 0;
  std::uint8_t address = 0;
  std::map<std::uint8_t, FakeEndpoint> endpoints;       ///< The open ones.
  std::map<std::uint8_t, std::uint32_t> toggle_resets;  ///< By endpoint, since the controller was made.

  Answer answer = Answer::kNone;  ///< Of the last SETUP.
  Bytes sent;
  std::size_t wanted = 0;  ///< Bytes asked for by control_receive; 0 = none.

  void happen(UsbEvent event) { events_.push_back(event); }
  void reset() {
    address = 0;
    endpoints.clear();
    events_.clear();
    under_way_ = false;
    wanted = 0;
    happen({.kind = UsbEvent::Kind::kReset});
  }
  void setup(const std::array<std::uint8_t, 8>& bytes) {
    happen({.kind = UsbEvent::Kind::kSetup, .setup = bytes});
  }
  /// The OUT data stage; at most what was asked for.
  void give(std::span<const std::byte> data) {
    const std::size_t size = std::min(data.size(), room_.size());
    std::copy_n(data.begin(), size, room_.begin());
    wanted = 0;
    happen({.kind = UsbEvent::Kind::kControlData, .size = size});
  }
  /// A SETUP that was handed over has not been answered.
  [[nodiscard]] bool unanswered() const { return under_way_; }
  [[nodiscard]] bool quiet() const { return events_.empty(); }

  // --- UsbController
  void connect(bool on) noexcept override {
    if (on == on_bus) {
      misuse.emplace_back("connect changes nothing");
    }
    on_bus = on;
    joins += on ? 1 : 0;
    address = 0;
    endpoints.clear();
    events_.clear();
    under_way_ = false;
    wanted = 0;
    sent_view_ = {};
  }
  UsbSpeed speed() noexcept override { return on_bus ? its_speed : UsbSpeed::kNone; }
  UsbEvent next_event() noexcept override {
    if (events_.empty()) {
      return {};
    }
    const UsbEvent event = events_.front();
    events_.pop_front();
    if (!sent_view_.empty() && !std::ranges::equal(sent_view_, sent)) {
      misuse.emplace_back("the data of control_send changed before the next event");
    }
    sent_view_ = {};
    if (event.kind == UsbEvent::Kind::kSetup) {
      under_way_ = true;
      answer = Answer::kNone;
      sent.clear();
      wanted = 0;
      current_ = event.setup;
    }
    if (event.kind == UsbEvent::Kind::kReset || event.kind == UsbEvent::Kind::kUnplugged) {
      under_way_ = false;
    }
    return event;
  }
  void control_send(std::span<const std::byte> data) noexcept override {
    finish(Answer::kSent);
    const std::size_t length = current_[6] | static_cast<std::size_t>(current_[7]) << 8U;
    if ((current_[0] & 0x80U) == 0 || length == 0 || data.size() > length) {
      misuse.emplace_back("control_send without an IN data stage, or longer than it");
    }
    sent.assign(data.begin(), data.end());
    sent_view_ = data;
  }
  void control_receive(std::span<std::byte> room) noexcept override {
    const std::size_t length = current_[6] | static_cast<std::size_t>(current_[7]) << 8U;
    if (!under_way_ || wanted != 0 || (current_[0] & 0x80U) != 0 || length == 0 || room.size() != length) {
      misuse.emplace_back("control_receive without an OUT data stage, twice, or of another length");
    }
    room_ = room;
    wanted = room.size();
  }
  void control_accept() noexcept override {
    finish(Answer::kAccepted);
    const std::size_t length = current_[6] | static_cast<std::size_t>(current_[7]) << 8U;
    if ((current_[0] & 0x80U) != 0 && length != 0) {
      misuse.emplace_back("control_accept where the host waits for data");
    }
    address = next_address_ != 0xFF ? next_address_ : address;
    next_address_ = 0xFF;
  }
  void control_stall() noexcept override { finish(Answer::kStalled); }
  void set_address(std::uint8_t value) noexcept override { next_address_ = value; }

  void open_endpoints(std::span<const UsbEndpoint> wanted_ones) noexcept override {
    std::map<std::uint8_t, FakeEndpoint> next;
    for (const UsbEndpoint& one : wanted_ones) {
      const auto old = endpoints.find(one.address);
      if (old != endpoints.end()) {
        next[one.address] = old->second;
        continue;
      }
      ++toggle_resets[one.address];
      next[one.address] = FakeEndpoint{.what = one};
    }
    endpoints = std::move(next);
  }
  std::size_t write(std::uint8_t number, std::span<const std::byte> bytes) noexcept override {
    FakeEndpoint* const to = find(number);
    if (to == nullptr || (number & 0x80U) == 0 || to->halted) {
      return 0;
    }
    const std::size_t size = std::min(bytes.size(), in_capacity - std::min(in_capacity, to->in.size()));
    to->in.insert(to->in.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    return size;
  }
  void end_transfer(std::uint8_t number) noexcept override {
    FakeEndpoint* const to = find(number);
    if (to != nullptr && (to->ends.empty() || to->ends.back() != to->in.size())) {
      to->ends.push_back(to->in.size());
    }
  }
  std::size_t waiting(std::uint8_t number) noexcept override {
    const FakeEndpoint* const at = find(number);
    return at == nullptr ? 0 : at->in.size();
  }
  std::size_t read(std::uint8_t number, std::span<std::byte> out) noexcept override {
    FakeEndpoint* const from = find(number);
    if (from == nullptr || (number & 0x80U) != 0 || from->out.empty() || from->halted) {
      return 0;
    }
    Bytes& packet = from->out.front();
    const std::size_t size = std::min(out.size(), packet.size());
    std::copy_n(packet.begin(), size, out.begin());
    packet.erase(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(size));
    if (packet.empty()) {
      from->out.pop_front();
    }
    return size;
  }
  void set_halt(std::uint8_t number, bool on) noexcept override {
    FakeEndpoint* const at = find(number);
    if (at == nullptr) {
      misuse.emplace_back("set_halt of an endpoint that is not open");
      return;
    }
    at->halted = on;
    if (!on) {
      ++toggle_resets[number];
      at->in.clear();
      at->ends.clear();
      at->out.clear();
    }
  }
  bool halted(std::uint8_t number) noexcept override {
    const FakeEndpoint* const at = find(number);
    return at != nullptr && at->halted;
  }

  // --- the host's transfers
  /// One IN transfer of up to `most` bytes: up to the next end.
  Bytes in(std::uint8_t number, std::size_t most = 1U << 20U) {
    FakeEndpoint* const from = find(number);
    if (from == nullptr || from->halted) {
      return {};
    }
    std::size_t size = std::min(most, from->in.size());
    if (!from->ends.empty()) {
      size = std::min(size, from->ends.front());
    }
    Bytes taken(from->in.begin(), from->in.begin() + static_cast<std::ptrdiff_t>(size));
    from->in.erase(from->in.begin(), from->in.begin() + static_cast<std::ptrdiff_t>(size));
    for (std::size_t& end : from->ends) {
      end -= size;
    }
    if (!from->ends.empty() && from->ends.front() == 0) {
      from->ends.erase(from->ends.begin());
    }
    return taken;
  }
  /// False: no such endpoint, or halted.
  bool out(std::uint8_t number, Bytes packet) {
    FakeEndpoint* const to = find(number);
    if (to == nullptr || to->halted) {
      return false;
    }
    to->out.push_back(std::move(packet));
    return true;
  }

 private:
  FakeEndpoint* find(std::uint8_t number) {
    const auto found = endpoints.find(number);
    return found == endpoints.end() ? nullptr : &found->second;
  }
  void finish(Answer how) {
    if (!under_way_) {
      misuse.emplace_back("an answer without a SETUP, or a second one");
    }
    if (wanted != 0) {
      misuse.emplace_back("an answer before the data of control_receive");
    }
    under_way_ = false;
    answer = how;
  }

  std::deque<UsbEvent> events_;
  std::array<std::uint8_t, 8> current_{};
  bool under_way_ = false;
  std::span<std::byte> room_;
  std::span<const std::byte> sent_view_;
  std::uint8_t next_address_ = 0xFF;
};

}  // namespace scatter::firmware::fake
