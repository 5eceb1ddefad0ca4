// An instrument whose firmware speaks another wire major than this program.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "protocol/frame.h"
#include "protocol/link_decoder.h"
#include "tests/usb/mock_bus/host_port.h"

namespace scatter::mock_bus {

/// On the bus it is the instrument that it wraps, with the wire major in its class numbers. Its bulk
/// endpoints answer HELLO as firmware of wire major `major` does and nothing else.
class OtherWire final : public Peripheral, private simulator::UsbPort {
 public:
  enum class Manner : std::uint8_t {
    kRefuses,  ///< As SPEC 6.4 says: in frames of wire major 1.
    kAnswers,  ///< In frames of its own wire major.
  };
  OtherWire(std::unique_ptr<Peripheral> instrument, std::uint8_t major, Manner manner)
      : instrument_(std::move(instrument)), major_(major), manner_(manner), decoder_(buffer_) {}

  [[nodiscard]] simulator::UsbPort& port() override { return *this; }
  std::uint64_t run_ready() override { return instrument_->run_ready(); }
  [[nodiscard]] std::uint64_t now_us() const override { return instrument_->now_us(); }
  void advance_to(std::uint64_t time_us) override { instrument_->advance_to(time_us); }
  [[nodiscard]] simulator::ClockMode clock_mode() const override { return instrument_->clock_mode(); }

 private:
  [[nodiscard]] simulator::UsbPort& inner() const { return instrument_->port(); }
  void plug(simulator::UsbBusSpeed speed) override;
  void unplug() override;
  [[nodiscard]] bool plugged() const override { return inner().plugged(); }
  [[nodiscard]] bool present() const override { return inner().present(); }
  [[nodiscard]] std::uint32_t joins() const override { return inner().joins(); }
  void reset() override;
  void submit(simulator::UsbTransfer transfer) override;
  bool cancel(std::uint64_t id) override;
  [[nodiscard]] std::optional<simulator::UsbCompletion> next_completion() override;
  [[nodiscard]] std::size_t under_way() const override { return inner().under_way() + reads_.size(); }
  [[nodiscard]] bool host_is_slow() const override { return !answers_.empty() && reads_.empty(); }

  void answer(const protocol::Frame& frame);
  void hand_out();
  /// Everything on the bulk endpoints ends.
  void forget(simulator::UsbOutcome outcome);
  void end(std::uint64_t id, simulator::UsbOutcome outcome, std::size_t actual, Bytes data = {});

  std::unique_ptr<Peripheral> instrument_;
  std::uint8_t major_;
  Manner manner_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(protocol::kMaxFrameBytes);
  protocol::LinkDecoder decoder_;
  std::set<std::uint64_t> configurations_;  ///< Requests for the configuration descriptor under way.
  std::deque<std::uint64_t> reads_;         ///< Bulk IN transfers under way.
  std::deque<Bytes> answers_;
  std::deque<simulator::UsbCompletion> done_;
};

}  // namespace scatter::mock_bus
