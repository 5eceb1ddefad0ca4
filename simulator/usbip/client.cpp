#include "simulator/usbip/client.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

namespace scatter::simulator::usbip {
namespace {

constexpr std::size_t kReceiveBytes = 256UL * 1024;
/// Replies gathered into one call of the system.
constexpr std::size_t kGathered = 64;
/// What the device said before it left reaches a host that reads at all within this time.
constexpr std::chrono::seconds kFarewell{1};

bool would_block() noexcept {
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
}

/// A holder whose machine or cable died must not hold the device for ever.
void watch_over(int socket) {
  const auto set = [socket](int level, int name, int value) {
    ::setsockopt(socket, level, name, &value, sizeof value);
  };
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, 10);
  set(IPPROTO_TCP, TCP_KEEPINTVL, 5);
  set(IPPROTO_TCP, TCP_KEEPCNT, 3);
  set(IPPROTO_TCP, TCP_NODELAY, 1);
}

}  // namespace

Client::Client(FileDescriptor socket, std::string peer, ExportedDevice& device, Role role)
    : socket_(std::move(socket)),
      peer_(std::move(peer)),
      device_(device),
      holds_(role == Role::kHolder),
      received_(kReceiveBytes) {
  watch_over(number());
  if (holds_) {
    reader_.start_transfers();
    ++counts_.imports;
  }
}

Client::~Client() {
  if (holds_) {
    device_.release();
  }
}

short Client::wanted_events() const {
  int events = waiting_.empty() ? 0 : POLLOUT;
  if (waiting_bytes_ < kMostWaiting && !leaving_) {
    events |= POLLIN;
  }
  return static_cast<short>(events);
}

Client::State Client::pump(bool& moved) {
  if (!leaving_ && receive(moved) == Received::kGone) {
    return State::kGone;
  }
  collect();
  if (holds_ && device_.left() && !leaving_) {
    leaving_ = true;
    heard_ = Clock::now();
  }
  if (!send_waiting()) {
    return State::kGone;
  }
  if (leaving_) {
    return waiting_.empty() || Clock::now() - heard_ > kFarewell ? State::kGone : State::kOpen;
  }
  return holds_ || Clock::now() - heard_ < kPatience ? State::kOpen : State::kGone;
}

Client::Received Client::receive(bool& moved) {
  // One piece each time: the device has its turn, and the replies are sent, before the next one.
  if (waiting_bytes_ >= kMostWaiting) {
    pollfd look{number(), POLLRDHUP, 0};
    return ::poll(&look, 1, 0) > 0 ? Received::kGone : Received::kOk;
  }
  const ssize_t count = ::recv(number(), received_.data(), received_.size(), MSG_DONTWAIT);
  if (count < 0) {
    return would_block() ? Received::kOk : Received::kGone;
  }
  if (count == 0 || !take(std::span(received_).first(static_cast<std::size_t>(count)), moved)) {
    return Received::kGone;
  }
  return Received::kOk;
}

/// False: the client does not keep to the protocol.
bool Client::take(std::span<const std::byte> bytes, bool& moved) {
  heard_ = Clock::now();
  while (auto request = reader_.next(bytes)) {
    answer(std::move(*request));
    moved = moved || holds_;
    if (!problem_.empty()) {
      return false;
    }
  }
  problem_ = reader_.problem();
  return problem_.empty();
}

void Client::answer(Request&& request) {
  if (std::holds_alternative<ListDevices>(request)) {
    send_later(device_list(device_.record()));
  } else if (const auto* wanted = std::get_if<ImportDevice>(&request)) {
    import(*wanted);
  } else if (auto* urb = std::get_if<SubmitUrb>(&request)) {
    ++counts_.transfers;
    counts_.bytes_to_device += urb->data.size();
    problem_ = device_.submit(std::move(*urb));
  } else if (const auto* unlink = std::get_if<UnlinkUrb>(&request)) {
    problem_ = device_.unlink(*unlink);
  }
}

void Client::import(const ImportDevice& request) {
  const OpStatus status = device_.import(request.bus_id);
  send_later(import_reply(status, device_.record()));
  if (status == OpStatus::kOk) {
    holds_ = true;
    reader_.start_transfers();
    ++counts_.imports;
  } else {
    ++counts_.refused_imports;
  }
}

void Client::send_later(std::vector<std::byte>&& bytes) {
  waiting_bytes_ += bytes.size();
  waiting_.push_back({.header_size = 0, .data = std::move(bytes)});
}

void Client::collect() {
  while (holds_ && waiting_bytes_ < kMostWaiting) {
    auto reply = device_.next_reply();
    if (!reply) {
      return;
    }
    waiting_bytes_ += reply->header.size() + reply->data.size();
    waiting_.push_back(
        {.header = reply->header, .header_size = reply->header.size(), .data = std::move(reply->data)});
  }
}

/// False: the client is gone.
bool Client::send_waiting() {
  while (!waiting_.empty()) {
    std::array<iovec, 2 * kGathered> pieces{};
    std::size_t used = 0;
    std::size_t skip = front_sent_;
    const auto add = [&](std::byte* bytes, std::size_t size) {
      const std::size_t behind = std::min(skip, size);
      skip -= behind;
      if (behind < size) {
        pieces[used++] = {bytes + behind, size - behind};
      }
    };
    std::size_t wanted = 0;
    for (std::size_t k = 0; k < std::min(waiting_.size(), kGathered); ++k) {
      Waiting& each = waiting_[k];
      add(each.header.data(), each.header_size);
      add(each.data.data(), each.data.size());
      wanted += each.size();
    }
    wanted -= front_sent_;
    msghdr message{};
    message.msg_iov = pieces.data();
    message.msg_iovlen = used;
    const ssize_t count = ::sendmsg(number(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0) {
      return would_block();
    }
    sent(static_cast<std::size_t>(count));
    if (static_cast<std::size_t>(count) < wanted) {
      return true;  // The socket is full.
    }
    collect();
  }
  return true;
}

void Client::sent(std::size_t count) {
  waiting_bytes_ -= count;
  front_sent_ += count;
  while (!waiting_.empty() && front_sent_ >= waiting_.front().size()) {
    Waiting& done = waiting_.front();
    front_sent_ -= done.size();
    if (done.header_size > 0) {
      counts_.bytes_to_host += done.data.size();
      device_.reuse(std::move(done.data));
    }
    waiting_.pop_front();
  }
}

}  // namespace scatter::simulator::usbip
