// The whole walk on a Cortex-M7: boot, calibrate, measure through the UART; and the same in this process.
#include <algorithm>
#include <memory>
#include <vector>

#include "host_sdk/device/recording_reader.h"
#include "host_sdk/measurement/measure.h"
#include "simulator/instrument/virtual_instrument.h"
#include "simulator/samples/sample.h"
#include "tests/emulator/rig.h"
#include "tools/sim_scheme/sim_scheme.h"

using namespace scatter;
using namespace scatter::emulator;

namespace {

constexpr std::string_view kGgx = "ggx:alpha=0.2,f0=0.04,albedo=0.3";

std::shared_ptr<const simulator::Sample> sample(std::string_view spec) {
  auto made = simulator::Sample::make(std::string(spec));
  REQUIRE(made.has_value());
  return *made;
}

measurement::MeasureResult measure(device::Device& device, const std::filesystem::path& recording,
                                   std::shared_ptr<const measurement::ReferenceSet> references) {
  measurement::MeasureOptions options;
  options.recording = recording;
  options.references = std::move(references);
  options.use_library = false;
  // Enough for a UART: a budget that runs out would make exposures depend on the clock.
  options.time_budget_ms = 60'000;
  options.repeats = 2;
  auto result = measurement::measure(device, options);
  if (!result) {
    FAIL(result.error().what);
  }
  return std::move(*result);
}

std::vector<device::Frame> frames_of(const std::filesystem::path& recording) {
  auto reader = device::RecordingReader::open(recording);
  REQUIRE(reader.has_value());
  std::vector<device::Frame> frames;
  REQUIRE(reader
              ->for_each_frame([&](std::size_t, const device::Frame& frame) -> Status {
                frames.push_back(frame);
                return {};
              })
              .has_value());
  return frames;
}

/// Everything but readings of the device's clock and names made from the host's.
protocol::FrameBegin without_clocks(protocol::FrameBegin begin) {
  begin.exposure_start_us = 0;
  begin.calibration_id = {};
  return begin;
}
protocol::FrameEnd without_clocks(protocol::FrameEnd end) {
  end.readout_end_us = 0;
  return end;
}

template <typename M>
std::vector<std::byte> encoded(const M& message) {
  std::vector<std::byte> bytes(protocol::encoded_size(message));
  REQUIRE(protocol::encode(message, std::span(bytes)).has_value());
  return bytes;
}

void check_same(const std::filesystem::path& here, const std::filesystem::path& there) {
  const auto expected = frames_of(here);
  const auto got = frames_of(there);
  REQUIRE(expected.size() > 20);
  REQUIRE(got.size() == expected.size());
  for (std::size_t k = 0; k < got.size(); ++k) {
    INFO("frame " << k);
    CHECK(got[k].status == device::FrameStatus::kComplete);
    CHECK(std::ranges::equal(got[k].bytes(), expected[k].bytes()));
    CHECK(encoded(without_clocks(got[k].begin)) == encoded(without_clocks(expected[k].begin)));
    CHECK(encoded(without_clocks(got[k].end)) == encoded(without_clocks(expected[k].end)));
  }
}

}  // namespace

TEST_CASE("The Cortex-M7 gives the pixels and metadata that the firmware gives on this computer") {
  const Folder folder;
  auto options = board_options("seed=3&sample=lambertian:0.5");
  options.instrument.clock = simulator::ClockMode::kVirtual;
  Emulated emulated(options);
  auto instrument = simulator::VirtualInstrument::make(options.instrument);
  REQUIRE(instrument.has_value());
  const std::shared_ptr<simulator::VirtualInstrument> twin = std::move(*instrument);
  device::Device board = emulated.open();
  auto opened = device::Device::open(tools::make_sim_transport(twin));
  REQUIRE(opened.has_value());
  device::Device here = std::move(*opened);

  const auto board_lambertian = measure(board, folder / "board_lambertian.scat", nullptr);
  const auto here_lambertian = measure(here, folder / "here_lambertian.scat", nullptr);
  check_same(folder / "here_lambertian.scat", folder / "board_lambertian.scat");
  REQUIRE(board_lambertian.calibration.has_value());
  REQUIRE(here_lambertian.calibration.has_value());
  REQUIRE(board_lambertian.measurement.has_value());

  emulated.board().put(sample(kGgx));
  REQUIRE(twin->put(sample(kGgx)).has_value());
  const auto board_ggx = measure(board, folder / "board_ggx.scat", board_lambertian.calibration->references);
  const auto here_ggx = measure(here, folder / "here_ggx.scat", here_lambertian.calibration->references);
  check_same(folder / "here_ggx.scat", folder / "board_ggx.scat");
  CHECK(board_ggx.measurement.has_value());
  CHECK(emulated.board().statistics().bench.refused == 0);
}
