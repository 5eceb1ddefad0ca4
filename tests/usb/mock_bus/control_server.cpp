#include "tests/usb/mock_bus/control_server.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace scatter::mock_bus {

ControlServer::ControlServer(std::string path, Request request)
    : path_(std::move(path)),
      request_(std::move(request)),
      listener_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path_.c_str(), sizeof address.sun_path - 1);
  if (!listener_.open() ||
      ::bind(listener_.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener_.number(), 4) != 0) {
    throw std::runtime_error(path_ + ": " + std::strerror(errno));
  }
}

void ControlServer::add_waits(std::vector<pollfd>& files) const {
  files.push_back({listener_.number(), POLLIN, 0});
  for (const Client& client : clients_) {
    files.push_back({client.socket.number(), POLLIN, 0});
  }
}

bool ControlServer::serve() {
  bool did = false;
  for (;;) {
    FileDescriptor socket(::accept4(listener_.number(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!socket.open()) {
      break;
    }
    clients_.push_back({std::move(socket), ""});
    did = true;
  }
  for (auto client = clients_.begin(); client != clients_.end();) {
    std::array<char, 512> bytes{};
    const ssize_t count = ::recv(client->socket.number(), bytes.data(), bytes.size(), 0);
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) {
      client = clients_.erase(client);
      continue;
    }
    for (ssize_t k = 0; k < count; ++k) {
      const char letter = bytes[static_cast<std::size_t>(k)];
      if (letter != '\n') {
        client->line.push_back(letter);
        continue;
      }
      const std::string answer = request_(std::exchange(client->line, {})) + "\n";
      (void)!::send(client->socket.number(), answer.data(), answer.size(), MSG_NOSIGNAL);
      did = true;
    }
    ++client;
  }
  return did;
}

}  // namespace scatter::mock_bus
