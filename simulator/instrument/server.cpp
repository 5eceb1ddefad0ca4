#include "simulator/instrument/server.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "simulator/instrument/host_connection.h"
#include "simulator/instrument/listener.h"
#include "simulator/instrument/pace.h"
#include "simulator/instrument/served_device.h"
#include "simulator/instrument/virtual_instrument.h"

namespace scatter::simulator {

struct Server::Parts {
  Listener listener;
  ServedDevice& device;
  std::unique_ptr<ServedDevice> owned{};  ///< `device`, where it is an adapter of ours.
  std::optional<HostConnection> host{};
  std::vector<TurnedAway> turned_away{};
  Statistics statistics{};
  FileDescriptor wake{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  std::atomic<unsigned> presses{0};

  void accept_all();
  [[nodiscard]] bool pump_host();
  [[nodiscard]] Status wait(std::uint64_t microseconds);
  void wake_up() const noexcept {
    const std::uint64_t one = 1;
    (void)!::write(wake.number(), &one, sizeof one);
  }
};

namespace {

constexpr std::size_t kMostTurnedAway = 8;

/// The virtual instrument as what the server serves.
class ServedInstrument final : public ServedDevice {
 public:
  explicit ServedInstrument(VirtualInstrument& instrument) : instrument_(instrument) {}
  void attach() override { instrument_.attach(); }
  void detach() override { instrument_.detach(); }
  [[nodiscard]] bool attached() const override { return instrument_.attached(); }
  [[nodiscard]] std::size_t host_write(std::span<const std::byte> bytes) override {
    return instrument_.host_write(bytes);
  }
  [[nodiscard]] std::size_t writable() override { return instrument_.writable(); }
  [[nodiscard]] std::size_t host_read(std::span<std::byte> out) override {
    return instrument_.host_read(out);
  }
  [[nodiscard]] std::size_t readable() override { return instrument_.readable(); }
  [[nodiscard]] Result<std::uint64_t> run_ready() override { return instrument_.run_ready(); }
  [[nodiscard]] std::uint64_t now_us() const override { return instrument_.now_us(); }
  [[nodiscard]] ClockMode clock_mode() const override { return instrument_.clock_mode(); }
  void advance_to(std::uint64_t time_us) override { instrument_.advance_to(time_us); }
  void press_button() override { instrument_.press_button(); }

 private:
  VirtualInstrument& instrument_;
};

}  // namespace

void Server::Parts::accept_all() {
  while (true) {
    std::string peer;
    FileDescriptor connection = listener.accept(peer);
    if (!connection.open()) {
      return;
    }
    // A host that has left makes room for the next at once.
    (void)pump_host();
    if (!host) {
      device.attach();
      host.emplace(std::move(connection), std::move(peer), device);
      ++statistics.hosts;
      continue;
    }
    ++statistics.turned_away;
    if (turned_away.size() < kMostTurnedAway) {
      turned_away.emplace_back(std::move(connection), host->name());
    }
  }
}

/// True when bytes reached or left the device.
bool Server::Parts::pump_host() {
  bool moved = false;
  if (host && host->pump(moved) == HostConnection::State::kGone) {
    host.reset();
    device.detach();
  }
  std::erase_if(turned_away, [](TurnedAway& each) { return !each.pump(); });
  return moved;
}

Status Server::Parts::wait(std::uint64_t microseconds) {
  std::vector<pollfd> files{{wake.number(), POLLIN, 0}, {listener.number(), POLLIN, 0}};
  if (host) {
    files.push_back({host->number(), host->wanted_events(), 0});
  }
  for (const TurnedAway& each : turned_away) {
    files.push_back({each.number(), POLLIN, 0});
    microseconds = std::min<std::uint64_t>(microseconds, 50'000);
  }
  device.add_waits(files);
  const timespec timeout{static_cast<time_t>(microseconds / 1'000'000),
                         static_cast<long>(microseconds % 1'000'000 * 1000)};
  if (::ppoll(files.data(), files.size(), &timeout, nullptr) < 0 && errno != EINTR) {
    return fail(ErrorCode::kInternal, fmt::format("{}: poll: {}", listener.address(), std::strerror(errno)),
                "start the server again");
  }
  std::uint64_t ignored = 0;
  (void)!::read(wake.number(), &ignored, sizeof ignored);
  return {};
}

Result<std::unique_ptr<Server>> Server::listen(std::string_view address, ServedDevice& device,
                                               const ServerOptions& options) {
  Result<Listener> listener = Listener::open(address, options.allow_remote);
  if (!listener) {
    return std::unexpected(std::move(listener.error()));
  }
  return std::unique_ptr<Server>(
      new Server(std::unique_ptr<Parts>(new Parts{.listener = std::move(*listener), .device = device})));
}

Result<std::unique_ptr<Server>> Server::listen(std::string_view address, VirtualInstrument& instrument,
                                               const ServerOptions& options) {
  auto served = std::make_unique<ServedInstrument>(instrument);
  Result<std::unique_ptr<Server>> server = listen(address, *served, options);
  if (server) {
    (*server)->parts_->owned = std::move(served);
  }
  return server;
}

Server::Server(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Server::~Server() = default;

const std::string& Server::address() const noexcept {
  return parts_->listener.address();
}
Server::Statistics Server::statistics() const noexcept {
  return parts_->statistics;
}

void Server::press_button() noexcept {
  parts_->presses.fetch_add(1);
  parts_->wake_up();
}

Status Server::serve(const std::stop_token& stop) {
  const std::stop_callback wake_up(stop, [this] { parts_->wake_up(); });
  ServedDevice& device = parts_->device;
  Pace pace(device.clock_mode());
  while (!stop.stop_requested()) {
    parts_->accept_all();
    for (unsigned presses = parts_->presses.exchange(0); presses > 0; --presses) {
      device.press_button();
    }
    const Result<std::uint64_t> ran = device.run_ready();
    if (!ran) {
      return std::unexpected(ran.error());
    }
    const std::uint64_t wake = *ran;
    if (parts_->pump_host() || device.readable() > 0) {
      if (!parts_->host || !parts_->host->host_is_slow()) {
        continue;
      }
    }
    const bool host_is_slow = parts_->host && parts_->host->host_is_slow();
    // A wait of 0 looks at the sockets all the same, so that an endless run still hears its host.
    const std::uint64_t wait = pace.wait_us(device.now_us(), wake, host_is_slow);
    if (Status waited = parts_->wait(wait); !waited) {
      return waited;
    }
    if (const auto time = pace.time_after_wait()) {
      device.advance_to(*time);
    }
  }
  if (parts_->host) {
    parts_->host.reset();
    device.detach();
  }
  return {};
}

}  // namespace scatter::simulator
