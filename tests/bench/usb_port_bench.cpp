// The virtual USB socket: what its two ends cost, and the SDK's whole stream over it against the pipe of
// sim:.
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <vector>

#include "host_sdk/device/device.h"
#include "protocol/usb_identity.h"
#include "simulator/instrument/virtual_instrument.h"
#include "simulator/usb/virtual_usb_controller.h"
#include "tests/bench/bench.h"
#include "tests/usb/port_transport.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace scatter::bench {
namespace {

namespace usb = protocol::usb;

constexpr double kBytesPerMegabyte = 1e6;
constexpr std::size_t kInFlight = 16;

struct StillClock final : firmware::Clock {
  [[nodiscard]] std::uint64_t now_us() noexcept override { return 0; }
};

/// A device that has nothing to do but to send frames, and a host that only takes them.
class Socket {
 public:
  Socket() : port_(clock_, {}, 1), frame_(protocol::kMaxFrameBytes, std::byte{0x5A}) {
    port_.plug(simulator::UsbBusSpeed::kHigh);
    port_.connect(true);
    const std::array<firmware::UsbEndpoint, 1> endpoints{{{.address = usb::kBulkIn,
                                                           .type = firmware::UsbEndpoint::Type::kBulk,
                                                           .packet_bytes = usb::kHighSpeedBulkPacket}}};
    port_.open_endpoints(endpoints);
    for (std::size_t i = 0; i < kInFlight; ++i) {
      port_.submit({.id = ++id_, .endpoint = usb::kBulkIn, .length = usb::kTransferBytes});
    }
  }
  /// Bytes that the host got.
  std::size_t pass(std::size_t frames) {
    std::size_t bytes = 0;
    for (std::size_t i = 0; i < frames; ++i) {
      keep(port_.write(usb::kBulkIn, frame_));
      port_.end_transfer(usb::kBulkIn);
      while (auto completion = port_.next_completion()) {
        keep(completion->data.data());
        bytes += completion->actual;
        port_.submit({.id = ++id_,
                      .endpoint = usb::kBulkIn,
                      .data = std::move(completion->data),
                      .length = usb::kTransferBytes});
      }
    }
    return bytes;
  }

 private:
  StillClock clock_;
  simulator::VirtualUsbController port_;
  std::vector<std::byte> frame_;
  std::uint64_t id_ = 0;
};

std::vector<Figure> port_stream() {
  constexpr std::size_t kFrames = 64;
  constexpr std::size_t kBytes = kFrames * protocol::kMaxFrameBytes;
  Socket socket;
  const std::vector<std::byte> from(protocol::kMaxFrameBytes, std::byte{0x5A});
  std::vector<std::vector<std::byte>> to(kInFlight, std::vector<std::byte>(protocol::kMaxFrameBytes));
  return {run_contest("usb.port_stream", {.unit = "MB/s",
                                          .work = kBytes / kBytesPerMegabyte,
                                          .ours = [&] { keep(socket.pass(kFrames)); },
                                          .peer = "memcpy",
                                          .theirs =
                                              [&] {
                                                for (std::size_t i = 0; i < kFrames; ++i) {
                                                  std::memcpy(to[i % kInFlight].data(), from.data(),
                                                              from.size());
                                                  keep(to[i % kInFlight].data());
                                                }
                                              }})};
}

using Instrument = std::shared_ptr<simulator::VirtualInstrument>;

Instrument instrument_with(simulator::Carrier carrier) {
  simulator::InstrumentOptions options;
  options.carrier = carrier;
  return std::move(simulator::VirtualInstrument::make(options).value());
}

device::Device device_over(Instrument instrument) {
  auto transport = instrument->usb() != nullptr ? usb_test::make_port_transport(std::move(instrument))
                                                : tools::make_sim_transport(std::move(instrument));
  return std::move(device::Device::open(std::move(transport)).value());
}

/// The counter pattern in whole frames of the sensor, through firmware, carrier and SDK; every pixel checked
/// by the device's checksum over the frame.
std::size_t stream_pattern(device::Device& device, std::uint16_t frames) {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(100);
  recipe.repeats = frames;
  recipe.test_pattern = 1;
  const auto configured = device.configure(recipe);
  auto stream = device.start({.credit_window = 16});
  std::size_t bytes = 0;
  while (configured && stream) {
    const auto frame = stream->next();
    if (!frame || !*frame) {
      break;
    }
    bytes += (*frame)->size_bytes;
  }
  return bytes;
}

std::vector<Figure> instrument_stream() {
  constexpr std::uint16_t kFrames = 8;
  device::Device usb_device = device_over(instrument_with(simulator::Carrier::kUsb));
  device::Device pipe_device = device_over(instrument_with(simulator::Carrier::kPipe));
  const double bytes = static_cast<double>(stream_pattern(usb_device, kFrames));
  return {run_contest("usb.instrument_stream", {.unit = "MB/s",
                                                .work = bytes / kBytesPerMegabyte,
                                                .ours = [&] { keep(stream_pattern(usb_device, kFrames)); },
                                                .peer = "sim:",
                                                .theirs = [&] { keep(stream_pattern(pipe_device, kFrames)); },
                                                .round_seconds = 0.1})};
}

/// A request's round trip while every queue between sensor and host is full; 20 ms at p99 are allowed.
std::vector<Figure> control_round_trip() {
  constexpr std::uint16_t kTrips = 300;
  constexpr double kAllowedMs = 20.0;
  const Instrument instrument = instrument_with(simulator::Carrier::kUsb);
  device::Device device = device_over(instrument);
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(100);
  recipe.repeats = kTrips + 1;
  recipe.test_pattern = 1;
  const auto configured = device.configure(recipe);
  auto stream = device.start({.credit_window = 64});
  std::vector<double> trips_ms;
  while (configured && stream && trips_ms.size() < kTrips) {
    const auto frame = stream->next();
    const std::uint64_t busy_until = instrument->now_us() + 200'000;
    while (instrument->now_us() < busy_until) {
      instrument->advance_to(std::min(instrument->run_ready(), busy_until));
    }
    bool answered = false;
    // Host and device share this thread: its processor time is the round trip of an idle machine.
    const double seconds = cpu_seconds_of([&] { answered = device.status().has_value(); });
    if (!frame || !*frame || !answered) {
      break;
    }
    trips_ms.push_back(1e3 * seconds);
  }
  if (trips_ms.size() < kTrips) {
    return {};
  }
  std::ranges::sort(trips_ms);
  return {make_figure("usb.control_round_trip.p99", trips_ms[kTrips * 99 / 100], "ms", "allowed", kAllowedMs,
                      Better::kLower)};
}

const Benchmark kRoundTrip{"usb.control_round_trip", control_round_trip};
const Benchmark kPortStream{"usb.port_stream", port_stream};
const Benchmark kInstrumentStream{"usb.instrument_stream", instrument_stream};

}  // namespace
}  // namespace scatter::bench
