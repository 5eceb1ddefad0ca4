// The whole instrument behind a USB/IP server, with a client in user space.
#include "simulator/usbip/usbip_server.h"

#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "protocol/link_decoder.h"
#include "protocol/rescue_report.h"
#include "protocol/usb_identity.h"
#include "simulator/instrument/virtual_instrument.h"
#include "tests/unit/simulator_usbip/scripted_port.h"
#include "tests/unit/simulator_usbip/usbip_client.h"

namespace {

using namespace scatter;
using namespace scatter::simulator;
namespace usb = scatter::protocol::usb;
using Setup = UsbIpClient::Setup;

constexpr Setup kSetConfiguration{0x00, 9, 1, 0, 0, 0, 0, 0};
constexpr Setup kOpenStream{0x01, 11, usb::kStreamOpenSetting, 0, usb::kStreamInterface, 0, 0, 0};

/// An instrument served by a thread of its own.
class Served {
 public:
  explicit Served(std::string_view query = "", UsbIpOptions options = {}) {
    auto which = parse_instrument_options(query);
    REQUIRE(which.has_value());
    which->carrier = Carrier::kUsb;
    auto instrument = VirtualInstrument::make(*which);
    REQUIRE(instrument.has_value());
    instrument_ = std::move(*instrument);
    auto server = UsbIpServer::listen("tcp:127.0.0.1:0", *instrument_, options);
    REQUIRE(server.has_value());
    server_ = std::move(*server);
  }
  ~Served() { (void)stop(); }
  void start() {
    thread_ = std::jthread([this](const std::stop_token& stop) { served_ = server_->serve(stop); });
  }
  UsbIpServer::Statistics stop() {
    if (thread_.joinable()) {
      thread_.request_stop();
      thread_.join();
      CHECK(served_.has_value());
    }
    return server_->statistics();
  }
  UsbIpServer& server() { return *server_; }
  UsbIpClient connect() {
    if (!thread_.joinable()) {
      start();
    }
    return UsbIpClient::to(server_->address());
  }
  /// Imported; the moment in which the device is off the bus is waited out.
  UsbIpClient import() {
    for (int k = 0; k < 500; ++k) {
      UsbIpClient client = connect();
      if (client.import() == 0) {
        return client;
      }
      ::poll(nullptr, 0, 10);
    }
    FAIL("the device cannot be imported");
    return connect();
  }

 private:
  std::unique_ptr<VirtualInstrument> instrument_;
  std::unique_ptr<UsbIpServer> server_;
  Status served_;
  std::jthread thread_;
};

/// Wire frames over the bulk endpoints, with transfers waiting for the device as a host program keeps them.
class Wire {
 public:
  explicit Wire(UsbIpClient& client) : client_(client) {
    for (int k = 0; k < 8; ++k) {
      (void)client_.submit_in(usb::kBulkIn, usb::kTransferBytes);
    }
  }
  template <typename M>
  std::uint16_t send(const M& message) {
    std::vector<std::byte> bytes(protocol::kMaxFrameBytes);
    bytes.resize(protocol::write_message(
        bytes, {.sequence = sequence_++, .session = 77, .correlation = ++correlation_}, message));
    (void)client_.submit_out(usb::kBulkOut, bytes);
    return correlation_;
  }
  /// Until it returns true, or the connection ends (false).
  bool listen(const std::function<bool(const protocol::Frame&)>& on_frame) {
    bool done = false;
    while (!done) {
      const auto reply = client_.next();
      if (!reply) {
        return false;
      }
      if (reply->data.empty()) {
        continue;
      }
      const bool cut = reply->status == -ESHUTDOWN;  // What had come when the cable was pulled.
      CHECK((cut || reply->status == 0));
      decoder_.push(reply->data, [&](const protocol::Frame& frame) {
        // Each wire frame is one transfer, so that it lies whole in one buffer (SPEC.md 11).
        CHECK((cut || frame.bytes().size() == reply->data.size()));
        done = on_frame(frame) || done;
      });
      (void)client_.submit_in(usb::kBulkIn, usb::kTransferBytes);
    }
    return true;
  }
  template <typename R, typename M>
  std::optional<R> ask(const M& message) {
    const std::uint16_t correlation = send(message);
    std::optional<R> answer;
    listen([&](const protocol::Frame& frame) {
      if (frame.header().correlation == correlation) {
        answer = frame.as<R>();
      }
      return frame.header().correlation == correlation;
    });
    return answer;
  }

 private:
  UsbIpClient& client_;
  std::uint32_t sequence_ = 0;
  std::uint16_t correlation_ = 0;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(protocol::kMaxFrameBytes);
  protocol::LinkDecoder decoder_{buffer_};
};

protocol::Recipe small_recipe() {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1000);
  recipe.repeats = 5;
  recipe.region_width = recipe.region_height = 64;
  recipe.test_pattern = 1;
  return recipe;
}

void start_run(Wire& wire) {
  REQUIRE(wire.ask<protocol::HelloReply>(protocol::Hello{}).has_value());
  const auto accepted =
      wire.ask<protocol::ConfigurationAccepted>(protocol::SetConfiguration{.recipe = small_recipe()});
  REQUIRE(accepted.has_value());
  wire.send(protocol::Start{.epoch = accepted->epoch, .may_send_until = 1000});
}

TEST_CASE("A host enumerates, opens the stream, says HELLO and gets every frame of a run") {
  Served served("seed=7");
  UsbIpClient client = served.connect();
  const auto listed = client.list();
  REQUIRE(listed.has_value());
  REQUIRE(listed->size() == 312 + 3 * 4);  // Stream, rescue channel, DFU.
  REQUIRE(client.import() == 0);

  const auto device = client.control({0x80, 6, 0, 1, 0, 0, 18, 0});
  REQUIRE(device.has_value());
  REQUIRE(device->data.size() == 18);
  CHECK(device->data[8] == std::byte{0x09});
  CHECK(device->data[9] == std::byte{0x12});
  CHECK(device->data[10] == std::byte{0x0D});
  const auto configuration = client.control({0x80, 6, 0, 2, 0, 0, 9, 0});
  REQUIRE(configuration.has_value());
  CHECK(configuration->data.size() == 9);
  REQUIRE(client.control(kSetConfiguration)->status == 0);
  REQUIRE(client.control(kOpenStream)->status == 0);

  Wire wire(client);
  start_run(wire);
  int begins = 0;
  int ends = 0;
  std::size_t bytes = 0;
  REQUIRE(wire.listen([&](const protocol::Frame& frame) {
    begins += frame.as<protocol::FrameBegin>() ? 1 : 0;
    ends += frame.as<protocol::FrameEnd>() ? 1 : 0;
    if (const auto data = frame.as<protocol::FrameData>()) {
      bytes += data->data.size();
    }
    return frame.as<protocol::RunFinished>().has_value();
  }));
  CHECK(begins == 5);
  CHECK(ends == 5);
  CHECK(bytes == 5UL * 64 * 64 * 2);
  client.close();
  const auto statistics = served.stop();
  CHECK(statistics.imports == 1);
  CHECK(statistics.broken == 0);
}

TEST_CASE("The list is there beside a holder, and a second import is told that the device is busy") {
  Served served;
  UsbIpClient holder = served.import();
  UsbIpClient other = served.connect();
  CHECK(other.list()->size() == 312 + 3 * 4);
  CHECK(other.import() == 2);
  CHECK(other.import("2-1") == 4);
  CHECK(holder.control(kSetConfiguration)->status == 0);
  holder.close();
  CHECK(served.import().control(kSetConfiguration)->status == 0);
  CHECK(served.stop().refused_imports >= 2);
}

TEST_CASE("Transfers are stopped while they wait, and after a bulk halt requests go on") {
  Served served;
  UsbIpClient client = served.import();
  REQUIRE(client.control(kSetConfiguration)->status == 0);
  REQUIRE(client.control(kOpenStream)->status == 0);
  const std::uint32_t bulk = client.submit_in(usb::kBulkIn, 4096);
  const std::uint32_t report = client.submit_in(usb::kRescueIn, 64);
  for (const std::uint32_t victim : {bulk, report}) {
    const auto stopped = client.wait_for(client.unlink(victim));
    REQUIRE(stopped.has_value());
    CHECK(stopped->to_unlink);
    CHECK(stopped->status == -ECONNRESET);
  }
  const auto late = client.wait_for(client.unlink(bulk));
  CHECK(late->status == 0);
  // SET_FEATURE(ENDPOINT_HALT): a transfer ends with EPIPE until CLEAR_FEATURE.
  REQUIRE(client.control({0x02, 3, 0, 0, usb::kBulkIn, 0, 0, 0})->status == 0);
  CHECK(client.wait_for(client.submit_in(usb::kBulkIn, 512))->status == -EPIPE);
  REQUIRE(client.control({0x02, 1, 0, 0, usb::kBulkIn, 0, 0, 0})->status == 0);
  CHECK(client.control({0x80, 6, 0, 99, 0, 0, 4, 0})->status == -EPIPE);   // No such descriptor.
  CHECK(client.wait_for(client.submit_in(0x85, 512))->status == -EPROTO);  // No such endpoint.
}

TEST_CASE("DETACH makes the device leave the bus, which ends the connection, and come back in DFU mode") {
  Served served;
  UsbIpClient client = served.import();
  REQUIRE(client.control(kSetConfiguration)->status == 0);
  const auto detached = client.control({0x21, 0, 0xE8, 0x03, usb::kDfuInterface, 0, 0, 0});
  REQUIRE(detached.has_value());
  CHECK(detached->status == 0);  // The status stage reaches the host before the device is gone.
  CHECK_FALSE(client.next().has_value());
  CHECK(client.ended());
  UsbIpClient again = served.import();
  const auto device = again.control({0x80, 6, 0, 1, 0, 0, 18, 0});
  REQUIRE(device.has_value());
  CHECK(device->data[10] == std::byte{0x0E});
  // A host that asks and sends nothing: the next bus reset brings it back to its firmware: another device for
  // the host.
  REQUIRE(again.control(kSetConfiguration)->status == 0);
  REQUIRE(again.control({0xA1, 3, 0, 0, usb::kDfuModeInterface, 0, 6, 0})->data.size() == 6);  // GETSTATUS
  (void)again.control(kSetConfiguration);
  CHECK_FALSE(again.next().has_value());
  CHECK(again.ended());
  UsbIpClient last = served.import();
  CHECK(last.control({0x80, 6, 0, 1, 0, 0, 18, 0})->data[10] == std::byte{0x0D});
}

TEST_CASE("A fault that pulls the cable ends the connection, and the next host finds the instrument") {
  Served served("fault=disconnect:20000");
  UsbIpClient client = served.import();
  REQUIRE(client.control(kSetConfiguration)->status == 0);
  REQUIRE(client.control(kOpenStream)->status == 0);
  Wire wire(client);
  start_run(wire);
  CHECK_FALSE(wire.listen([](const protocol::Frame&) { return false; }));
  CHECK(client.ended());
  UsbIpClient next = served.import();
  CHECK(next.control(kSetConfiguration)->status == 0);
}

TEST_CASE("A press of the button is reported on the rescue channel") {
  Served served;
  UsbIpClient client = served.import();
  REQUIRE(client.control(kSetConfiguration)->status == 0);
  std::uint32_t presses = 0;
  served.server().press_button();
  served.server().press_button();
  while (presses < 2) {
    const auto report = client.wait_for(client.submit_in(usb::kRescueIn, 64));
    REQUIRE(report.has_value());
    const auto status = protocol::decode_rescue_status(report->data);
    REQUIRE(status.has_value());
    presses = status->button_presses;
  }
  CHECK(presses == 2);
}

TEST_CASE("Bytes that are no USB/IP end that connection alone") {
  Served served;
  UsbIpClient holder = served.import();
  UsbIpClient hostile = served.connect();
  hostile.send(std::as_bytes(std::span("GET / HTTP/1.1\r\n\r\n")));
  CHECK_FALSE(hostile.receive(1).has_value());
  CHECK(hostile.ended());
  CHECK(holder.control(kSetConfiguration)->status == 0);
  const auto statistics = served.stop();
  CHECK(statistics.broken == 1);
  CHECK_THAT(statistics.last_problem, Catch::Matchers::Contains("version"));
}

TEST_CASE("A client over a connection that is there already is served like one from the network") {
  Served served;
  std::array<int, 2> pair{};
  REQUIRE(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) == 0);
  served.server().adopt(FileDescriptor(pair[0]), "a test");
  UsbIpClient client{FileDescriptor(pair[1])};
  served.start();
  REQUIRE(client.import() == 0);
  CHECK(client.control(kSetConfiguration)->status == 0);
}

TEST_CASE("A server refuses what it cannot serve, with a remedy") {
  const auto refused = [](std::string_view address, Carrier carrier) {
    auto which = parse_instrument_options("");
    which->carrier = carrier;
    const auto instrument = VirtualInstrument::make(*which);
    const auto server = UsbIpServer::listen(address, **instrument);
    REQUIRE_FALSE(server.has_value());
    CHECK_FALSE(server.error().remedy.empty());
    return server.error().code;
  };
  CHECK(refused("tcp:127.0.0.1:0", Carrier::kPipe) == ErrorCode::kFailedPrecondition);
  CHECK(refused("unix:somewhere", Carrier::kUsb) == ErrorCode::kInvalidArgument);
  CHECK(refused("tcp:0.0.0.0:0", Carrier::kUsb) == ErrorCode::kInvalidArgument);
}

}  // namespace
