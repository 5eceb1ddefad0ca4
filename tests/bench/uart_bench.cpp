// The protocol over the emulated board's UART, against what that line itself can do with a program that only
// moves bytes (tests/firmware_arm/raw_uart_image.cpp). One board after the other in the same run: both want a
// core.
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <optional>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "host_sdk/device/device.h"
#include "host_sdk/firmware_files/signing.h"
#include "protocol/endian.h"
#include "simulator/emulator/board_state.h"
#include "simulator/emulator/emulated_board.h"
#include "simulator/instrument/server.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_folder.h"

namespace {

using namespace scatter;
using bench::Figure;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t kBytesToHost = 600'000;
constexpr std::uint32_t kBytesToDevice = 60'000;
constexpr int kRoundTrips = 300;
/// Of the serial line: a clock_sync request and its reply are 38 and 46 bytes.
constexpr std::uint32_t kEchoBytes = 42;
const device::Wait kPatient{.timeout = std::chrono::seconds(120), .stop = {}};

double seconds(const std::function<bool()>& work, bool& good) {
  const auto start = Clock::now();
  good = work() && good;
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct RoundTrips {
  double p50_us = 0;
  double p99_us = 0;
};
RoundTrips round_trips(const std::function<bool()>& once, bool& good) {
  std::vector<double> all;
  for (int k = 0; k < kRoundTrips; ++k) {
    all.push_back(1e6 * seconds(once, good));
  }
  std::ranges::sort(all);
  return {all[all.size() / 2], all[all.size() * 99 / 100]};
}

struct Line {
  double to_host_B_s = 0;
  double to_device_B_s = 0;
  RoundTrips trips;
};

/// The line with a program that moves bytes and nothing else.
class RawBoard {
 public:
  explicit RawBoard(simulator::QemuProcess& process) : line_(process.uart0().number()) {}
  [[nodiscard]] bool send(std::span<const std::byte> bytes) const {
    while (!bytes.empty()) {
      pollfd file{line_, POLLOUT, 0};
      const ssize_t count =
          ::poll(&file, 1, 60'000) > 0 ? ::send(line_, bytes.data(), bytes.size(), MSG_NOSIGNAL) : -1;
      if (count <= 0) {
        return false;
      }
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
    return true;
  }
  [[nodiscard]] bool receive(std::size_t count) const {
    std::array<std::byte, 16'384> bytes;
    while (count > 0) {
      pollfd file{line_, POLLIN, 0};
      const ssize_t got =
          ::poll(&file, 1, 60'000) > 0 ? ::recv(line_, bytes.data(), std::min(bytes.size(), count), 0) : -1;
      if (got <= 0) {
        return false;
      }
      count -= static_cast<std::size_t>(got);
    }
    return true;
  }
  [[nodiscard]] bool command(char letter, std::uint32_t count, std::uint32_t payload,
                             std::size_t answer) const {
    std::vector<std::byte> bytes(5 + payload);
    bytes[0] = static_cast<std::byte>(letter);
    protocol::store_le(bytes.data() + 1, count);
    return send(bytes) && receive(answer);
  }

 private:
  int line_;
};

std::optional<Line> raw_line(const std::filesystem::path& image) {
  auto state = simulator::BoardState::open({});
  if (!state) {
    return std::nullopt;
  }
  auto process = simulator::QemuProcess::start(
      {.kernel = image, .shared_memory = state->shared_memory_file(), .eeprom = state->eeprom_file()});
  if (!process || !process->resume()) {
    return std::nullopt;
  }
  const RawBoard board(*process);
  bool good = board.command('E', 1, 1, 1);  // It runs.
  Line line;
  line.to_host_B_s =
      kBytesToHost / seconds([&] { return board.command('T', kBytesToHost, 0, kBytesToHost); }, good);
  line.to_device_B_s =
      kBytesToDevice / seconds([&] { return board.command('R', kBytesToDevice, kBytesToDevice, 1); }, good);
  line.trips = round_trips([&] { return board.command('E', kEchoBytes, kEchoBytes, kEchoBytes); }, good);
  return good ? std::optional(line) : std::nullopt;
}

/// Frames of the counter pattern, as large as the sensor: hardly a pause for exposures.
bool stream_pattern(device::Device& device, std::uint64_t& bytes) {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(10);
  recipe.repeats = 2;
  recipe.test_pattern = 1;
  recipe.pixel_format = protocol::PixelFormat::kMono10p;
  if (!device.configure(recipe, kPatient)) {
    return false;
  }
  auto stream = device.start({}, kPatient);
  while (stream) {
    const auto frame = stream->next(kPatient);
    if (!frame || !*frame) {
      return frame.has_value();
    }
    bytes += (*frame)->size_bytes;
  }
  return false;
}

std::optional<Line> protocol_line(const simulator::FirmwareFiles& files,
                                  const std::filesystem::path& socket) {
  auto board = simulator::EmulatedBoard::start({.bootloader = files.bootloader, .firmware = files.firmware});
  if (!board) {
    return std::nullopt;
  }
  auto server = simulator::Server::listen("unix:" + socket.string(), **board);
  if (!server) {
    return std::nullopt;
  }
  const std::jthread thread([&](const std::stop_token& stop) { (void)(*server)->serve(stop); });
  device::OpenOptions open;
  open.wait = kPatient;
  auto device = device::Device::open((*server)->address(), open);
  const auto package = firmware_files::Package::load(files.firmware);
  if (!device || !package) {
    return std::nullopt;
  }
  bool good = true;
  Line line;
  std::uint64_t bytes = 0;
  const double streamed = seconds([&] { return stream_pattern(*device, bytes); }, good);
  line.to_host_B_s = static_cast<double>(bytes) / streamed;
  line.trips = round_trips([&] { return device->clock_sync(kPatient).has_value(); }, good);
  const firmware_files::Image& image = package->image(1);
  const auto update = device->update_status(kPatient);
  good = good && update && device->update_begin(firmware_files::header_bytes(image.header), kPatient);
  if (!good) {
    return std::nullopt;
  }
  const auto body = std::span(image.body).first(std::min<std::size_t>(image.body.size(), kBytesToDevice));
  const device::UpdatePieces pieces{.piece_bytes = update->chunk_bytes};
  const double written =
      seconds([&] { return device->update_write(0, body, pieces, kPatient).has_value(); }, good);
  line.to_device_B_s = static_cast<double>(body.size()) / written;
  return good ? std::optional(line) : std::nullopt;
}

std::vector<Figure> run() {
  const auto files = simulator::find_firmware();
  const std::filesystem::path image = SCATTER_FIRMWARE_BUILD "/bin/test_raw_uart.elf";
  if (!files || !std::filesystem::exists(image)) {
    std::fprintf(stderr, "uart: skipped: ./run firmware has not made the images\n");
    return {};
  }
  const bench::BenchFolder folder(fmt::format("scatter-uart-bench-{}", ::getpid()));
  std::vector<double> ours[4];
  std::vector<double> theirs[4];
  for (int round = 0; round < 3; ++round) {
    const auto raw = raw_line(image);
    const auto line = protocol_line(*files, folder.file("host.sock"));
    if (!raw || !line) {
      std::fprintf(stderr, "uart: skipped: QEMU or the board did not run\n");
      return {};
    }
    const auto add = [](const Line& from, std::vector<double>(&to)[4]) {
      to[0].push_back(from.to_host_B_s / 1e6);
      to[1].push_back(from.to_device_B_s / 1e6);
      to[2].push_back(from.trips.p50_us);
      to[3].push_back(from.trips.p99_us);
    };
    add(*line, ours);
    add(*raw, theirs);
  }
  using bench::Better;
  const auto figure = [&](const char* name, int k, const char* unit, const char* peer, Better better) {
    return bench::make_figure(name, bench::median(ours[k]), unit, peer, bench::median(theirs[k]), better);
  };
  return {figure("uart.pixels_to_host", 0, "MB/s", "raw UART", Better::kHigher),
          figure("uart.update_to_device", 1, "MB/s", "raw UART", Better::kHigher),
          figure("uart.round_trip_p50", 2, "us", "raw echo", Better::kLower),
          figure("uart.round_trip_p99", 3, "us", "raw echo", Better::kLower)};
}

const bench::Benchmark kUart{"uart", run};

}  // namespace
