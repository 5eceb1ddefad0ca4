#include "simulator/instrument/listener.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/format.h>

namespace scatter::simulator {
namespace {

constexpr std::string_view kAddressRemedy = "listen on tcp:127.0.0.1:PORT or unix:PATH";

std::unexpected<Error> system_failure(std::string_view address, std::string_view step) {
  const int number = errno;
  ErrorCode code = ErrorCode::kUnavailable;
  std::string remedy = "choose another address to listen on";
  if (number == EADDRINUSE) {
    code = ErrorCode::kBusy;
    remedy = "stop the other server, or choose another port or path";
  } else if (number == EACCES || number == EPERM) {
    code = ErrorCode::kPermissionDenied;
    remedy = "choose a port above 1023 or a path that you may write to";
  } else if (number == ENOENT || number == ENOTDIR || number == EADDRNOTAVAIL) {
    code = ErrorCode::kNotFound;
  }
  return fail(code, fmt::format("{}: {}: {}", address, step, std::strerror(number)), std::move(remedy));
}

bool is_loopback(const sockaddr& address) {
  if (address.sa_family == AF_INET) {
    sockaddr_in v4{};
    std::memcpy(&v4, &address, sizeof v4);
    return (ntohl(v4.sin_addr.s_addr) >> 24U) == 127;
  }
  if (address.sa_family == AF_INET6) {
    sockaddr_in6 v6{};
    std::memcpy(&v6, &address, sizeof v6);
    return IN6_IS_ADDR_LOOPBACK(&v6.sin6_addr) != 0;
  }
  return false;
}

struct AddressListDeleter {
  void operator()(addrinfo* list) const noexcept { ::freeaddrinfo(list); }
};

std::uint64_t inode_of(const std::string& path) {
  struct stat info{};
  return ::lstat(path.c_str(), &info) == 0 ? info.st_ino : 0;
}

/// A socket file that refuses connections was left behind by a server that died.
bool nobody_serves(const sockaddr_un& address) {
  const FileDescriptor probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  return probe.open() &&
         ::connect(probe.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
         errno == ECONNREFUSED;
}

}  // namespace

FileDescriptor& FileDescriptor::operator=(FileDescriptor&& other) noexcept {
  if (this != &other) {
    close();
    number_ = other.release();
  }
  return *this;
}
FileDescriptor::~FileDescriptor() {
  close();
}
int FileDescriptor::release() noexcept {
  return std::exchange(number_, -1);
}
void FileDescriptor::close() noexcept {
  if (open()) {
    ::close(release());
  }
}

Result<Listener> Listener::open(std::string_view address, bool allow_remote) {
  if (address.starts_with("tcp:")) {
    return open_tcp(address.substr(4), allow_remote);
  }
  if (address.starts_with("unix:") && address.size() > 5) {
    return open_unix(std::string(address.substr(5)));
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("\"{}\" is not an address to listen on", address),
              std::string(kAddressRemedy));
}

Result<Listener> Listener::open_tcp(std::string_view place, bool allow_remote) {
  const std::size_t colon = place.rfind(':');
  std::string host(place.substr(0, colon));
  const std::string port(colon == std::string_view::npos ? "" : place.substr(colon + 1));
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  if (host.empty() || port.empty() || port.find_first_not_of("0123456789") != std::string::npos ||
      port.size() > 5 || std::stoul(port) > 65535) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("\"tcp:{}\": expected tcp:HOST:PORT with a port from 0 to 65535", place),
                std::string(kAddressRemedy));
  }
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int problem = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found); problem != 0) {
    return fail(ErrorCode::kNotFound, fmt::format("tcp:{}: {}", place, ::gai_strerror(problem)),
                std::string(kAddressRemedy));
  }
  const std::unique_ptr<addrinfo, AddressListDeleter> list(found);
  if (!allow_remote && !is_loopback(*found->ai_addr)) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("tcp:{} can be reached from other computers, and the protocol has no password", place),
        "listen on tcp:127.0.0.1:PORT, or allow remote hosts explicitly");
  }
  Listener listener;
  listener.socket_ = FileDescriptor(
      ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, found->ai_protocol));
  const int on = 1;
  const std::string name = fmt::format("tcp:{}", place);
  if (!listener.socket_.open()) {
    return system_failure(name, "socket");
  }
  ::setsockopt(listener.number(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (::bind(listener.number(), found->ai_addr, found->ai_addrlen) != 0) {
    return system_failure(name, "bind");
  }
  if (::listen(listener.number(), 8) != 0) {
    return system_failure(name, "listen");
  }
  sockaddr_storage bound{};
  socklen_t size = sizeof bound;
  if (::getsockname(listener.number(), reinterpret_cast<sockaddr*>(&bound), &size) != 0) {
    return system_failure(name, "getsockname");
  }
  const std::uint16_t number = bound.ss_family == AF_INET6
                                   ? reinterpret_cast<const sockaddr_in6&>(bound).sin6_port
                                   : reinterpret_cast<const sockaddr_in&>(bound).sin_port;
  listener.address_ = fmt::format("tcp:{}:{}", place.substr(0, colon), ntohs(number));
  return listener;
}

Result<Listener> Listener::open_unix(const std::string& path) {
  const std::string name = "unix:" + path;
  sockaddr_un address{};
  if (path.size() >= sizeof address.sun_path) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: the path has {} bytes, the system takes {}", name, path.size(),
                            sizeof address.sun_path - 1),
                "choose a shorter path");
  }
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  struct stat info{};
  if (::lstat(path.c_str(), &info) == 0) {
    if (!S_ISSOCK(info.st_mode)) {
      return fail(ErrorCode::kInvalidArgument, fmt::format("{} exists and is not a socket", name),
                  "choose another path");
    }
    if (!nobody_serves(address)) {
      return fail(ErrorCode::kBusy, fmt::format("{}: another server listens there", name),
                  "stop the other server or choose another path");
    }
    ::unlink(path.c_str());
  }
  Listener listener;
  listener.socket_ = FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!listener.socket_.open()) {
    return system_failure(name, "socket");
  }
  if (::bind(listener.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return system_failure(name, "bind");
  }
  listener.unix_path_ = path;
  listener.unix_inode_ = inode_of(path);
  if (::listen(listener.number(), 8) != 0) {
    return system_failure(name, "listen");
  }
  listener.address_ = name;
  return listener;
}

Listener::Listener(Listener&& other) noexcept
    : socket_(std::move(other.socket_)),
      address_(std::move(other.address_)),
      unix_path_(std::exchange(other.unix_path_, {})),
      unix_inode_(other.unix_inode_) {}

Listener::~Listener() {
  // Only our own file: another server may have taken the path meanwhile.
  if (!unix_path_.empty() && inode_of(unix_path_) == unix_inode_) {
    ::unlink(unix_path_.c_str());
  }
}

FileDescriptor Listener::accept(std::string& peer) {
  sockaddr_storage from{};
  socklen_t size = sizeof from;
  FileDescriptor connection(
      ::accept4(number(), reinterpret_cast<sockaddr*>(&from), &size, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (!connection.open()) {
    return connection;
  }
  peer = "a program on this computer";
  if (from.ss_family == AF_INET || from.ss_family == AF_INET6) {
    const int on = 1;
    ::setsockopt(connection.number(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    char host[NI_MAXHOST] = {};
    char port[NI_MAXSERV] = {};
    if (::getnameinfo(reinterpret_cast<const sockaddr*>(&from), size, host, sizeof host, port, sizeof port,
                      NI_NUMERICHOST | NI_NUMERICSERV) == 0) {
      peer = fmt::format("{} port {}", host, port);
    }
  }
  return connection;
}

}  // namespace scatter::simulator
