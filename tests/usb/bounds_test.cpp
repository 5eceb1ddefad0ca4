// How long things take at most: the figures that README promises, at the 99th percentile of 200 repeats or
// more.
#include <fmt/format.h>

#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using device::Device;

namespace {

constexpr int kRepeats = 200;
constexpr double kStopMs = 100;
constexpr double kCloseMs = 200;
constexpr double kUnplugMs = 300;
constexpr double kFirstFrameMs = 300;
constexpr double kReplugMs = 1000;
constexpr double kRoundTripMs = 20;

void report(const char* what, const std::vector<double>& samples, double limit) {
  std::vector<double> sorted = samples;
  std::sort(sorted.begin(), sorted.end());
  const double worst = p99(samples);
  WARN(fmt::format("{}: median {:.2f} ms, p99 {:.2f} ms of {} (at most {:.0f} ms)", what,
                   sorted[sorted.size() / 2], worst, samples.size(), limit));
  CHECK(worst < limit);
}

device::Stream start_endless(Device& device) {
  REQUIRE(device.configure(endless_recipe()).has_value());
  Result<device::Stream> stream = device.start();
  REQUIRE(stream.has_value());
  return std::move(*stream);
}

}  // namespace

TEST_CASE("stop() takes less than 100 ms while frames come") {
  Host host;
  Device device = host.open();
  std::vector<double> samples;
  for (int k = 0; k < kRepeats; ++k) {
    device::Stream stream = start_endless(device);
    REQUIRE(stream.next().has_value());
    const Clock::time_point start = Clock::now();
    REQUIRE(stream.stop().has_value());
    samples.push_back(ms_since(start));
    while (*stream.next()) {
    }
    CHECK(stream.summary().ledger.balances());
  }
  report("stop", samples, kStopMs);
}

TEST_CASE("Closing takes less than 200 ms while frames come") {
  Host host;
  std::vector<double> samples;
  for (int k = 0; k < kRepeats; ++k) {
    auto device = std::make_unique<Device>(host.open());
    auto stream = std::make_unique<device::Stream>(start_endless(*device));
    REQUIRE(stream->next().has_value());
    const Clock::time_point start = Clock::now();
    stream.reset();
    device.reset();
    samples.push_back(ms_since(start));
  }
  report("close", samples, kCloseMs);
}

TEST_CASE("The first frame comes within 300 ms after start, its exposure aside") {
  Host host;
  Device device = host.open();
  std::vector<double> samples;
  for (int k = 0; k < kRepeats; ++k) {
    REQUIRE(device.configure(integration::pattern_recipe(1)).has_value());
    const Clock::time_point start = Clock::now();
    Result<device::Stream> stream = device.start();
    REQUIRE(stream.has_value());
    REQUIRE(stream->next().has_value());
    samples.push_back(ms_since(start) - 1);  // The exposure is 1 ms.
    while (*stream->next()) {
    }
  }
  report("first frame", samples, kFirstFrameMs);
}

TEST_CASE("A pulled cable is noticed within 300 ms, and the instrument is open again within a second") {
  Host host;
  std::vector<double> noticed;
  std::vector<double> reopened;
  auto device = std::make_unique<Device>(host.open());
  const std::string uri = "usb:serial=" + std::string(device->descriptor().serial.str());
  for (int k = 0; k < kRepeats; ++k) {
    {
      device::Stream stream = start_endless(*device);
      REQUIRE(stream.next().has_value());
      Clock::time_point start;
      std::jthread hand([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
        start = Clock::now();
        host.bus().unplug();
      });
      for (;;) {
        auto frame = stream.next();
        if (!frame) {
          CHECK(frame.error().code == ErrorCode::kDisconnected);
          break;
        }
        REQUIRE(frame->has_value());
      }
      hand.join();
      noticed.push_back(ms_since(start));
      CHECK(stream.summary().ledger.balances());
    }
    device.reset();
    const Clock::time_point start = Clock::now();
    host.bus().plug();
    device = std::make_unique<Device>(host.open_soon(uri));
    reopened.push_back(ms_since(start));
  }
  report("unplug noticed", noticed, kUnplugMs);
  report("open after replug", reopened, kReplugMs);
}

TEST_CASE("Requests get through while the stream saturates the bus: round trip under 20 ms at p99") {
  Host host;
  Device device = host.open();
  auto stream = start_stream(device, endless_recipe(), 64);
  std::vector<double> samples;
  for (int k = 0; k < 300; ++k) {
    auto frame = stream.next();
    REQUIRE(frame.has_value());
    REQUIRE(frame->has_value());
    const Clock::time_point start = Clock::now();
    REQUIRE(device.status().has_value());
    samples.push_back(ms_since(start));
  }
  report("round trip beside the stream", samples, kRoundTripMs);
  REQUIRE(stream.abort().has_value());
}

TEST_CASE("Five hundred starts and stops leave nothing behind") {
  Host host;
  Device device = host.open();
  for (int k = 0; k < 500; ++k) {
    INFO("cycle " << k);
    device::Stream stream = start_endless(device);
    if (k % 3 != 0) {
      REQUIRE(stream.next().has_value());
    }
    if (k % 2 == 0) {
      REQUIRE(stream.stop().has_value());
      while (*stream.next()) {
      }
    } else {
      REQUIRE(stream.abort().has_value());
    }
    REQUIRE(stream.summary().ledger.balances());
  }
  REQUIRE(device.status().has_value());
}
