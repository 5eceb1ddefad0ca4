#include "simulator/instrument/host_connection.h"

#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "simulator/instrument/served_device.h"

namespace scatter::simulator {
namespace {

constexpr std::size_t kBlock = 256 * 1024;

bool would_block() noexcept {
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
}

}  // namespace

HostConnection::HostConnection(FileDescriptor socket, std::string peer, ServedDevice& device)
    : socket_(std::move(socket)),
      name_(std::move(peer)),
      device_(device),
      received_(64 * 1024),
      hello_buffer_(protocol::kMaxFrameBytes),
      hello_decoder_(hello_buffer_) {}

short HostConnection::wanted_events() const {
  int events = pending_.empty() ? 0 : POLLOUT;
  if (device_.writable() > 0) {
    events |= POLLIN;
  }
  return static_cast<short>(events);
}

HostConnection::State HostConnection::pump(bool& moved) {
  if (!receive(moved)) {
    return State::kGone;
  }
  while (send_pending()) {
    pending_.resize(kBlock);
    pending_.resize(device_.host_read(pending_));
    if (pending_.empty()) {
      // Everything is sent; a link that the device broke ends the connection only now.
      return device_.attached() ? State::kOpen : State::kGone;
    }
    moved = true;
  }
  return socket_.open() ? State::kOpen : State::kGone;
}

/// True when nothing is pending any more.
bool HostConnection::send_pending() {
  while (sent_ < pending_.size()) {
    const ssize_t count =
        ::send(number(), pending_.data() + sent_, pending_.size() - sent_, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0) {
      if (!would_block()) {
        socket_.close();
      }
      return false;
    }
    sent_ += static_cast<std::size_t>(count);
  }
  pending_.clear();
  sent_ = 0;
  return true;
}

/// False when the host is gone.
bool HostConnection::receive(bool& moved) {
  while (true) {
    const std::size_t room = std::min(device_.writable(), received_.size());
    if (room == 0) {
      // Nothing can be read now, yet a host that left must be noticed.
      pollfd look{number(), POLLRDHUP, 0};
      return ::poll(&look, 1, 0) <= 0;
    }
    const ssize_t count = ::recv(number(), received_.data(), room, MSG_DONTWAIT);
    if (count < 0) {
      return would_block();
    }
    if (count == 0) {
      return false;
    }
    const auto bytes = std::span(received_).first(static_cast<std::size_t>(count));
    learn_name(bytes);
    // There is room for all of them, unless a fault broke the link on the way.
    if (device_.host_write(bytes) != bytes.size()) {
      return true;
    }
    moved = true;
  }
}

void HostConnection::learn_name(std::span<const std::byte> bytes) {
  if (named_) {
    return;
  }
  hello_decoder_.push(bytes, [this](const protocol::Frame& frame) {
    const auto hello = frame.as<protocol::Hello>();
    if (hello && !hello->host_name.empty()) {
      name_ = fmt::format("\"{}\" ({})", hello->host_name.str(), name_);
    }
    named_ = true;
  });
}

TurnedAway::TurnedAway(FileDescriptor socket, std::string holder)
    : socket_(std::move(socket)), holder_(std::move(holder)) {}

bool TurnedAway::pump() {
  std::array<std::byte, 2048> bytes;
  while (true) {
    const ssize_t count = ::recv(number(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (count == 0 || (count < 0 && !would_block())) {
      return false;
    }
    if (count < 0) {
      break;
    }
    if (!replied_ && heard_.size() < protocol::kMaxFrameBytes) {
      heard_.insert(heard_.end(), bytes.begin(), bytes.begin() + count);
    }
  }
  const auto waited = std::chrono::steady_clock::now() - since_;
  if (!replied_) {
    const protocol::ParseResult first = protocol::parse_frame(heard_);
    if (first.status != protocol::ParseStatus::kNeedMore || waited > kPatience) {
      reply(first.header);
    }
    return true;
  }
  // The host closes when it has read the reply; closing first could throw the reply away.
  return waited < kPatience + kLinger;
}

void TurnedAway::reply(const protocol::FrameHeader& to) {
  protocol::StatusReply busy;
  busy.status = protocol::StatusCode::kBusy;
  busy.request = to.message;
  busy.text =
      std::string_view(fmt::format("the instrument is held by {}; close that program first", holder_));
  std::array<std::byte, 512> frame;
  const std::size_t size =
      protocol::write_message(frame, {.session = to.session, .correlation = to.correlation}, busy);
  // A fresh socket has room for one small frame; a host that cannot take it learns from the close.
  (void)::send(number(), frame.data(), size, MSG_NOSIGNAL | MSG_DONTWAIT);
  ::shutdown(number(), SHUT_WR);
  replied_ = true;
}

}  // namespace scatter::simulator
