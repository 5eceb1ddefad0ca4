#include "tests/usb/port_transport.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

#include "protocol/usb_identity.h"

namespace scatter::usb_test {
namespace {

using device::TimePoint;
using simulator::UsbCompletion;
using simulator::UsbOutcome;

namespace usb = protocol::usb;

constexpr std::size_t kInFlight = 16;
/// Longest run of the instrument before the stop token is looked at again [us].
constexpr std::uint64_t kSliceUs = 10'000;

class PortTransport final : public device::Transport {
 public:
  explicit PortTransport(std::shared_ptr<simulator::VirtualInstrument> instrument)
      : host_(std::move(instrument)) {}
  ~PortTransport() override { close(); }

  bool open() {
    open_ = host_.open_stream();
    joins_ = host_.port().joins();
    for (std::size_t i = 0; open_ && i < kInFlight; ++i) {
      in_flight_.push_back(host_.submit_in(usb::kBulkIn, usb::kTransferBytes));
    }
    return open_;
  }

  Result<std::span<const std::byte>> receive(TimePoint deadline, const std::stop_token& stop) override {
    if (open_ && lent_.capacity() > 0) {
      in_flight_.push_back(host_.submit_in(usb::kBulkIn, usb::kTransferBytes, std::exchange(lent_, {})));
    }
    while (open_) {
      auto completion = host_.take(in_flight_.front());
      if (!completion) {
        if (Status waited = wait(deadline, stop, "a byte"); !waited) {
          return std::unexpected(std::move(waited.error()));
        }
        continue;
      }
      in_flight_.pop_front();
      if (completion->outcome == UsbOutcome::kDone && completion->actual > 0) {
        lent_ = std::move(completion->data);
        return std::span<const std::byte>(lent_);
      }
      if (!go_on_after(*completion)) {
        break;
      }
    }
    return std::unexpected(gone());
  }

  Status write(std::span<const std::byte> bytes, TimePoint deadline, const std::stop_token& stop) override {
    if (!open_) {
      return std::unexpected(gone());
    }
    const std::uint64_t id = host_.submit_out(usb::kBulkOut, {bytes.begin(), bytes.end()});
    while (true) {
      if (const auto completion = host_.take(id)) {
        if (completion->outcome == UsbOutcome::kDone) {
          return {};
        }
        open_ = open_ && completion->outcome != UsbOutcome::kGone;
        return std::unexpected(gone());
      }
      if (Status waited = wait(deadline, stop, "room"); !waited) {
        host_.cancel(id);
        return waited;
      }
    }
  }

  [[nodiscard]] TimePoint now() const override {
    return TimePoint(std::chrono::microseconds(instrument().now_us()));
  }
  [[nodiscard]] std::uint64_t system_time_unix_ns() const override {
    return instrument().unix_time_us() * 1000;
  }
  [[nodiscard]] device::CarrierStatistics statistics() const override { return statistics_; }

  void close() noexcept override {
    if (!std::exchange(open_, false)) {
      return;
    }
    for (const std::uint64_t id : in_flight_) {
      host_.cancel(id);
    }
    in_flight_.clear();
    if (host_.port().present() && host_.port().joins() == joins_) {
      (void)host_.select_stream(usb::kStreamIdleSetting);
      host_.instrument().run_ready();
    }
  }

 private:
  [[nodiscard]] simulator::VirtualInstrument& instrument() const {
    return const_cast<PortHost&>(host_).instrument();
  }
  static Error gone() {
    return {ErrorCode::kDisconnected, "usb: the simulated instrument left the bus", "plug it in again"};
  }

  /// False: the device is gone.
  bool go_on_after(UsbCompletion& completion) {
    switch (completion.outcome) {
      case UsbOutcome::kStalled:
        // Those behind it on the halted endpoint stall as well; they are one event.
        if (halted_until_ <= completion.id) {
          ++statistics_.stalls;
          halted_until_ = in_flight_.empty() ? completion.id + 1 : in_flight_.back() + 1;
          if (!host_.clear_halt(usb::kBulkIn)) {
            open_ = false;
            return false;
          }
        }
        break;
      case UsbOutcome::kBabble:
        ++statistics_.overflows;
        break;
      case UsbOutcome::kDone:
        break;
      case UsbOutcome::kError:
      case UsbOutcome::kCancelled:
      case UsbOutcome::kGone:
        open_ = false;
        return false;
    }
    in_flight_.push_back(host_.submit_in(usb::kBulkIn, usb::kTransferBytes, std::move(completion.data)));
    return true;
  }

  Status wait(TimePoint deadline, const std::stop_token& stop, std::string_view what) {
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "usb: stopped on request", "start again when ready");
    }
    const auto left = std::chrono::ceil<std::chrono::microseconds>(deadline - now()).count();
    const std::uint64_t left_us = left > 0 ? static_cast<std::uint64_t>(left) : 0;
    const bool going = host_.run(instrument().now_us() + std::min(left_us, kSliceUs));
    if (left_us == 0 && !going) {
      return fail(ErrorCode::kDeadlineExceeded, fmt::format("usb: no {} within the deadline", what),
                  "allow more time, or look for a fault");
    }
    return {};
  }

  PortHost host_;
  bool open_ = false;
  std::uint32_t joins_ = 0;
  std::deque<std::uint64_t> in_flight_;
  Bytes lent_;
  std::uint64_t halted_until_ =
      0;  ///< Stalls of transfers before this one belong to a halt that was cleared.
  device::CarrierStatistics statistics_;
};

}  // namespace

std::unique_ptr<device::Transport> make_port_transport(
    std::shared_ptr<simulator::VirtualInstrument> instrument) {
  auto transport = std::make_unique<PortTransport>(std::move(instrument));
  return transport->open() ? std::move(transport) : nullptr;
}

}  // namespace scatter::usb_test
