#include "simulator/usbip/usbip_server.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "simulator/instrument/listener.h"
#include "simulator/instrument/pace.h"
#include "simulator/instrument/virtual_instrument.h"
#include "simulator/usbip/client.h"
#include "simulator/usbip/exported_device.h"
#include "simulator/usbip/vhci_bus.h"

namespace scatter::simulator {

using usbip::Client;
using usbip::ExportedDevice;

struct UsbIpServer::Parts {
  Parts(UsbIpDevice& its_device, const UsbIpOptions& its_options, Listener its_listener)
      : device(its_device),
        options(its_options),
        listener(std::move(its_listener)),
        address("usbip:" + listener.address().substr(listener.address().find(':') + 1)),
        wake(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        exported(device.port(), options.speed) {}

  std::unique_ptr<UsbIpDevice> owned;  ///< `device`, where it is an adapter of ours; goes last.
  UsbIpDevice& device;
  UsbIpOptions options;
  Listener listener;
  std::string address;
  FileDescriptor wake;
  std::atomic<unsigned> presses{0};
  ExportedDevice exported;
  std::vector<std::unique_ptr<Client>> clients;
  const Client* own_bus = nullptr;  ///< Among the clients: this machine's kernel.
  bool detached_by_user = false;    ///< From this machine's bus; respected until the server ends.
  Statistics statistics;

  void accept_all();
  void adopt(FileDescriptor socket, std::string peer, Client::Role role);
  [[nodiscard]] Status plug_in();
  [[nodiscard]] bool pump();
  void count(const Client& client);
  [[nodiscard]] bool host_is_slow() const;
  [[nodiscard]] Status wait(std::uint64_t microseconds);
  void wake_up() const noexcept {
    const std::uint64_t one = 1;
    (void)!::write(wake.number(), &one, sizeof one);
  }
};

namespace {

constexpr std::size_t kMostClients = 8;
constexpr int kFirstTurns = 100;

class ServedInstrument final : public UsbIpDevice {
 public:
  ServedInstrument(VirtualInstrument& instrument, UsbPort& port) : instrument_(instrument), port_(port) {}
  [[nodiscard]] UsbPort& port() override { return port_; }
  [[nodiscard]] std::uint64_t run_ready() override { return instrument_.run_ready(); }
  [[nodiscard]] std::uint64_t now_us() const override { return instrument_.now_us(); }
  [[nodiscard]] ClockMode clock_mode() const override { return instrument_.clock_mode(); }
  void advance_to(std::uint64_t time_us) override { instrument_.advance_to(time_us); }
  void press_button() override { instrument_.press_button(); }

 private:
  VirtualInstrument& instrument_;
  UsbPort& port_;
};

}  // namespace

void UsbIpServer::Parts::accept_all() {
  while (true) {
    std::string peer;
    FileDescriptor connection = listener.accept(peer);
    if (!connection.open()) {
      return;
    }
    // A holder that has left makes room for the next at once.
    (void)pump();
    if (clients.size() < kMostClients) {
      adopt(std::move(connection), std::move(peer), Client::Role::kStranger);
    }
  }
}

void UsbIpServer::Parts::adopt(FileDescriptor socket, std::string peer, Client::Role role) {
  ++statistics.connections;
  clients.push_back(std::make_unique<Client>(std::move(socket), std::move(peer), exported, role));
}

Status UsbIpServer::Parts::plug_in() {
  if (options.plug_into == nullptr || detached_by_user || exported.held() || exported.record() == nullptr) {
    return {};
  }
  const usbip::DeviceRecord& record = *exported.record();
  Result<VhciBus::Attached> attached =
      options.plug_into->attach(record.id(), static_cast<std::uint32_t>(record.speed));
  if (!attached) {
    return std::unexpected(std::move(attached.error()));
  }
  if (exported.import(ExportedDevice::kBusId) == usbip::OpStatus::kOk) {
    adopt(std::move(attached->connection), fmt::format("this machine's bus, port {}", attached->port),
          Client::Role::kHolder);
    own_bus = clients.back().get();
  }
  return {};
}

void UsbIpServer::Parts::count(const Client& client) {
  const Client::Counts& counts = client.counts();
  statistics.imports += counts.imports;
  statistics.refused_imports += counts.refused_imports;
  statistics.transfers += counts.transfers;
  statistics.bytes_to_host += counts.bytes_to_host;
  statistics.bytes_to_device += counts.bytes_to_device;
  if (!client.problem().empty()) {
    ++statistics.broken;
    statistics.last_problem = fmt::format("{}: {}", client.peer(), client.problem());
  }
}

/// True when the device has something to do.
bool UsbIpServer::Parts::pump() {
  bool moved = exported.poll();
  std::erase_if(clients, [&](const std::unique_ptr<Client>& each) {
    if (each->pump(moved) == Client::State::kOpen) {
      return false;
    }
    if (each.get() == own_bus) {
      own_bus = nullptr;
      detached_by_user = !exported.left();
    }
    moved = moved || each->holds();
    count(*each);
    return true;
  });
  return moved;
}

bool UsbIpServer::Parts::host_is_slow() const {
  return device.port().host_is_slow() ||
         std::ranges::any_of(clients, [](const auto& each) { return each->holds() && each->is_slow(); });
}

Status UsbIpServer::Parts::wait(std::uint64_t microseconds) {
  std::vector<pollfd> files{{wake.number(), POLLIN, 0}, {listener.number(), POLLIN, 0}};
  for (const auto& each : clients) {
    files.push_back({each->number(), each->wanted_events(), 0});
  }
  if (!clients.empty()) {
    microseconds = std::min<std::uint64_t>(microseconds, 100'000);  // Their patience ends by the clock.
  }
  const timespec timeout{static_cast<time_t>(microseconds / 1'000'000),
                         static_cast<long>(microseconds % 1'000'000 * 1000)};
  if (::ppoll(files.data(), files.size(), &timeout, nullptr) < 0 && errno != EINTR) {
    return fail(ErrorCode::kInternal, fmt::format("{}: poll: {}", address, std::strerror(errno)),
                "start the server again");
  }
  std::uint64_t ignored = 0;
  (void)!::read(wake.number(), &ignored, sizeof ignored);
  return {};
}

Result<std::unique_ptr<UsbIpServer>> UsbIpServer::listen(std::string_view address, UsbIpDevice& device,
                                                         const UsbIpOptions& options) {
  if (!address.starts_with("tcp:")) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("\"{}\": USB/IP is served over TCP, expected tcp:HOST:PORT", address),
                "listen on tcp:127.0.0.1:3240");
  }
  if (options.plug_into != nullptr) {
    if (Status usable = options.plug_into->check(); !usable) {
      return std::unexpected(std::move(usable.error()));
    }
  }
  Result<Listener> listener = Listener::open(address, options.allow_remote);
  if (!listener) {
    return std::unexpected(std::move(listener.error()));
  }
  auto parts = std::make_unique<Parts>(device, options, std::move(*listener));
  // So that the first client finds it; a device that needs longer is found later.
  for (int k = 0; k < kFirstTurns && parts->exported.record() == nullptr; ++k) {
    (void)device.run_ready();
    (void)parts->exported.poll();
  }
  return std::unique_ptr<UsbIpServer>(new UsbIpServer(std::move(parts)));
}

Result<std::unique_ptr<UsbIpServer>> UsbIpServer::listen(std::string_view address,
                                                         VirtualInstrument& instrument,
                                                         const UsbIpOptions& options) {
  UsbPort* port = instrument.usb();
  if (port == nullptr) {
    return fail(ErrorCode::kFailedPrecondition, "the simulated instrument has no USB socket",
                "make it with the carrier USB");
  }
  auto served = std::make_unique<ServedInstrument>(instrument, *port);
  Result<std::unique_ptr<UsbIpServer>> server = listen(address, *served, options);
  if (server) {
    (*server)->parts_->owned = std::move(served);
  }
  return server;
}

UsbIpServer::UsbIpServer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
UsbIpServer::~UsbIpServer() = default;

const std::string& UsbIpServer::address() const noexcept {
  return parts_->address;
}
std::string_view UsbIpServer::bus_id() noexcept {
  return ExportedDevice::kBusId;
}

UsbIpServer::Statistics UsbIpServer::statistics() const {
  return parts_->statistics;
}

void UsbIpServer::adopt(FileDescriptor socket, std::string peer) {
  parts_->adopt(std::move(socket), std::move(peer), Client::Role::kStranger);
}

void UsbIpServer::press_button() noexcept {
  parts_->presses.fetch_add(1);
  parts_->wake_up();
}

Status UsbIpServer::serve(const std::stop_token& stop) {
  Parts& parts = *parts_;
  const std::stop_callback wake_up(stop, [&parts] { parts.wake_up(); });
  UsbIpDevice& device = parts.device;
  Pace pace(device.clock_mode());
  while (!stop.stop_requested()) {
    parts.accept_all();
    for (unsigned presses = parts.presses.exchange(0); presses > 0; --presses) {
      device.press_button();
    }
    const std::uint64_t wake = device.run_ready();
    const bool moved = parts.pump();
    if (Status plugged = parts.plug_in(); !plugged) {
      return plugged;
    }
    if (moved) {
      continue;
    }
    const bool slow = parts.host_is_slow();
    // A wait of 0 looks at the sockets all the same, so that an endless run still hears its host.
    if (Status waited = parts.wait(pace.wait_us(device.now_us(), wake, slow)); !waited) {
      return waited;
    }
    if (const auto time = pace.time_after_wait()) {
      device.advance_to(*time);
    }
  }
  for (const auto& each : parts.clients) {
    parts.count(*each);
  }
  parts.clients.clear();
  parts.own_bus = nullptr;
  (void)device.run_ready();
  return {};
}

}  // namespace scatter::simulator
