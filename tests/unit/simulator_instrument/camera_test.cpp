#include <catch2/catch.hpp>

#include <algorithm>
#include <chrono>

#include "simulator/instrument/virtual_board.h"

using namespace scatter;
using namespace scatter::simulator;
using protocol::Target;

namespace {

std::unique_ptr<VirtualBoard> board_of(std::string_view query = "") {
  auto options = parse_instrument_options(query);
  REQUIRE(options.has_value());
  auto board = VirtualBoard::make(*options);
  REQUIRE(board.has_value());
  return std::move(*board);
}

constexpr firmware::SensorSettings kWindow{
    .x = 200, .y = 100, .width = 40, .height = 30, .exposure_us = 2000};

/// One exposure from trigger to release; the pixels of the window.
std::vector<std::uint16_t> expose(VirtualBoard& board, const firmware::SensorSettings& settings = kWindow) {
  Camera& camera = board.camera();
  REQUIRE(camera.trigger(settings));
  board.clock().advance_to(board.clock().since_power_on_us() + 1'000'000);
  std::vector<std::uint16_t> pixels(std::size_t{settings.width} * settings.height);
  REQUIRE(camera.read_rows(0, settings.height, pixels));
  camera.release();
  return pixels;
}

}  // namespace

TEST_CASE("A frame can be read when exposure and its rows' share of the readout are over, not before") {
  const auto board = board_of();
  Camera& camera = board->camera();
  VirtualClock& clock = board->clock();
  const protocol::SensorInfo& sensor = board->descriptor().sensor;
  clock.advance_to(123'456);
  CHECK(camera.state() == firmware::SensorState::kIdle);
  REQUIRE(camera.trigger(kWindow));
  // Readout of 30 of 480 rows at 16 ms per frame: 1 ms.
  REQUIRE(sensor.readout_us == 16'000);
  REQUIRE(sensor.height_px == 480);
  const std::uint64_t ready_at = 123'456 + 2000 + 1000;
  CHECK(camera.ready_at_us() == ready_at);
  std::vector<std::uint16_t> row(40);
  clock.advance_to(ready_at - 1);
  CHECK(camera.state() == firmware::SensorState::kExposing);
  CHECK_FALSE(camera.read_rows(0, 1, row));
  clock.advance_to(ready_at);
  CHECK(camera.state() == firmware::SensorState::kReady);
  CHECK(camera.read_rows(0, 1, row));
  camera.release();
  CHECK(camera.state() == firmware::SensorState::kIdle);
  CHECK(camera.scheduled_us() == 3000);
}

TEST_CASE("Rows come in rising order, once each, in any bands") {
  const auto whole = expose(*board_of());
  const auto board = board_of();
  REQUIRE(board->camera().trigger(kWindow));
  board->clock().advance_to(1'000'000);
  std::vector<std::uint16_t> pixels;
  for (std::uint16_t row = 0; row < kWindow.height;) {
    const auto count = static_cast<std::uint16_t>(std::min(7, kWindow.height - row));
    std::vector<std::uint16_t> band(std::size_t{count} * kWindow.width);
    REQUIRE(board->camera().read_rows(row, count, band));
    pixels.insert(pixels.end(), band.begin(), band.end());
    CHECK_FALSE(board->camera().read_rows(row, count, band));
    row = static_cast<std::uint16_t>(row + count);
  }
  CHECK(pixels == whole);
}

TEST_CASE("The sensor refuses what it cannot do") {
  const auto board = board_of();
  Camera& camera = board->camera();
  const protocol::SensorInfo& sensor = board->descriptor().sensor;
  auto changed = [](auto change) {
    firmware::SensorSettings settings = kWindow;
    change(settings);
    return settings;
  };
  CHECK_FALSE(camera.trigger(changed([](auto& s) { s.width = 0; })));
  CHECK_FALSE(camera.trigger(changed([](auto& s) { s.x = 441; })));
  CHECK_FALSE(camera.trigger(changed([](auto& s) { s.height = 381; })));
  CHECK_FALSE(camera.trigger(changed([&](auto& s) { s.exposure_us = sensor.min_exposure_us - 1; })));
  CHECK_FALSE(camera.trigger(changed([&](auto& s) { s.exposure_us = sensor.max_exposure_us + 1; })));
  CHECK(camera.trigger(kWindow));
  CHECK_FALSE(camera.trigger(kWindow));
  CHECK(camera.violations().trigger_refused == 6);
  CHECK_FALSE(camera.light(static_cast<std::uint8_t>(board->descriptor().illuminations.size())));
}

TEST_CASE("The lit LED reaches sensor and monitor; a dead one leaves both dark") {
  const auto mean = [](const std::vector<std::uint16_t>& pixels) {
    double sum = 0;
    for (const std::uint16_t pixel : pixels) {
      sum += pixel;
    }
    return sum / static_cast<double>(pixels.size());
  };
  const auto board = board_of("fault=led:1");
  const double black = mean(expose(*board));
  REQUIRE(board->camera().light(0));
  CHECK(mean(expose(*board)) > black + 20);
  // Nominal 500,000 uV, drift of some percent allowed.
  CHECK(board->camera().reading_uv() > 450'000);
  CHECK(board->camera().reading_uv() < 550'000);
  REQUIRE(board->camera().light(1));
  CHECK(mean(expose(*board)) < black + 1);
  CHECK(board->camera().reading_uv() < 50'000);
}

TEST_CASE("The stage settles in 300 ms and brings its target") {
  const auto board = board_of("sample=lambertian:0.05");
  Camera& camera = board->camera();
  REQUIRE(camera.light(0));
  const auto sample = expose(*board);
  const std::uint64_t start = board->clock().since_power_on_us();
  const std::uint64_t scheduled = camera.scheduled_us();
  REQUIRE(camera.move_to(Target::kWhiteReference));
  CHECK(camera.moving());
  CHECK(camera.settled_at_us() == start + 300'000);
  board->clock().advance_to(start + 300'000);
  CHECK_FALSE(camera.moving());
  CHECK(camera.scheduled_us() == scheduled + 300'000);
  const auto white = expose(*board);
  // White 0.99 against 0.05: every pixel is far brighter than the noise.
  CHECK(white[600] > 2 * sample[600]);
  CHECK_FALSE(camera.move_to(static_cast<Target>(5)));
}

TEST_CASE("Time that passes without exposures changes neither temperature nor pixels") {
  const auto busy = board_of();
  const auto lazy = board_of();
  lazy->clock().skip(3'600'000'000);
  CHECK(busy->camera().led_board_mK() == lazy->camera().led_board_mK());
  REQUIRE(busy->camera().light(0));
  REQUIRE(lazy->camera().light(0));
  CHECK(expose(*busy) == expose(*lazy));
  CHECK(expose(*busy) == expose(*lazy));
}

TEST_CASE("What a real board would punish is counted") {
  const auto board = board_of();
  REQUIRE(board->camera().light(0));
  REQUIRE(board->camera().trigger(kWindow));
  CHECK(board->camera().light(Camera::kNone));
  CHECK(board->camera().move_to(Target::kDarkCap));
  CHECK(board->camera().violations().light_changed_in_exposure == 1);
  CHECK(board->camera().violations().stage_moved_in_exposure == 1);
}

TEST_CASE("A failing readout is refused row by row, at its rate") {
  const auto board = board_of("fault=readout:0.25");
  int failed = 0;
  constexpr int kShots = 400;
  std::vector<std::uint16_t> row(40);
  for (int shot = 0; shot < kShots; ++shot) {
    REQUIRE(board->camera().trigger(kWindow));
    board->clock().advance_to(board->clock().since_power_on_us() + 10'000);
    failed += board->camera().read_rows(0, 1, row) ? 0 : 1;
    board->camera().release();
  }
  // 100 expected, standard deviation 8.7; six of them.
  CHECK(failed > 48);
  CHECK(failed < 152);
}

TEST_CASE("The watchdog wants a restart after five seconds without a kick") {
  const auto board = board_of();
  board->ports().watchdog.kick();
  board->clock().advance_to(5'000'000);
  CHECK_FALSE(board->restart_wanted().has_value());
  board->clock().advance_to(5'000'001);
  CHECK(board->restart_wanted() == protocol::ResetReason::kWatchdog);
}

TEST_CASE("By the real clock, computing light takes none of the instrument's time") {
  const auto board = board_of("clock=real");
  Camera& camera = board->camera();
  VirtualClock& clock = board->clock();
  const protocol::SensorInfo& sensor = board->descriptor().sensor;
  const firmware::SensorSettings whole{
      .x = 0, .y = 0, .width = sensor.width_px, .height = sensor.height_px, .exposure_us = 1000};
  REQUIRE(camera.trigger(whole));
  while (camera.state() != firmware::SensorState::kReady) {
  }
  std::vector<std::uint16_t> row(sensor.width_px);
  const auto began = std::chrono::steady_clock::now();
  const std::uint64_t before_us = clock.since_power_on_us();
  REQUIRE(camera.read_rows(0, 1, row));
  const std::uint64_t after_us = clock.since_power_on_us();
  const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - began;
  CHECK(static_cast<double>(after_us - before_us) < took.count() / 2);
}

TEST_CASE("A restart drops the link, the light and the clock, and keeps flash and warmth") {
  const auto board = board_of();
  board->link().attach();
  REQUIRE(board->camera().light(0));
  (void)expose(*board);
  REQUIRE(board->flash().program(0, std::vector<std::byte>(32)));
  REQUIRE(board->camera().trigger(kWindow));
  const std::int32_t warm = board->camera().led_board_mK();
  board->ports().reset.reboot();
  REQUIRE(board->restart_wanted() == protocol::ResetReason::kRequested);
  board->restart(protocol::ResetReason::kRequested);
  CHECK_FALSE(board->restart_wanted().has_value());
  CHECK_FALSE(board->link().connected());
  CHECK(board->camera().state() == firmware::SensorState::kIdle);
  CHECK(board->clock().now_us() == 0);
  CHECK(board->clock().since_power_on_us() > 0);
  CHECK(board->ports().reset.reason() == protocol::ResetReason::kRequested);
  CHECK(board->flash().bytes()[0] == std::byte{0});
  CHECK(board->camera().led_board_mK() == warm);
}

TEST_CASE("Without references the descriptor offers neither stage nor certificates") {
  const auto board = board_of("calibration=none");
  CHECK(board->descriptor().reference_stage == 0);
  CHECK(board->descriptor().certificates.empty());
  CHECK(board->ports().reference_stage == nullptr);
  CHECK(board_of()->descriptor().reference_stage == 1);
}

TEST_CASE("The serial number tells the seed; a fault names only LEDs that exist") {
  CHECK(board_of("seed=7")->descriptor().serial.str() == "SIM-00000007");
  const auto options = parse_instrument_options("fault=led:12");
  REQUIRE(options.has_value());
  const auto board = VirtualBoard::make(*options);
  REQUIRE_FALSE(board.has_value());
  CHECK(board.error().code == ErrorCode::kInvalidArgument);
  CHECK(board.error().remedy.find("led:11") != std::string::npos);
}
