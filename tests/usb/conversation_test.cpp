// Whole conversations over real libusb: what arrives, that nothing is lost, and that the bus is left as it
// was.
#include <sys/resource.h>

#include <algorithm>

#include "host_sdk/device/usb/bus_scan.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using device::Device;
using integration::Outcome;

namespace {

/// Of the instrument that ctest plugs in (CMakeLists.txt).
constexpr std::string_view kQuery = "sample=ggx:alpha=0.2,f0=0.04,albedo=0.3&seed=42";

protocol::Recipe light_recipe() {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(1);
  recipe.illuminations.push_back(5);
  recipe.exposures_us.push_back(500);
  recipe.exposures_us.push_back(3000);
  recipe.repeats = 2;
  recipe.off_frames = 1;
  recipe.pixel_format = protocol::PixelFormat::kMono10p;
  return recipe;
}

double cpu_ms() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto ms = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) * 1e3 + static_cast<double>(time.tv_usec) / 1e3;
  };
  return ms(usage.ru_utime) + ms(usage.ru_stime);
}

}  // namespace

// The first to run: the instrument is as it was switched on.
TEST_CASE("01 The same seed gives the same frames over USB as in process, clock readings aside") {
  const auto instrument = integration::instrument_of(kQuery);
  auto local = integration::open_on(instrument);
  REQUIRE(local.has_value());
  const Outcome near = integration::run(*local, light_recipe());
  Host host;
  Device remote = host.open();
  const Outcome far = integration::run(remote, light_recipe());

  CHECK(local->descriptor() == remote.descriptor());
  REQUIRE_FALSE(near.error.has_value());
  REQUIRE_FALSE(far.error.has_value());
  REQUIRE(near.frames.size() == 10);
  REQUIRE(far.frames.size() == 10);
  for (std::size_t k = 0; k < near.frames.size(); ++k) {
    INFO("frame " << k);
    const protocol::FrameBegin& a = near.frames[k].begin;
    const protocol::FrameBegin& b = far.frames[k].begin;
    CHECK(near.frames[k].status == device::FrameStatus::kComplete);
    CHECK(far.frames[k].status == device::FrameStatus::kComplete);
    CHECK(a.frame_id == b.frame_id);
    CHECK(a.kind == b.kind);
    CHECK(a.illumination == b.illumination);
    CHECK(a.exposure_us == b.exposure_us);
    CHECK(a.monitor_uv == b.monitor_uv);
    CHECK(near.frames[k].end.saturated_pixels == far.frames[k].end.saturated_pixels);
    CHECK(near.frames[k].end.frame_crc == far.frames[k].end.frame_crc);
    CHECK(std::ranges::equal(near.frames[k].bytes(), far.frames[k].bytes()));
  }
  CHECK(far.summary.ledger.balances());
}

TEST_CASE("Fifty short measurements in a row lose nothing, and every ledger balances") {
  Host host;
  Device device = host.open();
  for (int k = 0; k < 50; ++k) {
    INFO("measurement " << k);
    check_whole(integration::run(device, integration::pattern_recipe(1)), 1);
  }
}

TEST_CASE("The whole sensor's test pattern comes through bit for bit") {
  Host host;
  Device device = host.open();
  const auto report = device.self_test();
  REQUIRE(report.has_value());
  CHECK(report->frames == 4);
  CHECK(report->wrong_pixels == 0);
  CHECK(report->pixels > 0);
}

TEST_CASE("At least sixteen transfers are under way while frames come, and none when the device is closed") {
  Host host;
  {
    Device device = host.open();
    check_whole(integration::run(device, integration::pattern_recipe(100)), 100);
    CHECK(host.bus().statistics()["most_under_way"] >= 16);
  }
  CHECK(host.bus().statistics()["under_way"] == 0);
  CHECK(host.bus().statistics()["abandoned"] == 0);
}

TEST_CASE("A frame's pixels are copied at most once on their way from the bus to the caller") {
  Host host;
  Device device = host.open();
  const Outcome outcome = integration::run(device, integration::pattern_recipe(50));
  check_whole(outcome, 50);
  // Frames that lie whole in one transfer are not put together, so the pixels' way into their frame is the
  // only one.
  CHECK(outcome.summary.link.copied_bytes == 0);
}

TEST_CASE("A program that holds an instrument open and does nothing sleeps") {
  Host host;
  Device device = host.open();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const double before = cpu_ms();
  const std::uint64_t reaps = host.bus().statistics()["empty_reaps"];
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  CHECK(cpu_ms() - before < 25);  // 5 % of one processor.
  CHECK(host.bus().statistics()["empty_reaps"] - reaps < 10);
}

TEST_CASE("An instrument can be opened, closed and opened again, a hundred times") {
  Host host;
  for (int k = 0; k < 100; ++k) {
    Device device = host.open();
    REQUIRE(device.status().has_value());
  }
}

TEST_CASE("The bus scan sees the instrument, and says whether a program uses it, without opening anything") {
  Host host;
  const std::uint64_t opened = host.bus().statistics()["opened"];
  const auto idle = device::usb::scan_bus();
  CHECK(host.bus().statistics()["opened"] == opened);
  REQUIRE(idle.size() == 1);
  CHECK(idle.front().ours);
  CHECK(idle.front().rescue_interface);
  CHECK_FALSE(idle.front().dfu_mode);
  CHECK_FALSE(idle.front().in_use);
  CHECK(idle.front().serial == "SIM-0000002a");
  CHECK(idle.front().speed_mbps == 480);
  CHECK(idle.front().port == "1-1");
  CHECK(idle.front().hidraw.size() == 1);
  Device device = host.open("usb:serial=SIM-0000002a");
  const std::uint64_t while_open = host.bus().statistics()["opened"];
  const auto used = device::usb::scan_bus();
  CHECK(host.bus().statistics()["opened"] == while_open);
  REQUIRE(used.size() == 1);
  CHECK(used.front().in_use);
}
