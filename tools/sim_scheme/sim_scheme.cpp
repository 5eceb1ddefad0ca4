#include "tools/sim_scheme/sim_scheme.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "simulator/instrument/instrument_options.h"
#include "simulator/instrument/virtual_instrument.h"

namespace scatter::tools {
namespace {

using device::TimePoint;
using simulator::VirtualInstrument;

/// Longest run of the instrument before the stop token is looked at again.
constexpr std::uint64_t kSliceUs = 1'000'000;
constexpr std::uint64_t kRealSliceUs = 10'000;
constexpr std::size_t kLentBytes = 256UL * 1024;

class SimTransport final : public device::Transport {
 public:
  explicit SimTransport(std::shared_ptr<VirtualInstrument> instrument)
      : instrument_(std::move(instrument)), lent_(kLentBytes) {
    instrument_->attach();
  }
  ~SimTransport() override { close(); }

  Result<std::span<const std::byte>> receive(TimePoint deadline, const std::stop_token& stop) override {
    while (true) {
      if (Status open = check_open(true); !open) {
        return std::unexpected(std::move(open.error()));
      }
      if (const std::size_t count = instrument_->host_read(lent_); count > 0) {
        return std::span<const std::byte>(lent_).first(count);
      }
      if (Status waited = wait(deadline, stop, VirtualInstrument::Until::kReadable, "a byte"); !waited) {
        return std::unexpected(std::move(waited.error()));
      }
    }
  }

  Status write(std::span<const std::byte> bytes, TimePoint deadline, const std::stop_token& stop) override {
    while (true) {
      if (Status open = check_open(false); !open) {
        return open;
      }
      bytes = bytes.subspan(instrument_->host_write(bytes));
      if (bytes.empty()) {
        return {};
      }
      if (Status waited = wait(deadline, stop, VirtualInstrument::Until::kWritable, "room"); !waited) {
        return waited;
      }
    }
  }

  TimePoint now() const override { return TimePoint(std::chrono::microseconds(instrument_->now_us())); }
  std::uint64_t system_time_unix_ns() const override { return instrument_->unix_time_us() * 1000; }

  void close() noexcept override {
    if (!std::exchange(closed_, true) && instrument_->attached()) {
      instrument_->detach();
    }
  }

 private:
  /// What the device sent before it went away can still be read, but nothing can be written.
  Status check_open(bool to_read) {
    if (closed_ || (!instrument_->attached() && !(to_read && instrument_->readable() > 0))) {
      return fail(ErrorCode::kDisconnected, "sim: the simulated instrument dropped the connection",
                  "open it again");
    }
    return {};
  }

  Status wait(TimePoint deadline, const std::stop_token& stop, VirtualInstrument::Until until,
              std::string_view what) {
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "sim: stopped on request", "start again when ready");
    }
    const TimePoint at = now();
    // Bytes that are there without waiting are handed out even when the deadline has passed.
    const auto left = std::max(deadline - at, device::Duration::zero());
    const auto left_us =
        static_cast<std::uint64_t>(std::chrono::ceil<std::chrono::microseconds>(left).count());
    const bool last = left_us == 0;
    const std::uint64_t now_us = instrument_->now_us();
    instrument_->run_until(now_us + std::min(left_us, kSliceUs), until, kRealSliceUs);
    const bool ready = until == VirtualInstrument::Until::kReadable ? instrument_->readable() > 0
                                                                    : instrument_->writable() > 0;
    if (last && !ready && instrument_->attached()) {
      return fail(ErrorCode::kDeadlineExceeded, fmt::format("sim: no {} within the deadline", what),
                  "allow more time, or look for a fault= in the URI");
    }
    return {};
  }

  std::shared_ptr<VirtualInstrument> instrument_;
  std::vector<std::byte> lent_;
  bool closed_ = false;
};

}  // namespace

std::unique_ptr<device::Transport> make_sim_transport(
    std::shared_ptr<simulator::VirtualInstrument> instrument) {
  return std::make_unique<SimTransport>(std::move(instrument));
}

Result<std::shared_ptr<VirtualInstrument>> make_sim_instrument(const device::Uri& uri) {
  if (uri.scheme != "sim" || !uri.place.empty()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: a simulated instrument has no place", uri.text()),
                fmt::format("write sim:?sample={}", uri.place));
  }
  const auto options = simulator::parse_instrument_options(uri.query);
  if (!options) {
    return std::unexpected(options.error());
  }
  auto instrument = VirtualInstrument::make(*options);
  if (!instrument) {
    return std::unexpected(std::move(instrument.error()));
  }
  return std::move(*instrument);
}

void register_sim_scheme(device::TransportRegistry& registry) {
  registry.add(
      {.name = "sim",
       .example = "sim:?sample=ggx:alpha=0.2,f0=0.04,albedo=0.3&seed=1",
       .summary = "a simulated instrument inside this program",
       .open = [](const device::Uri& uri, const device::Wait&) -> Result<std::unique_ptr<device::Transport>> {
         auto instrument = make_sim_instrument(uri);
         if (!instrument) {
           return std::unexpected(std::move(instrument.error()));
         }
         return make_sim_transport(std::move(*instrument));
       }});
}

}  // namespace scatter::tools
