// One connection of a USB/IP server.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "simulator/instrument/listener.h"
#include "simulator/usbip/exported_device.h"
#include "simulator/usbip/usbip_protocol.h"

namespace scatter::simulator::usbip {

/// Asks who is there, and maybe imports the device; then its transfers go to and fro until one side leaves.
/// Never blocks. Memory: kMostWaiting, one request, and what ExportedDevice keeps. Threads: one.
class Client {
 public:
  /// Replies that wait for the client before no more requests are read [bytes].
  static constexpr std::size_t kMostWaiting = 4UL << 20U;
  /// A connection that imports nothing ends after this time without a request.
  static constexpr std::chrono::seconds kPatience{10};

  /// kHolder: the device was imported for it already (this machine's own bus); it needs no requests for that.
  enum class Role : std::uint8_t { kStranger, kHolder };
  /// `device` outlives it. `socket`: a stream, non-blocking.
  Client(FileDescriptor socket, std::string peer, ExportedDevice& device, Role role = Role::kStranger);
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  /// Releases the device when it holds it.
  ~Client();

  [[nodiscard]] int number() const noexcept { return socket_.number(); }
  [[nodiscard]] const std::string& peer() const noexcept { return peer_; }
  [[nodiscard]] bool holds() const noexcept { return holds_; }
  /// For poll(): what would let bytes move.
  [[nodiscard]] short wanted_events() const;
  /// Replies wait because the socket is full.
  [[nodiscard]] bool is_slow() const noexcept { return !waiting_.empty(); }

  enum class State : std::uint8_t { kOpen, kGone };
  /// Moves what can be moved now. `moved` becomes true when the device has something to do.
  [[nodiscard]] State pump(bool& moved);
  /// Why the server ended it: what was wrong with its requests. "": nothing was.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  struct Counts {
    std::uint64_t transfers = 0;
    std::uint64_t bytes_to_host = 0;    ///< Of data, taken by the socket.
    std::uint64_t bytes_to_device = 0;  ///< Likewise, from it.
    std::uint64_t refused_imports = 0;
    std::uint64_t imports = 0;
  };
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  using Clock = std::chrono::steady_clock;
  enum class Received : std::uint8_t { kOk, kGone };

  [[nodiscard]] Received receive(bool& moved);
  [[nodiscard]] bool take(std::span<const std::byte> bytes, bool& moved);
  void answer(Request&& request);
  void import(const ImportDevice& request);
  void collect();
  [[nodiscard]] bool send_waiting();
  void sent(std::size_t count);
  void send_later(std::vector<std::byte>&& bytes);

  FileDescriptor socket_;
  std::string peer_;
  ExportedDevice& device_;
  bool holds_ = false;
  RequestReader reader_;
  std::vector<std::byte> received_;
  struct Waiting {
    UrbHeader header{};
    std::size_t header_size = 0;  ///< 0: the data is a whole OP_ reply.
    std::vector<std::byte> data;
    [[nodiscard]] std::size_t size() const noexcept { return header_size + data.size(); }
  };
  std::deque<Waiting> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::size_t front_sent_ = 0;  ///< Of the first of them.
  bool leaving_ = false;        ///< The device has left: what waits is sent, then the connection ends.
  Clock::time_point heard_ = Clock::now();
  std::string problem_;
  Counts counts_;
};

}  // namespace scatter::simulator::usbip
