// An endless bulk IN pipe through the USB/IP server, over loopback, with a minimal client in user space; the
// peer moves the same bytes from one plain socket to the other. Both readers do the same.
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <deque>
#include <memory>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "protocol/usb_identity.h"
#include "simulator/usbip/usbip_server.h"
#include "tests/bench/bench.h"
#include "tests/unit/simulator_usbip/usbip_client.h"

namespace {

using namespace scatter;
using namespace scatter::simulator;
using bench::Figure;

constexpr std::size_t kTransfer = 64UL * 1024;
constexpr std::size_t kInFlight = 16;
constexpr std::size_t kTransfersPerCall = 512;
constexpr std::size_t kHeader = 48;

/// A device that always has bytes.
class EndlessPort final : public UsbPort {
 public:
  void plug(UsbBusSpeed) override { plugged_ = true; }
  void unplug() override { plugged_ = false; }
  [[nodiscard]] bool plugged() const override { return plugged_; }
  [[nodiscard]] bool present() const override { return plugged_; }
  [[nodiscard]] std::uint32_t joins() const override { return 1; }
  void reset() override { done_.clear(); }
  void submit(UsbTransfer transfer) override {
    UsbCompletion completion{.id = transfer.id, .data = std::move(transfer.data)};
    if ((transfer.endpoint & 0x0FU) != 0) {
      completion.data.resize(transfer.length);
    } else if (transfer.setup[1] == 6) {
      const std::span<const std::uint8_t> descriptor = transfer.setup[3] == 1
                                                           ? std::span<const std::uint8_t>(kDevice)
                                                           : std::span<const std::uint8_t>(kConfiguration);
      const auto view = std::as_bytes(descriptor);
      completion.data.assign(view.begin(), view.end());
    }
    completion.actual = completion.data.size();
    done_.push_back(std::move(completion));
  }
  bool cancel(std::uint64_t) override { return false; }
  [[nodiscard]] std::optional<UsbCompletion> next_completion() override {
    if (done_.empty()) {
      return std::nullopt;
    }
    UsbCompletion first = std::move(done_.front());
    done_.pop_front();
    return first;
  }
  [[nodiscard]] std::size_t under_way() const override { return 0; }
  [[nodiscard]] bool host_is_slow() const override { return false; }

 private:
  static constexpr std::array<std::uint8_t, 18> kDevice{18,   1,  0, 2, 0, 0, 0, 64, 9,
                                                        0x12, 13, 0, 0, 1, 0, 0, 0,  1};
  static constexpr std::array<std::uint8_t, 18> kConfiguration{9, 2, 18, 0, 1, 1,    0, 0x80, 50,
                                                               9, 4, 0,  0, 0, 0xFF, 5, 1,    0};
  bool plugged_ = false;
  std::deque<UsbCompletion> done_;
};

class EndlessDevice final : public UsbIpDevice {
 public:
  [[nodiscard]] UsbPort& port() override { return port_; }
  [[nodiscard]] std::uint64_t run_ready() override { return 1'000'000; }
  [[nodiscard]] std::uint64_t now_us() const override { return 0; }
  [[nodiscard]] ClockMode clock_mode() const override { return ClockMode::kReal; }
  void advance_to(std::uint64_t) override {}
  void press_button() override {}

 private:
  EndlessPort port_;
};

/// One header and one transfer's data.
bool read_one(UsbIpClient& client, std::vector<std::byte>& room) {
  return client.receive_into(std::span(room).first(kHeader)) &&
         client.receive_into(std::span(room).subspan(kHeader));
}

/// Two connected TCP sockets on loopback.
std::pair<FileDescriptor, FileDescriptor> tcp_pair() {
  auto listener = Listener::open("tcp:127.0.0.1:0", false);
  if (!listener) {
    return {};
  }
  FileDescriptor one(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in place{};
  socklen_t size = sizeof place;
  ::getsockname(listener->number(), reinterpret_cast<sockaddr*>(&place), &size);
  (void)::connect(one.number(), reinterpret_cast<const sockaddr*>(&place), sizeof place);
  FileDescriptor other(::accept(listener->number(), nullptr, nullptr));
  return {std::move(one), std::move(other)};
}

std::vector<Figure> usbip_stream() {
  EndlessDevice device;
  const auto server = UsbIpServer::listen("tcp:127.0.0.1:0", device);
  auto [sender_socket, receiver_socket] = tcp_pair();
  if (!server || !sender_socket.open() || !receiver_socket.open()) {
    std::fprintf(stderr, "usbip.stream: no sockets on loopback\n");
    return {};
  }
  const std::jthread serving([&](const std::stop_token& stop) { (void)(*server)->serve(stop); });
  UsbIpClient client = UsbIpClient::to((*server)->address());
  if (client.import() != 0) {
    std::fprintf(stderr, "usbip.stream: the device cannot be imported\n");
    return {};
  }
  for (std::size_t k = 0; k < kInFlight; ++k) {
    (void)client.submit_in(protocol::usb::kBulkIn, kTransfer);
  }
  UsbIpClient sender(std::move(sender_socket));
  UsbIpClient receiver(std::move(receiver_socket));
  std::jthread sending([&](const std::stop_token& stop) {
    const std::vector<std::byte> message(kHeader + kTransfer);
    while (!stop.stop_requested()) {
      // Told what to send, so that it rests while the other one is measured.
      if (std::array<std::byte, 1> go{}; !sender.receive_into(go)) {
        return;
      }
      for (std::size_t k = 0; k < kTransfersPerCall; ++k) {
        sender.send(message);
      }
    }
  });
  std::vector<std::byte> room(kHeader + kTransfer);
  bool good = true;
  Figure figure =
      bench::run_contest("usbip.stream", {.unit = "MB/s",
                                          .work = 1e-6 * kTransfersPerCall * kTransfer,
                                          .ours =
                                              [&] {
                                                for (std::size_t k = 0; k < kTransfersPerCall; ++k) {
                                                  good = read_one(client, room) && good;
                                                  (void)client.submit_in(protocol::usb::kBulkIn, kTransfer);
                                                }
                                                bench::keep(room[kHeader]);
                                              },
                                          .peer = "plain socket",
                                          .theirs =
                                              [&] {
                                                receiver.send(std::array<std::byte, 1>{});
                                                for (std::size_t k = 0; k < kTransfersPerCall; ++k) {
                                                  good = read_one(receiver, room) && good;
                                                }
                                                bench::keep(room[kHeader]);
                                              }});
  sending.request_stop();
  receiver.close();
  if (!good) {
    std::fprintf(stderr, "usbip.stream: a connection broke\n");
    return {};
  }
  return {figure};
}

const bench::Benchmark kUsbIpStream{"usbip.stream", usbip_stream};

}  // namespace
