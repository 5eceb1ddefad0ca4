// The client's side of USB/IP in user space: what vhci_hcd and the usbip program do, for tests and
// measurements. Written from usbip_protocol.rst, not with the server's own code.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "simulator/instrument/listener.h"

namespace scatter::simulator {

/// Blocking; every wait ends after 5 s. Threads: one.
class UsbIpClient {
 public:
  using Bytes = std::vector<std::byte>;
  using Setup = std::array<std::uint8_t, 8>;

  explicit UsbIpClient(FileDescriptor socket) : socket_(std::move(socket)) {
    const timeval patience{5, 0};
    ::setsockopt(socket_.number(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ::setsockopt(socket_.number(), SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    const int on = 1;
    ::setsockopt(socket_.number(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  }
  /// `address`: usbip:127.0.0.1:PORT.
  static UsbIpClient to(const std::string& address) {
    FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    (void)::connect(socket.number(), reinterpret_cast<const sockaddr*>(&place), sizeof place);
    return UsbIpClient(std::move(socket));
  }

  void send(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t count = ::send(socket_.number(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (count <= 0) {
        return;
      }
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
  }
  /// Exactly so many bytes; nothing when the connection ends before.
  std::optional<Bytes> receive(std::size_t size) {
    Bytes bytes(size);
    return receive_into(bytes) ? std::optional(std::move(bytes)) : std::nullopt;
  }
  [[nodiscard]] bool receive_into(std::span<std::byte> room) {
    while (!room.empty()) {
      const ssize_t count = ::recv(socket_.number(), room.data(), room.size(), MSG_WAITALL);
      if (count <= 0) {
        ended_ = count == 0 || errno == ECONNRESET;
        return false;
      }
      room = room.subspan(static_cast<std::size_t>(count));
    }
    return true;
  }

  /// OP_REQ_DEVLIST: the one device and its interfaces, as on the wire; empty: none.
  std::optional<Bytes> list() {
    send(operation(0x8005, ""));
    const auto head = receive(12);
    if (!head || number(*head, 8) == 0) {
      return head ? std::optional(Bytes{}) : std::nullopt;
    }
    auto device = receive(312);
    if (device) {
      const auto interfaces = receive(4 * std::to_integer<std::size_t>((*device)[311]));
      device->insert(device->end(), interfaces->begin(), interfaces->end());
    }
    return device;
  }
  /// OP_REQ_IMPORT: status; -1: the connection ended.
  int import(const std::string& bus_id = "1-1") {
    send(operation(0x8003, bus_id));
    const auto head = receive(8);
    if (!head) {
      return -1;
    }
    if (number(*head, 4) == 0 && !receive(312)) {
      return -1;
    }
    return static_cast<int>(number(*head, 4));
  }

  /// CMD_SUBMIT to the host; its sequence number.
  std::uint32_t submit_in(std::uint8_t endpoint, std::uint32_t length, const Setup& setup = {},
                          std::uint32_t flags = 0) {
    send(header(1, ++sequence_, 1, endpoint & 0x0FU, flags, length, setup));
    to_host_[sequence_] = true;
    return sequence_;
  }
  /// CMD_SUBMIT to the device.
  std::uint32_t submit_out(std::uint8_t endpoint, std::span<const std::byte> data, const Setup& setup = {}) {
    Bytes bytes = header(1, ++sequence_, 0, endpoint, 0, static_cast<std::uint32_t>(data.size()), setup);
    bytes.insert(bytes.end(), data.begin(), data.end());
    send(bytes);
    to_host_[sequence_] = false;
    return sequence_;
  }
  std::uint32_t unlink(std::uint32_t victim) {
    send(header(2, ++sequence_, 0, 0, victim, 0, {}));
    return sequence_;
  }

  struct Reply {
    bool to_unlink = false;
    std::uint32_t sequence = 0;
    std::int32_t status = 0;
    std::uint32_t actual = 0;
    Bytes data;
  };
  /// The next one from the wire, or one that wait_for() put aside; nothing: the connection ended.
  std::optional<Reply> next() {
    if (!aside_.empty()) {
      Reply first = std::move(aside_.front());
      aside_.pop_front();
      return first;
    }
    return next_from_wire();
  }
  std::optional<Reply> wait_for(std::uint32_t sequence) {
    while (auto reply = next_from_wire()) {
      if (reply->sequence == sequence) {
        return reply;
      }
      aside_.push_back(std::move(*reply));
    }
    return std::nullopt;
  }
  /// A whole control transfer; `setup` says which way.
  std::optional<Reply> control(const Setup& setup, std::span<const std::byte> data = {}) {
    const std::uint32_t length = setup[6] | static_cast<std::uint32_t>(setup[7]) << 8U;
    const bool in = (setup[0] & 0x80U) != 0 && length > 0;
    return wait_for(in ? submit_in(0, length, setup) : submit_out(0, data, setup));
  }
  /// The last wait ended because the server closed the connection.
  [[nodiscard]] bool ended() const { return ended_; }
  void close() { socket_.close(); }

 private:
  static std::uint32_t number(const Bytes& bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return ntohl(value);
  }
  static void put(Bytes& bytes, std::size_t at, std::uint32_t value) {
    value = htonl(value);
    std::memcpy(bytes.data() + at, &value, 4);
  }
  static Bytes operation(std::uint16_t code, const std::string& bus_id) {
    Bytes bytes(40);
    put(bytes, 0, 0x0111'0000U | code);
    std::memcpy(bytes.data() + 8, bus_id.data(), std::min<std::size_t>(bus_id.size(), 32));
    bytes.resize(bus_id.empty() ? 8 : 40);
    return bytes;
  }
  static Bytes header(std::uint32_t command, std::uint32_t sequence, std::uint32_t direction,
                      std::uint32_t endpoint, std::uint32_t flags_or_victim, std::uint32_t length,
                      const Setup& setup) {
    Bytes bytes(48);
    const std::array<std::uint32_t, 7> words{command,  sequence,        0x0001'0002, direction,
                                             endpoint, flags_or_victim, length};
    for (std::size_t k = 0; k < words.size(); ++k) {
      put(bytes, 4 * k, words[k]);
    }
    std::memcpy(bytes.data() + 40, setup.data(), setup.size());
    return bytes;
  }
  std::optional<Reply> next_from_wire() {
    const auto head = receive(48);
    if (!head) {
      return std::nullopt;
    }
    Reply reply{.to_unlink = number(*head, 0) == 4,
                .sequence = number(*head, 4),
                .status = static_cast<std::int32_t>(number(*head, 20)),
                .actual = number(*head, 24),
                .data = {}};
    if (!reply.to_unlink && to_host_[reply.sequence]) {
      auto data = receive(reply.actual);
      if (!data) {
        return std::nullopt;
      }
      reply.data = std::move(*data);
    }
    to_host_.erase(reply.sequence);
    return reply;
  }

  FileDescriptor socket_;
  bool ended_ = false;
  std::uint32_t sequence_ = 0;
  std::map<std::uint32_t, bool> to_host_;
  std::deque<Reply> aside_;
};

}  // namespace scatter::simulator
