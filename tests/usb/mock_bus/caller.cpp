#include "tests/usb/mock_bus/caller.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace scatter::mock_bus {

namespace {

// Commands of the library's protocol; the calls have theirs in Call::Kind.
constexpr unsigned long kDone = 3;
constexpr unsigned long kReadMemory = 5;
constexpr unsigned long kWriteMemory = 6;

struct Message {
  unsigned long command = 0;
  unsigned long first = 0;
  unsigned long second = 0;
};

bool readable_now(int file) {
  pollfd waiting{file, POLLIN, 0};
  return ::poll(&waiting, 1, 0) > 0;
}

}  // namespace

Caller::Caller(FileDescriptor socket) : socket_(std::move(socket)) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (::getsockopt(socket_.number(), SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0) {
    process_ = peer.pid;
  }
}

bool Caller::receive(Call& call) {
  Message message;
  if (::recv(socket_.number(), &message, sizeof message, MSG_WAITALL) != sizeof message) {
    alive_ = false;
    return false;
  }
  call.kind = static_cast<Call::Kind>(message.command);
  if (call.kind == Call::Kind::kIoctl) {
    call.code = message.first;
    call.address = message.second;
    call.size = 0;
  } else {
    call.code = 0;
    call.address = message.first;
    call.size = message.second;
  }
  return true;
}

void Caller::send(unsigned long command, std::uint64_t first, std::uint64_t second,
                  std::span<const std::byte> bytes) {
  // The library takes each message with one recv() and no loop: it must never be split, so it goes alone.
  const Message message{command, first, second};
  if (!alive_ || ::send(socket_.number(), &message, sizeof message, MSG_NOSIGNAL) != sizeof message) {
    alive_ = false;
    return;
  }
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket_.number(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) {
      alive_ = false;
      return;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

bool Caller::read_memory(std::uint64_t address, std::span<std::byte> out) {
  if (out.empty()) {
    return true;
  }
  send(kReadMemory, address, out.size(), {});
  alive_ = alive_ &&
           ::recv(socket_.number(), out.data(), out.size(), MSG_WAITALL) == static_cast<ssize_t>(out.size());
  return alive_;
}

void Caller::write_memory(std::uint64_t address, std::span<const std::byte> bytes) {
  if (!bytes.empty()) {
    send(kWriteMemory, address, bytes.size(), bytes);
  }
}

void Caller::answer(long result, int error) {
  send(kDone, static_cast<std::uint64_t>(result), static_cast<std::uint64_t>(error), {});
}

CallServer::CallServer(const std::filesystem::path& socket_path, FileHandler& handler)
    : path_(socket_path),
      handler_(handler),
      listener_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
  std::filesystem::create_directories(path_.parent_path());
  std::filesystem::remove(path_);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path_.string();
  if (text.size() >= sizeof address.sun_path) {
    throw std::runtime_error(fmt::format("{}: too long for the name of a socket; set TMPDIR shorter", text));
  }
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  if (!listener_.open() ||
      ::bind(listener_.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener_.number(), 16) != 0) {
    throw std::runtime_error(fmt::format("{}: {}", text, std::strerror(errno)));
  }
  struct stat made{};
  if (::stat(text.c_str(), &made) == 0) {
    identity_ = made.st_ino;
  }
}

CallServer::~CallServer() {
  struct stat found{};
  if (::stat(path_.c_str(), &found) == 0 && found.st_ino == identity_) {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
}

void CallServer::add_waits(std::vector<pollfd>& files) const {
  if (listener_.open()) {
    files.push_back({listener_.number(), POLLIN, 0});
  }
  for (const auto& caller : callers_) {
    files.push_back({caller->number(), POLLIN, 0});
  }
}

bool CallServer::serve() {
  bool did = false;
  while (listener_.open()) {
    FileDescriptor socket(::accept4(listener_.number(), nullptr, nullptr, SOCK_CLOEXEC));
    if (!socket.open()) {
      break;
    }
    callers_.push_back(std::make_unique<Caller>(std::move(socket)));
    handler_.opened(*callers_.back());
    did = true;
  }
  for (auto each = callers_.begin(); each != callers_.end();) {
    Caller& caller = **each;
    if (readable_now(caller.number())) {
      did = true;
      Call call;
      if (caller.receive(call)) {
        handler_.called(caller, call);
      }
    }
    if (caller.alive()) {
      ++each;
    } else {
      handler_.closed(caller);
      each = callers_.erase(each);
    }
  }
  return did;
}

}  // namespace scatter::mock_bus
