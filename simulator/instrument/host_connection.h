// The sockets of a server's hosts: the one that holds the instrument and those turned away.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "protocol/frame.h"
#include "protocol/link_decoder.h"
#include "simulator/instrument/listener.h"

namespace scatter::simulator {

class ServedDevice;

/// The host that holds the device: moves bytes between its socket and the device's link.
/// Bounded memory; never blocks.
class HostConnection {
 public:
  HostConnection(FileDescriptor socket, std::string peer, ServedDevice& device);

  [[nodiscard]] int number() const noexcept { return socket_.number(); }
  /// The name that the host gave in HELLO, else where it comes from.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Events for poll(): what would let bytes move.
  [[nodiscard]] short wanted_events() const;
  /// Bytes wait for the host because its socket is full.
  [[nodiscard]] bool host_is_slow() const noexcept { return !pending_.empty(); }

  enum class State : std::uint8_t { kOpen, kGone };
  /// Moves what can be moved now. `moved` becomes true when bytes reached or left the device: it
  /// has something to do then.
  [[nodiscard]] State pump(bool& moved);

 private:
  [[nodiscard]] bool send_pending();
  [[nodiscard]] bool receive(bool& moved);
  void learn_name(std::span<const std::byte> bytes);

  FileDescriptor socket_;
  std::string name_;
  ServedDevice& device_;
  std::vector<std::byte> pending_;  ///< Taken from the device, not yet sent; [sent_, size).
  std::size_t sent_ = 0;
  std::vector<std::byte> received_;
  std::vector<std::byte> hello_buffer_;
  protocol::LinkDecoder hello_decoder_;
  bool named_ = false;
};

/// A host that came second: gets one BUSY reply to its HELLO, then the connection ends.
class TurnedAway {
 public:
  TurnedAway(FileDescriptor socket, std::string holder);
  TurnedAway(TurnedAway&&) = default;
  TurnedAway& operator=(TurnedAway&&) = default;

  [[nodiscard]] int number() const noexcept { return socket_.number(); }
  /// False when the connection is over. Replies to the HELLO, or after kPatience without one.
  [[nodiscard]] bool pump();

 private:
  static constexpr auto kPatience = std::chrono::milliseconds(250);
  static constexpr auto kLinger = std::chrono::milliseconds(1000);

  void reply(const protocol::FrameHeader& to);

  FileDescriptor socket_;
  std::string holder_;
  std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
  std::vector<std::byte> heard_;
  bool replied_ = false;
};

}  // namespace scatter::simulator
