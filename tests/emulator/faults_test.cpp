// What is wrong with a board or with its surroundings: the fault has a name and the device still answers.
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <optional>
#include <random>
#include <vector>

#include "tests/emulator/rig.h"

using namespace scatter;
using namespace scatter::emulator;

namespace {

const device::Wait kPatient{.timeout = std::chrono::seconds(30), .stop = {}};

protocol::Recipe one_led(std::uint8_t led, std::uint16_t repeats) {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(led);
  recipe.exposures_us.push_back(2000);
  recipe.repeats = repeats;
  recipe.region_width = recipe.region_height = 32;
  return recipe;
}

struct Run {
  std::vector<device::Frame> frames;
  std::vector<device::DeviceEvent> events;
  device::RunSummary summary;
};
Run run(device::Device& device, const protocol::Recipe& recipe) {
  const auto configured = device.configure(recipe, kPatient);
  if (!configured) {
    FAIL(configured.error().what);
  }
  auto stream = device.start({}, kPatient);
  REQUIRE(stream.has_value());
  Run run;
  while (true) {
    auto frame = stream->next(kPatient);
    if (!frame) {
      FAIL(frame.error().what);
    }
    if (!*frame) {
      break;
    }
    run.frames.push_back(std::move(**frame));
  }
  run.summary = stream->summary();
  run.events = device.take_events();
  for (const device::DeviceEvent& event : run.events) {
    UNSCOPED_INFO("the device said: " << event.text);
  }
  return run;
}

bool names(const Run& run, protocol::FaultCode fault) {
  return std::ranges::any_of(run.events, [&](const device::DeviceEvent& e) { return e.fault == fault; });
}

/// Sends bytes down the raw line, and takes what comes back.
void send_raw(simulator::EmulatedBoard& board, std::span<const std::byte> bytes) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  std::array<std::byte, 4096> answer;
  while (!bytes.empty() && std::chrono::steady_clock::now() < deadline) {
    pollfd line{board.uart0().number(), POLLIN | POLLOUT, 0};
    (void)::poll(&line, 1, 100);
    while (::recv(board.uart0().number(), answer.data(), answer.size(), MSG_DONTWAIT) > 0) {
    }
    const ssize_t sent = ::send(board.uart0().number(), bytes.data(),
                                std::min<std::size_t>(bytes.size(), 512), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(sent));
    }
  }
  REQUIRE(bytes.empty());
}

}  // namespace

TEST_CASE("After any bytes on the UART the device answers HELLO and measures") {
  std::mt19937 random(11);
  std::vector<std::byte> bytes(40'000);
  std::ranges::generate(bytes, [&] { return static_cast<std::byte>(random()); });
  // A part without zeros is one endless block to the decoder.
  std::ranges::replace(bytes.begin(), bytes.begin() + 8000, std::byte{0}, std::byte{1});
  Emulated emulated(board_options(), [&](simulator::EmulatedBoard& board) { send_raw(board, bytes); });
  device::Device device = emulated.open();
  const Run result = run(device, one_led(0, 3));
  CHECK(result.frames.size() == 3);
  const auto status = device.status(kPatient);
  REQUIRE(status.has_value());
  // Every block between two zeros of the noise was no frame, and was counted as one that was lost.
  CHECK(status->frames_bad_header + status->frames_bad_payload > 100);
}

TEST_CASE("Without its EEPROM the board says so, refuses to keep a calibration, and still measures") {
  auto options = board_options();
  options.eeprom = false;
  Emulated emulated(options);
  device::Device device = emulated.open();
  const auto status = device.status(kPatient);
  REQUIRE(status.has_value());
  CHECK(status->last_fault != static_cast<std::uint16_t>(protocol::FaultCode::kNone));
  CHECK_FALSE(device.set_key_value("name", "nowhere", kPatient).has_value());
  const auto begun = device.calibration_begin(kPatient);
  if (begun) {
    protocol::CalibrationManifest manifest;
    manifest.id.fill(1);
    CHECK_FALSE(device.calibration_commit(begun->session, manifest, kPatient).has_value());
    CHECK(device.calibration_end(begun->session, kPatient).has_value());
  }
  CHECK(run(device, one_led(0, 1)).frames.size() == 1);
}

TEST_CASE("A sensor that does not answer ends the run with a named fault, and the device answers on") {
  auto options = board_options();
  options.conduct.silent = true;
  Emulated emulated(options);
  device::Device device = emulated.open();
  const Run result = run(device, one_led(0, 5));
  CHECK(std::ranges::none_of(
      result.frames, [](const device::Frame& f) { return f.status == device::FrameStatus::kComplete; }));
  CHECK(names(result, protocol::FaultCode::kSensorTimeout));
  CHECK(result.summary.reason == protocol::RunEnd::kSensorFault);
  // The bench comes back to its senses: no restart is needed.
  emulated.board().conduct({});
  CHECK(run(device, one_led(0, 2)).frames.size() == 2);
}

TEST_CASE("Frames taken outside the temperatures of the specification carry a flag and name the fault") {
  auto options = board_options();
  options.conduct.temperature_shift_mK = 40'000;
  Emulated emulated(options);
  device::Device device = emulated.open();
  const Run result = run(device, one_led(0, 2));
  REQUIRE(result.frames.size() == 2);
  for (const device::Frame& frame : result.frames) {
    CHECK((frame.end.flags & protocol::kFrameTemperatureOut) != 0);
    CHECK(frame.begin.sensor_temperature_mK > 323'150);
  }
  CHECK(names(result, protocol::FaultCode::kTemperatureOutOfRange));
}

TEST_CASE("A dead LED is flagged in each of its frames and named") {
  Emulated emulated(board_options("fault=led:4"));
  device::Device device = emulated.open();
  const Run dark = run(device, one_led(4, 2));
  REQUIRE(dark.frames.size() == 2);
  for (const device::Frame& frame : dark.frames) {
    CHECK((frame.end.flags & protocol::kFrameMonitorLow) != 0);
  }
  CHECK(names(dark, protocol::FaultCode::kMonitorLow));
  const Run lit = run(device, one_led(3, 1));
  REQUIRE(lit.frames.size() == 1);
  CHECK((lit.frames[0].end.flags & protocol::kFrameMonitorLow) == 0);
}

TEST_CASE("A board that production forgot answers and refuses to measure") {
  auto options = board_options();
  options.factory_set = false;
  Emulated emulated(options);
  device::OpenOptions open;
  open.wait = kPatient;
  auto device = device::Device::open(emulated.uri(), open);
  if (device) {
    CHECK_FALSE(device->configure(one_led(0, 1), kPatient).has_value());
    const auto status = device->status(kPatient);
    CHECK(status.has_value());
  } else {
    // It answered HELLO and had no descriptor to give.
    CHECK(device.error().code != ErrorCode::kDeadlineExceeded);
    CHECK_FALSE(device.error().remedy.empty());
  }
}

TEST_CASE("A reboot ends the host's connection, and the next session finds why") {
  Emulated emulated(board_options());
  std::uint32_t boots = 0;
  {
    device::Device device = emulated.open();
    boots = device.hello().boot_count;
    REQUIRE(device.reboot(kPatient).has_value());
    // Until the connection ends, the restarted firmware may say that there is no session.
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    auto status = device.status(kPatient);
    while ((status || status.error().code != ErrorCode::kDisconnected) &&
           std::chrono::steady_clock::now() < deadline) {
      status = device.status(kPatient);
    }
    REQUIRE_FALSE(status.has_value());
    CHECK(status.error().code == ErrorCode::kDisconnected);
  }
  device::Device again = emulated.open_soon();
  CHECK(again.hello().boot_count == boots + 1);
  CHECK(again.hello().reset_reason == static_cast<std::uint8_t>(protocol::ResetReason::kRequested));
}
