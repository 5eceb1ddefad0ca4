// One instrument in this process and the same one behind a socket; its hosts, honest and otherwise.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <random>

#include "tests/integration/rig.h"

using namespace scatter;
using namespace scatter::integration;
using device::Device;

namespace {

std::string socket_path(std::string_view name) {
  return (std::filesystem::temp_directory_path() /
          ("scatter_" + std::string(name) + "_" + std::to_string(::getpid()) + ".sock"))
      .string();
}

Device open_known(const std::string& uri, const std::string& host_name = "test") {
  auto device = open_uri(uri, nullptr, host_name);
  if (!device) {
    FAIL(device.error().what);
  }
  return std::move(*device);
}

/// A peer that speaks no protocol at all.
class RawSocket {
 public:
  explicit RawSocket(const std::string& path) : number_(::socket(AF_UNIX, SOCK_STREAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    REQUIRE(path.size() < sizeof address.sun_path);
    std::memcpy(address.sun_path, path.data(), path.size());
    REQUIRE(::connect(number_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  }
  ~RawSocket() { ::close(number_); }
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;
  void send(std::span<const std::byte> bytes) const {
    REQUIRE(::send(number_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size()));
  }
  /// True when the server has closed.
  [[nodiscard]] bool closed_by_server() const {
    std::byte byte{};
    ssize_t count = 0;
    while ((count = ::recv(number_, &byte, 1, 0)) > 0) {
    }
    return count == 0;
  }

 private:
  int number_;
};

/// A carrier that goes away without a word, as a killed program's does.
class Vanishing final : public device::Transport {
 public:
  Vanishing(std::unique_ptr<device::Transport> inner, std::shared_ptr<bool> gone)
      : inner_(std::move(inner)), gone_(std::move(gone)) {}
  Result<std::span<const std::byte>> receive(device::TimePoint deadline,
                                             const std::stop_token& stop) override {
    vanish_if_told();
    return inner_->receive(deadline, stop);
  }
  Status write(std::span<const std::byte> bytes, device::TimePoint deadline,
               const std::stop_token& stop) override {
    vanish_if_told();
    return inner_->write(bytes, deadline, stop);
  }
  device::TimePoint now() const override { return inner_->now(); }
  std::uint64_t system_time_unix_ns() const override { return inner_->system_time_unix_ns(); }
  void close() noexcept override { inner_->close(); }

 private:
  void vanish_if_told() {
    if (*gone_) {
      inner_->close();
    }
  }
  std::unique_ptr<device::Transport> inner_;
  std::shared_ptr<bool> gone_;
};

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

}  // namespace

TEST_CASE("The same seed gives the same frames in process and over a socket, clock readings aside") {
  constexpr std::string_view kQuery = "sample=ggx:alpha=0.2,f0=0.04,albedo=0.3&seed=42";
  const auto instrument = instrument_of(kQuery);
  auto local = open_on(instrument);
  REQUIRE(local.has_value());
  const Outcome near = run(*local, light_recipe());
  Served served(kQuery, "unix:" + socket_path("equal"));
  Device remote = open_known(served.address());
  const Outcome far = run(remote, light_recipe());

  CHECK(local->descriptor() == remote.descriptor());
  REQUIRE_FALSE(near.error.has_value());
  REQUIRE_FALSE(far.error.has_value());
  REQUIRE(near.frames.size() == 10);
  REQUIRE(far.frames.size() == 10);
  for (std::size_t i = 0; i < near.frames.size(); ++i) {
    INFO("frame " << i);
    const protocol::FrameBegin& a = near.frames[i].begin;
    const protocol::FrameBegin& b = far.frames[i].begin;
    CHECK(near.frames[i].status == device::FrameStatus::kComplete);
    CHECK(far.frames[i].status == device::FrameStatus::kComplete);
    CHECK(a.frame_id == b.frame_id);
    CHECK(a.kind == b.kind);
    CHECK(a.illumination == b.illumination);
    CHECK(a.exposure_us == b.exposure_us);
    CHECK(a.monitor_uv == b.monitor_uv);
    CHECK(a.sensor_temperature_mK == b.sensor_temperature_mK);
    CHECK(a.led_temperature_mK == b.led_temperature_mK);
    CHECK(near.frames[i].end.saturated_pixels == far.frames[i].end.saturated_pixels);
    CHECK(near.frames[i].end.frame_crc == far.frames[i].end.frame_crc);
    CHECK(std::ranges::equal(near.frames[i].bytes(), far.frames[i].bytes()));
  }
}

TEST_CASE("A second host is told who holds the instrument, and the first notices nothing") {
  Served served("", "tcp:127.0.0.1:0");
  {
    Device first = open_known(served.address(), "the first host");
    REQUIRE(first.configure(pattern_recipe(200)).has_value());
    auto stream = first.start();
    REQUIRE(stream.has_value());
    std::size_t complete = 0;
    for (int i = 0;; ++i) {
      if (i == 20 || i == 120) {
        const auto second = open_uri(served.address(), nullptr, "the second host");
        REQUIRE_FALSE(second.has_value());
        CHECK(second.error().code == ErrorCode::kBusy);
        CHECK(second.error().what.find("the first host") != std::string::npos);
        CHECK_FALSE(second.error().remedy.empty());
      }
      const auto frame = stream->next();
      REQUIRE(frame.has_value());
      if (!*frame) {
        break;
      }
      complete += (*frame)->status == device::FrameStatus::kComplete && wrong_pixels(**frame) == 0 ? 1 : 0;
    }
    CHECK(complete == 200);
    CHECK(stream->summary().ledger.delivered == 200);
  }
  // Free again as soon as the first has gone.
  std::optional<Device> third;
  for (int attempt = 0; attempt < 50 && !third; ++attempt) {
    if (auto device = Device::open(served.address())) {
      third.emplace(std::move(*device));
    } else {
      CHECK(device.error().code == ErrorCode::kBusy);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  CHECK(third.has_value());
  third.reset();
  served.stop();
  CHECK(served.statistics().hosts >= 2);
  CHECK(served.statistics().turned_away >= 2);
}

TEST_CASE("A peer that sends garbage gets nowhere, and the next host finds the instrument in order") {
  const std::string path = socket_path("garbage");
  Served served("", "unix:" + path);
  {
    const RawSocket peer(path);
    std::mt19937 random(1);
    std::vector<std::byte> garbage(100'000);
    for (std::byte& byte : garbage) {
      byte = static_cast<std::byte>(random());
    }
    peer.send(garbage);
    // Half a frame header at the end, so that the decoder is left waiting.
    peer.send(std::vector<std::byte>{std::byte{0xA7}, std::byte{0x5C}, std::byte{1}});
  }
  std::optional<Device> device;
  for (int attempt = 0; attempt < 50 && !device; ++attempt) {
    if (auto opened = Device::open(served.address())) {
      device.emplace(std::move(*opened));
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  REQUIRE(device.has_value());
  const Outcome outcome = run(*device, pattern_recipe(20));
  CHECK_FALSE(outcome.error.has_value());
  CHECK(outcome.complete == 20);
  CHECK(outcome.wrong == 0);
}

TEST_CASE("A host that vanishes in a run leaves the instrument stopped and free") {
  Served served("", "unix:" + socket_path("vanish"));
  const device::TransportRegistry registry;
  {
    auto gone = std::make_shared<bool>(false);
    auto carrier = registry.open(served.address());
    REQUIRE(carrier.has_value());
    auto device = Device::open(std::make_unique<Vanishing>(std::move(*carrier), gone));
    REQUIRE(device.has_value());
    REQUIRE(device->configure(pattern_recipe(1000)).has_value());
    auto stream = device->start();
    REQUIRE(stream.has_value());
    REQUIRE(stream->next().has_value());
    *gone = true;
  }
  std::optional<Device> next;
  for (int attempt = 0; attempt < 50 && !next; ++attempt) {
    if (auto device = Device::open(served.address())) {
      next.emplace(std::move(*device));
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  REQUIRE(next.has_value());
  CHECK(next->hello().run_state == static_cast<std::uint8_t>(protocol::RunState::kIdle));
  const Outcome outcome = run(*next, pattern_recipe(20));
  CHECK_FALSE(outcome.error.has_value());
  CHECK(outcome.complete == 20);
  CHECK(outcome.wrong == 0);
}

TEST_CASE("A stopped server closes its host's connection and takes its socket file away") {
  const std::string path = socket_path("stop");
  Served served("", "unix:" + path);
  const RawSocket peer(path);
  // The server must have accepted before it stops, or the close is the kernel's.
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const auto start = std::chrono::steady_clock::now();
  served.stop();
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(1));
  CHECK(peer.closed_by_server());
  CHECK_FALSE(std::filesystem::exists(path));
  const auto device = Device::open("unix:" + path);
  REQUIRE_FALSE(device.has_value());
  CHECK_FALSE(device.error().remedy.empty());
}

TEST_CASE("A served instrument with a real clock takes the time that it says") {
  Served served("clock=real", "unix:" + socket_path("real"));
  Device device = open_known(served.address());
  const auto start = std::chrono::steady_clock::now();
  const Outcome outcome = run(device, pattern_recipe(20));
  const auto took = std::chrono::steady_clock::now() - start;
  REQUIRE_FALSE(outcome.error.has_value());
  CHECK(outcome.complete == 20);
  // 20 exposures of 1 ms, each with its rows' share of the 16 ms readout: at least 60 ms.
  CHECK(outcome.summary.ended_us - outcome.summary.started_us >= 60'000);
  CHECK(took >= std::chrono::milliseconds(60));
}
