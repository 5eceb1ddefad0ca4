// The host program of the firmware's tests on the bulk endpoints: its bytes go out in packets, frames come in
// by transfers; and the rescue channel's reports.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <optional>
#include <vector>

#include "protocol/rescue_report.h"
#include "tests/unit/firmware/fake_host.h"
#include "tests/unit/firmware_usb/descriptor_walk.h"
#include "tests/unit/firmware_usb/usb_board.h"

namespace scatter::firmware::fake {

class UsbHost {
 public:
  explicit UsbHost(UsbBoard& board) : board_(board), host(board.board, [this] { return turn(); }) {}

  /// Enumerates and attaches to interface 0.
  void attach() {
    board_.enumerate();
    REQUIRE(board_.set_interface(0, 1));
    board_.settle();
    REQUIRE(board_.link->connected());
  }
  /// Whole transfers, in order.
  [[nodiscard]] const std::vector<Bytes>& transfers() const { return transfers_; }
  bool reading = true;  ///< False: bulk IN is stuck.

  // --- HID
  static Bytes report(const protocol::RescueRequest& request) {
    protocol::Report bytes{};
    encode(request, bytes);
    return {bytes.begin(), bytes.end()};
  }
  /// By the interrupt OUT endpoint.
  void ask(const protocol::RescueRequest& request) {
    REQUIRE(board_.bus.out(protocol::usb::kRescueOut, report(request)));
  }
  /// By SET_REPORT.
  bool set_report(const protocol::RescueRequest& request) {
    return !board_.control(0x21, 9, 0x0200, 1, 64, report(request)).stalled;
  }
  /// The next input report, if one waits.
  Bytes input() {
    board_.settle();
    Bytes report = board_.bus.in(protocol::usb::kRescueIn, 64);
    const bool whole = report.empty() || report.size() == 64;
    CHECK(whole);
    return report;
  }
  /// All that wait and come meanwhile.
  std::vector<protocol::RescueStatus> statuses() {
    std::vector<protocol::RescueStatus> found;
    for (Bytes one = input(); !one.empty(); one = input()) {
      if (const auto status = protocol::decode_rescue_status(one)) {
        found.push_back(*status);
      } else {
        const auto answer = protocol::decode_rescue_answer(one);
        REQUIRE(answer.has_value());
        answers.push_back(*answer);
      }
    }
    return found;
  }
  protocol::RescueAnswer answer_to(const protocol::RescueRequest& request) {
    ask(request);
    board_.settle();
    answers.clear();
    (void)statuses();
    REQUIRE(answers.size() == 1);
    CHECK(answers[0].tag == request.tag);
    CHECK(answers[0].command == request.command);
    return answers[0];
  }
  protocol::RescueStatus feature() {
    const ControlResult got = board_.control(0xA1, 1, 0x0300, 1, 64);
    REQUIRE_FALSE(got.stalled);
    CHECK(got.data.size() == 64);
    const auto status = protocol::decode_rescue_status(got.data);
    REQUIRE(status.has_value());
    return *status;
  }
  std::vector<protocol::RescueAnswer> answers;

 private:
  Step turn() {
    auto& to_device = board_.board.link.to_device;
    if (!to_device.empty() && board_.bus.endpoints.count(protocol::usb::kBulkOut) != 0) {
      const std::size_t size = std::min<std::size_t>(to_device.size(), 512);
      Bytes packet(to_device.begin(), to_device.begin() + static_cast<std::ptrdiff_t>(size));
      if (board_.bus.out(protocol::usb::kBulkOut, std::move(packet))) {
        to_device.erase(to_device.begin(), to_device.begin() + static_cast<std::ptrdiff_t>(size));
      }
    }
    Step step = board_.turn();
    if (reading) {
      Bytes got = board_.bus.in(protocol::usb::kBulkIn, protocol::usb::kTransferBytes);
      if (!got.empty()) {
        step.did_work = true;
        board_.board.link.to_host.insert(board_.board.link.to_host.end(), got.begin(), got.end());
        transfers_.push_back(std::move(got));
      }
    }
    return step;
  }

  UsbBoard& board_;
  std::vector<Bytes> transfers_;

 public:
  FakeHost host;
};

}  // namespace scatter::firmware::fake
