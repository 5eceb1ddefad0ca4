// How fast the device answers. Times are those of the transport's clock, which is virtual for simulators.
#include <algorithm>
#include <cmath>
#include <vector>

#include "host_sdk/device/conformance/check_functions.h"
#include "host_sdk/device/conformance/finished_run.h"
#include "host_sdk/device/conformance/wire_probe.h"

namespace scatter::conformance {

namespace {

using Milliseconds = std::chrono::duration<double, std::milli>;

constexpr double kStopWithin_ms = 100;
/// A link that needs longer for a frame of the stop check or for a round trip is too slow for the promise.
constexpr double kFastLink_ms = 20;
constexpr int kStops = 30;
constexpr int kRoundTrips = 200;
/// A board's watchdog must be slower than the longest sleep of the main loop (firmware/core/step.h).
constexpr std::uint32_t kWatchdog_us = 1'000'000;

double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  const auto last = static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(std::lround(share * last))];
}

double since(device::TimePoint start, device::TimePoint end) {
  return Milliseconds(end - start).count();
}

/// One run that is stopped after its second frame.
struct StoppedRun {
  double stop_ms = 0;   ///< From the request to its report.
  double frame_ms = 0;  ///< From the arrival of a frame's first message to that of its last.
};

Result<StoppedRun> stop_once(WireProbe& probe, std::uint32_t epoch) {
  const auto started =
      probe.ask<protocol::Started>(protocol::Start{.epoch = epoch, .may_send_until = 0x7FFF'FFFF});
  if (!started) {
    return std::unexpected(started.error());
  }
  StoppedRun out;
  device::TimePoint begun = probe.now();
  const device::TimePoint end = begun + std::chrono::seconds(10);
  for (int ends = 0; ends < 2;) {
    const auto frame = probe.next(end);
    if (!frame) {
      return std::unexpected(frame.error());
    }
    if (frame->as<protocol::FrameBegin>()) {
      begun = frame->at;
    } else if (frame->as<protocol::FrameEnd>()) {
      ++ends;
      out.frame_ms = since(begun, frame->at);
    } else if (const auto finished = frame->as<protocol::RunFinished>()) {
      return fail(ErrorCode::kDataLoss,
                  fmt::format("the run ended by itself, {} exposures lost by the sensor",
                              finished->ledger.lost_sensor),
                  "look at Sensor::state");
    }
  }
  const std::uint16_t correlation = probe.next_correlation();
  const device::TimePoint asked = probe.now();
  if (const Status sent = probe.write(probe.frame_of(protocol::Stop{}, correlation)); !sent) {
    return std::unexpected(sent.error());
  }
  const auto report = probe.reply_to(correlation, std::chrono::seconds(10));
  if (!report) {
    return std::unexpected(report.error());
  }
  if (!report->as<protocol::RunReport>()) {
    return fail(ErrorCode::kDataLoss, "stop was not answered by a run report", "look at the device's stop");
  }
  out.stop_ms = since(asked, report->at);
  return out;
}

}  // namespace

void check_stop_latency(Subject& subject, Judgement& judge) {
  const auto descriptor = subject.descriptor();
  if (!descriptor) {
    return judge.broken("open", descriptor.error());
  }
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  protocol::Recipe recipe = small_recipe(*descriptor);
  recipe.repeats = 0xFFFF;
  const auto accepted =
      probe->ask<protocol::ConfigurationAccepted>(protocol::SetConfiguration{.recipe = recipe});
  if (!accepted) {
    return judge.broken("set_configuration", accepted.error());
  }
  std::vector<double> stops;
  std::vector<double> frames;
  const device::TimePoint end = probe->now() + std::chrono::seconds(40);
  for (int i = 0; i < kStops && probe->now() < end; ++i) {
    const auto run = stop_once(*probe, accepted->epoch);
    if (!run) {
      return judge.broken(fmt::format("stop {}", i), run.error());
    }
    stops.push_back(run->stop_ms);
    frames.push_back(run->frame_ms);
  }
  const double p99 = quantile(stops, 0.99);
  const double frame_ms = quantile(frames, 0.5);
  if (frame_ms <= kFastLink_ms) {
    judge.require(p99 < kStopWithin_ms,
                  fmt::format("99 of 100 stops end within {:.1f} ms, promised are {}", p99, kStopWithin_ms));
  } else {
    judge.only_measured();
  }
  judge.measured(fmt::format(
      "p50 {:.1f} ms, p99 {:.1f} ms of {} stops; a frame of {} x {} pixels takes {:.1f} ms",
      quantile(stops, 0.5), p99, stops.size(), recipe.region_width, recipe.region_height, frame_ms));
}

void check_round_trip(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  judge.only_measured();
  std::vector<double> trips;
  const device::TimePoint end = probe->now() + std::chrono::seconds(10);
  while (trips.size() < kRoundTrips && probe->now() < end) {
    const device::TimePoint asked = probe->now();
    if (const auto status = probe->status(); !status) {
      return judge.broken("get_status", status.error());
    }
    trips.push_back(since(asked, probe->now()));
  }
  judge.measured(fmt::format("p50 {:.3f} ms, p99 {:.3f} ms of {} status requests", quantile(trips, 0.5),
                             quantile(trips, 0.99), trips.size()));
}

void check_throughput(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  constexpr std::uint32_t kFrameBytes = 64 * 1024;
  const protocol::SensorInfo& sensor = device->descriptor().sensor;
  protocol::Recipe recipe = small_recipe(device->descriptor());
  recipe.test_pattern = 1;
  recipe.exposures_us[0] = std::max<std::uint32_t>(sensor.min_exposure_us, 1);
  recipe.repeats = 8;
  recipe.region_x = 0;
  recipe.region_y = 0;
  recipe.region_width = sensor.width_px;
  recipe.region_height = static_cast<std::uint16_t>(
      std::clamp<std::uint32_t>(kFrameBytes / 2 / sensor.width_px, 1, sensor.height_px));
  judge.only_measured();
  const std::uint64_t before = device->link_statistics().bytes;
  const device::TimePoint started = device->now();
  const auto run = run_to_end(*device, recipe, subject);
  if (!run) {
    return judge.broken("a run of the test pattern", run.error());
  }
  const double seconds = since(started, device->now()) / 1000;
  const auto bytes = static_cast<double>(device->link_statistics().bytes - before);
  // A simulator's virtual link takes no time: only exposures and readouts do.
  judge.measured(
      fmt::format("{:.0f} bytes in {:.3f} s{}", bytes, seconds,
                  seconds > 0 ? fmt::format(": {:.3f} MB/s", bytes / seconds / 1e6) : std::string()));
}

void check_main_loop(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  const auto status = probe->status();
  if (!status) {
    return judge.broken("get_status", status.error());
  }
  judge.require(status->worst_poll_us < kWatchdog_us,
                fmt::format("a turn of the main loop took {} us, the watchdog may bite after {}",
                            status->worst_poll_us, kWatchdog_us));
  judge.measured(fmt::format("longest turn since boot {} us", status->worst_poll_us));
}

}  // namespace scatter::conformance
