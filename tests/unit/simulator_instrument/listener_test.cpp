#include <catch2/catch.hpp>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "simulator/instrument/listener.h"

using namespace scatter;
using scatter::simulator::FileDescriptor;
using scatter::simulator::Listener;

namespace {

struct SocketPath {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("scatter_listener_" + std::to_string(::getpid()) + ".sock");
  SocketPath() { std::filesystem::remove(path); }
  ~SocketPath() { std::filesystem::remove(path); }
  [[nodiscard]] std::string address() const { return "unix:" + path.string(); }
};

/// What a server that was killed leaves behind: a bound socket file that nobody serves.
void leave_socket_file(const std::filesystem::path& path) {
  const FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  REQUIRE(::bind(socket.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
}

ErrorCode code_of(std::string_view address, bool allow_remote = false) {
  const auto listener = Listener::open(address, allow_remote);
  INFO(address);
  REQUIRE_FALSE(listener.has_value());
  CHECK_FALSE(listener.error().what.empty());
  CHECK_FALSE(listener.error().remedy.empty());
  return listener.error().code;
}

}  // namespace

TEST_CASE("Port 0 becomes a free port that the address tells") {
  const auto listener = Listener::open("tcp:127.0.0.1:0", false);
  REQUIRE(listener.has_value());
  CHECK(listener->address().starts_with("tcp:127.0.0.1:"));
  CHECK(listener->address() != "tcp:127.0.0.1:0");
}

TEST_CASE("A taken port is BUSY") {
  const auto first = Listener::open("tcp:127.0.0.1:0", false);
  REQUIRE(first.has_value());
  CHECK(code_of(first->address()) == ErrorCode::kBusy);
}

TEST_CASE("Addresses beyond loopback are refused unless allowed") {
  CHECK(code_of("tcp:0.0.0.0:0") == ErrorCode::kInvalidArgument);
  CHECK(Listener::open("tcp:0.0.0.0:0", true).has_value());
}

TEST_CASE("What is no address is refused with a remedy") {
  for (const std::string_view address :
       {"", "tcp:", "tcp:127.0.0.1", "tcp:127.0.0.1:", "tcp::7000", "tcp:127.0.0.1:70000", "tcp:127.0.0.1:x",
        "unix:", "udp:127.0.0.1:1", "127.0.0.1:7000"}) {
    CHECK(code_of(address) == ErrorCode::kInvalidArgument);
  }
  CHECK(code_of("unix:" + std::string(200, 'a')) == ErrorCode::kInvalidArgument);
  CHECK(code_of("unix:/nowhere-at-all/socket") == ErrorCode::kNotFound);
}

TEST_CASE("A socket file goes with its listener") {
  const SocketPath socket;
  {
    const auto listener = Listener::open(socket.address(), false);
    REQUIRE(listener.has_value());
    CHECK(std::filesystem::is_socket(socket.path));
  }
  CHECK_FALSE(std::filesystem::exists(socket.path));
}

TEST_CASE("A socket file that nobody serves is taken over, one that is served is not") {
  const SocketPath socket;
  leave_socket_file(socket.path);
  REQUIRE(std::filesystem::is_socket(socket.path));
  const auto listener = Listener::open(socket.address(), false);
  REQUIRE(listener.has_value());
  CHECK(code_of(socket.address()) == ErrorCode::kBusy);
  CHECK(std::filesystem::is_socket(socket.path));
}

TEST_CASE("A file that is no socket is never removed") {
  const SocketPath socket;
  std::ofstream(socket.path) << "letters to my aunt";
  CHECK(code_of(socket.address()) == ErrorCode::kInvalidArgument);
  CHECK(std::filesystem::file_size(socket.path) == 18);
}
