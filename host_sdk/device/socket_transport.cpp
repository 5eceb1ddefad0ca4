#include "host_sdk/device/socket_transport.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>
#include <vector>

namespace scatter::device {

namespace {

// A stop request is noticed at the end of a slice.
constexpr Duration kPollSlice = std::chrono::milliseconds(10);
constexpr int kReceiveBufferBytes = 4 << 20;
constexpr std::size_t kLentBytes = 256UL * 1024;

TimePoint real_now() {
  return TimePoint(std::chrono::duration_cast<Duration>(std::chrono::steady_clock::now().time_since_epoch()));
}

std::string reason(int number) {
  return std::strerror(number);
}

/// Owns a descriptor.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) noexcept : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { close(); }
  void close() noexcept {
    if (number_ >= 0) {
      ::close(std::exchange(number_, -1));
    }
  }
  [[nodiscard]] int get() const noexcept { return number_; }
  [[nodiscard]] bool open() const noexcept { return number_ >= 0; }

 private:
  int number_;
};

/// Waits until `events` are possible on the socket.
Status wait_for(int socket, short events, TimePoint deadline, const std::stop_token& stop,
                std::string_view doing) {
  for (;;) {
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, std::string(doing) + ": stopped", "start again when ready");
    }
    const Duration left = deadline - real_now();
    if (left <= Duration::zero()) {
      return fail(ErrorCode::kDeadlineExceeded, std::string(doing) + ": no answer in time",
                  "check that the device has power and the cable is good, then try again");
    }
    const Duration slice = std::min(left, kPollSlice);
    const auto microseconds = std::chrono::ceil<std::chrono::microseconds>(slice);
    const timespec pause{.tv_sec = 0, .tv_nsec = static_cast<long>(microseconds.count()) * 1000L};
    pollfd one{.fd = socket, .events = events, .revents = 0};
    const int ready = ::ppoll(&one, 1, &pause, nullptr);
    if (ready > 0 || (ready < 0 && errno != EINTR)) {
      return {};  // The call that follows finds out about errors.
    }
  }
}

class SocketTransport final : public Transport {
 public:
  explicit SocketTransport(Descriptor socket) : socket_(std::move(socket)), lent_(kLentBytes) {}

  Result<std::span<const std::byte>> receive(TimePoint deadline, const std::stop_token& stop) override {
    for (;;) {
      if (!socket_.open()) {
        return gone("the connection is closed");
      }
      if (stop.stop_requested()) {
        return fail(ErrorCode::kAborted, "receive: stopped", "start again when ready");
      }
      const ssize_t got = ::recv(socket_.get(), lent_.data(), lent_.size(), 0);
      if (got > 0) {
        return std::span<const std::byte>(lent_).first(static_cast<std::size_t>(got));
      }
      if (got == 0) {
        return gone("the device closed the connection");
      }
      if (errno == EINTR) {
        continue;
      }
      if (errno != EAGAIN && errno != EWOULDBLOCK) {
        return gone("the connection broke: " + reason(errno));
      }
      if (const Status ready = wait_for(socket_.get(), POLLIN, deadline, stop, "receive"); !ready) {
        return std::unexpected(ready.error());
      }
    }
  }

  Status write(std::span<const std::byte> bytes, TimePoint deadline, const std::stop_token& stop) override {
    while (!bytes.empty()) {
      if (!socket_.open()) {
        return gone("the connection is closed");
      }
      const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent > 0) {
        bytes = bytes.subspan(static_cast<std::size_t>(sent));
        continue;
      }
      if (errno == EINTR) {
        continue;
      }
      if (errno != EAGAIN && errno != EWOULDBLOCK) {
        return gone("the connection broke: " + reason(errno));
      }
      if (const Status ready = wait_for(socket_.get(), POLLOUT, deadline, stop, "write"); !ready) {
        return ready;
      }
    }
    return {};
  }

  TimePoint now() const override { return real_now(); }

  std::uint64_t system_time_unix_ns() const override {
    return static_cast<std::uint64_t>(
        std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()).count());
  }

  void close() noexcept override { socket_.close(); }

 private:
  static std::unexpected<Error> gone(std::string what) {
    return fail(ErrorCode::kDisconnected, std::move(what),
                "plug the device in again or restart the simulator");
  }

  Descriptor socket_;
  std::vector<std::byte> lent_;
};

std::unexpected<Error> connect_error(int number, const std::string& where) {
  switch (number) {
    case ECONNREFUSED:
      return fail(ErrorCode::kUnavailable, where + ": nobody listens there",
                  "start the instrument, or a simulated one with `scatter simulate --listen " + where + "`");
    case ENOENT:
      return fail(ErrorCode::kNotFound, where + ": no such socket",
                  "correct the path, or serve one with `scatter simulate --listen " + where + "`");
    case EACCES:
    case EPERM:
      return fail(ErrorCode::kPermissionDenied, where + ": " + reason(number),
                  "use an account that may open this socket");
    default:
      return fail(ErrorCode::kUnavailable, where + ": " + reason(number),
                  "check the address and the network, then try again");
  }
}

Result<Descriptor> connect_to(const sockaddr* address, socklen_t length, int family, const std::string& where,
                              const Wait& wait, TimePoint deadline) {
  Descriptor socket(::socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket.open()) {
    return connect_error(errno, where);
  }
  // A big buffer, so that a device never waits for the host to wake up. Best effort.
  (void)::setsockopt(socket.get(), SOL_SOCKET, SO_RCVBUF, &kReceiveBufferBytes, sizeof kReceiveBufferBytes);
  for (;;) {
    if (::connect(socket.get(), address, length) == 0) {
      return socket;
    }
    if (errno == EINPROGRESS || errno == EINTR) {
      break;
    }
    if (errno != EAGAIN) {  // EAGAIN: a Unix socket whose queue of waiting connections is full.
      return connect_error(errno, where);
    }
    if (real_now() >= deadline || wait.stop.stop_requested()) {
      return fail(ErrorCode::kDeadlineExceeded, where + ": too many are waiting there",
                  "close the other programs that use the device");
    }
    const timespec pause{.tv_sec = 0, .tv_nsec = 5'000'000};
    ::nanosleep(&pause, nullptr);
  }
  if (const Status ready = wait_for(socket.get(), POLLOUT, deadline, wait.stop, "connect to " + where);
      !ready) {
    return std::unexpected(ready.error());
  }
  int outcome = 0;
  socklen_t size = sizeof outcome;
  if (::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &outcome, &size) != 0) {
    return connect_error(errno, where);
  }
  if (outcome != 0) {
    return connect_error(outcome, where);
  }
  return socket;
}

}  // namespace

Result<std::unique_ptr<Transport>> open_tcp(const Uri& uri, const Wait& wait) {
  const Result<HostPort> place = parse_host_port(uri.place);
  if (!place) {
    return std::unexpected(place.error());
  }
  const TimePoint deadline = real_now() + wait.timeout;
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  const int failed = ::getaddrinfo(place->host.c_str(), place->port.c_str(), &hints, &list);
  if (failed != 0) {
    return fail(ErrorCode::kNotFound, uri.text() + ": " + ::gai_strerror(failed), "correct the host's name");
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(list, &::freeaddrinfo);
  Result<Descriptor> socket =
      fail(ErrorCode::kNotFound, uri.text() + ": no address", "correct the host's name");
  for (const addrinfo* one = list; one != nullptr; one = one->ai_next) {
    socket = connect_to(one->ai_addr, one->ai_addrlen, one->ai_family, uri.text(), wait, deadline);
    if (socket) {
      const int on = 1;
      (void)::setsockopt(socket->get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      return std::make_unique<SocketTransport>(std::move(*socket));
    }
  }
  return std::unexpected(socket.error());
}

Result<std::unique_ptr<Transport>> open_unix(const Uri& uri, const Wait& wait) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (uri.place.empty() || uri.place.size() >= sizeof address.sun_path) {
    return fail(ErrorCode::kInvalidArgument,
                uri.text() + ": the path has " + std::to_string(uri.place.size()) +
                    " bytes, allowed are 1 to " + std::to_string(sizeof address.sun_path - 1),
                "use a shorter path, for example unix:/run/scatter.sock");
  }
  std::memcpy(address.sun_path, uri.place.data(), uri.place.size());
  Result<Descriptor> socket = connect_to(reinterpret_cast<const sockaddr*>(&address), sizeof address, AF_UNIX,
                                         uri.text(), wait, real_now() + wait.timeout);
  if (!socket) {
    return std::unexpected(socket.error());
  }
  return std::make_unique<SocketTransport>(std::move(*socket));
}

std::unique_ptr<Transport> adopt_socket(int descriptor) {
  const int flags = ::fcntl(descriptor, F_GETFL);
  (void)::fcntl(descriptor, F_SETFL, flags | O_NONBLOCK);
  return std::make_unique<SocketTransport>(Descriptor(descriptor));
}

}  // namespace scatter::device
