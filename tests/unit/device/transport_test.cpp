#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "host_sdk/device/discovery.h"
#include "host_sdk/device/socket_transport.h"
#include "host_sdk/device/transport.h"
#include "tests/unit/device/scripted_device.h"

namespace scatter::device::test {
namespace {

using namespace std::chrono_literals;

TEST_CASE("URIs fall into scheme, place and query; sample specs pass untouched") {
  const auto sim = parse_uri("SIM:?sample=ggx:alpha=0.2,f0=0.04+tilt=1.0@30&seed=7");
  REQUIRE(sim);
  CHECK(sim->scheme == "sim");
  CHECK(sim->place.empty());
  CHECK(sim->query == "sample=ggx:alpha=0.2,f0=0.04+tilt=1.0@30&seed=7");
  CHECK(parse_uri("tcp:127.0.0.1:7000")->place == "127.0.0.1:7000");
  CHECK(parse_uri("unix:/run/a b.sock")->text() == "unix:/run/a b.sock");
  for (const char* bad : {"", "nothing", ":x", "a b:c", "/dev/tty:1"}) {
    const auto uri = parse_uri(bad);
    REQUIRE_FALSE(uri);
    CHECK(uri.error().code == ErrorCode::kInvalidArgument);
    CHECK_FALSE(uri.error().remedy.empty());
  }
}

TEST_CASE("Host and port are checked before anything is opened") {
  CHECK(parse_host_port("localhost:7000")->host == "localhost");
  CHECK(parse_host_port("[::1]:7000")->host == "::1");
  for (const char* bad :
       {"localhost", ":7000", "localhost:", "localhost:0", "localhost:65536", "h:7x", "::1:7000"}) {
    REQUIRE_FALSE(parse_host_port(bad));
    CHECK(parse_host_port(bad).error().code == ErrorCode::kInvalidArgument);
  }
}

TEST_CASE("An unknown scheme lists the known ones; reserved ones say that they are not built in yet") {
  TransportRegistry registry;
  registry.add({"sim", "sim:", "in this program", {}});
  const auto unknown = registry.open("gpib:7");
  REQUIRE_FALSE(unknown);
  CHECK(unknown.error().code == ErrorCode::kInvalidArgument);
  for (const char* known : {"tcp:", "unix:", "replay:", "sim:"}) {
    CHECK(unknown.error().remedy.find(known) != std::string::npos);
  }
  CHECK(registry.open("usb:").error().code == ErrorCode::kUnimplemented);
  CHECK(registry.open("serial:/dev/ttyACM0").error().code == ErrorCode::kUnimplemented);
}

TEST_CASE("Places where nobody is are told at once, with a remedy") {
  const TransportRegistry registry;
  const auto start = std::chrono::steady_clock::now();
  CHECK(registry.open("unix:/nowhere/at/all.sock").error().code == ErrorCode::kNotFound);
  CHECK(registry.open("tcp:127.0.0.1:1").error().code == ErrorCode::kUnavailable);
  CHECK(registry.open("replay:/nowhere.scat").error().code == ErrorCode::kNotFound);
  CHECK(registry.open("replay:").error().code == ErrorCode::kInvalidArgument);
  CHECK(registry.open("unix:").error().code == ErrorCode::kInvalidArgument);
  CHECK(std::chrono::steady_clock::now() - start < 2s);
}

struct SocketPair {
  int peer = -1;
  std::unique_ptr<Transport> host;
  SocketPair() {
    int both[2];
    REQUIRE(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, both) == 0);
    peer = both[0];
    host = adopt_socket(both[1]);
  }
  ~SocketPair() {
    if (peer >= 0) {
      ::close(peer);
    }
  }
  SocketPair(const SocketPair&) = delete;
  SocketPair& operator=(const SocketPair&) = delete;
};

TEST_CASE("Waits for a socket end at their deadline, on a stop request, and when the peer is gone") {
  SocketPair pair;
  Bytes room(100);
  const auto timed = [&](const std::function<void()>& act) {
    const auto start = std::chrono::steady_clock::now();
    act();
    return std::chrono::steady_clock::now() - start;
  };
  CHECK(timed([&] {
          CHECK(pair.host->receive(pair.host->now() + 50ms, {}).error().code == ErrorCode::kDeadlineExceeded);
        }) < 500ms);
  std::stop_source source;
  const std::jthread stopper([&] {
    std::this_thread::sleep_for(30ms);
    source.request_stop();
  });
  CHECK(timed([&] {
          CHECK(pair.host->receive(pair.host->now() + 30s, source.get_token()).error().code ==
                ErrorCode::kAborted);
        }) < 1s);
  REQUIRE(::write(pair.peer, "abc", 3) == 3);
  CHECK(pair.host->receive(pair.host->now() + 1s, {}).value().size() == 3);
  ::close(pair.peer);
  pair.peer = -1;
  CHECK(pair.host->receive(pair.host->now() + 1s, {}).error().code == ErrorCode::kDisconnected);
  CHECK(pair.host->write(room, pair.host->now() + 1s, {}).error().code == ErrorCode::kDisconnected);
}

TEST_CASE("A peer that never reads ends write() at its deadline") {
  const SocketPair pair;
  const Bytes much(64 << 20);
  CHECK(pair.host->write(much, pair.host->now() + 100ms, {}).error().code == ErrorCode::kDeadlineExceeded);
}

TEST_CASE("A server that accepts and stays silent ends open() at its deadline") {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("scatter-silent-" + std::to_string(::getpid()))).string();
  const int server = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  REQUIRE(path.size() < sizeof address.sun_path);
  path.copy(address.sun_path, path.size());
  REQUIRE(::bind(server, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
  REQUIRE(::listen(server, 4) == 0);
  OpenOptions options;
  options.wait.timeout = 200ms;
  const auto start = std::chrono::steady_clock::now();
  const Result<Device> device = Device::open("unix:" + path, options);
  REQUIRE_FALSE(device);
  CHECK(device.error().code == ErrorCode::kDeadlineExceeded);
  CHECK(std::chrono::steady_clock::now() - start < 2s);

  ::setenv("SCATTER_URIS", ("unix:" + path + " replay:/nowhere.scat").c_str(), 1);
  const std::vector<Listing> found = list_devices(TransportRegistry(), {.timeout = 50ms, .stop = {}});
  ::unsetenv("SCATTER_URIS");
  REQUIRE(found.size() == 2);
  CHECK(found[0].state == Listing::State::kUnreachable);
  CHECK_FALSE(found[0].remedy.empty());
  CHECK(found[1].state == Listing::State::kUnreachable);
  ::close(server);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace scatter::device::test
