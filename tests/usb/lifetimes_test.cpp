// Whatever goes first, whenever it goes: no hang, no crash, no leak, no lost accounting.
#include <atomic>
#include <mutex>

#include "host_sdk/device/uri.h"
#include "host_sdk/device/usb/bus_scan.h"
#include "protocol/frame.h"
#include "protocol/schema_description.h"
#include "tests/usb/child.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using device::Device;
using integration::Outcome;
using integration::pattern_recipe;

namespace {

/// Until the end of the run or of the device.
std::optional<Error> drain(device::Stream& stream) {
  for (;;) {
    auto frame = stream.next();
    if (!frame) {
      return frame.error();
    }
    if (!*frame) {
      return std::nullopt;
    }
  }
}

/// After whatever happened: plugged in again, the instrument does a whole measurement.
void check_usable(Host& host) {
  host.bus().unplug();
  host.bus().plug();
  Device device = host.open_soon();
  check_whole(integration::run(device, pattern_recipe(3)), 3);
}

/// Every call says kDisconnected, in time.
void check_gone(Device& device) {
  const Clock::time_point begin = Clock::now();
  const auto status = device.status();
  REQUIRE_FALSE(status.has_value());
  CHECK(status.error().code == ErrorCode::kDisconnected);
  CHECK_FALSE(status.error().remedy.empty());
  CHECK(ms_since(begin) < 300);
}

}  // namespace

TEST_CASE("Unplugged while idle: the next call says so") {
  Host host;
  Device device = host.open();
  host.bus().unplug();
  check_gone(device);
  check_usable(host);
}

TEST_CASE("Unplugged in the middle of opening, at any point: an error or a device, never a hang") {
  Host host;
  for (int delay_us = 0; delay_us < 4000; delay_us += 200) {
    INFO(delay_us << " us after open began");
    std::jthread hand([&] {
      std::this_thread::sleep_for(std::chrono::microseconds(delay_us));
      host.bus().unplug();
    });
    const Clock::time_point begin = Clock::now();
    Result<Device> device = host.try_open();
    hand.join();
    CHECK(ms_since(begin) < 1000);
    if (device) {
      check_gone(*device);
    } else {
      const bool known =
          device.error().code == ErrorCode::kDisconnected || device.error().code == ErrorCode::kNotFound;
      CHECK(known);
      INFO(device.error().what);
    }
    host.bus().plug();
    (void)host.open_soon();
  }
}

TEST_CASE("Unplugged while configuring: kDisconnected, and the next session starts clean") {
  Host host;
  for (int delay_us = 0; delay_us < 1000; delay_us += 100) {
    Device device = host.open_soon();
    std::jthread hand([&] {
      std::this_thread::sleep_for(std::chrono::microseconds(delay_us));
      host.bus().unplug();
    });
    for (;;) {
      const auto configured = device.configure(pattern_recipe(5));
      if (!configured) {
        CHECK(configured.error().code == ErrorCode::kDisconnected);
        break;
      }
    }
    hand.join();
    host.bus().plug();
  }
  check_usable(host);
}

TEST_CASE("Unplugged in a run: frames that came are given out, then kDisconnected, and the ledger balances") {
  Host host;
  Device device = host.open();
  device::Stream stream = start_stream(device, endless_recipe());
  REQUIRE(stream.next().has_value());
  host.bus().unplug();
  const std::optional<Error> error = drain(stream);
  REQUIRE(error.has_value());
  CHECK(error->code == ErrorCode::kDisconnected);
  CHECK(stream.summary().ledger.balances());
  CHECK_FALSE(stream.summary().device_reported);
  check_gone(device);
  check_usable(host);
}

TEST_CASE("Unplugged while the device holds for credit") {
  Host host;
  Device device = host.open();
  device::Stream stream = start_stream(device, endless_recipe(), 1);
  REQUIRE(stream.next().has_value());
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // Nobody calls next(): the device holds.
  host.bus().unplug();
  const std::optional<Error> error = drain(stream);
  REQUIRE(error.has_value());
  CHECK(error->code == ErrorCode::kDisconnected);
  CHECK(stream.summary().ledger.balances());
  check_usable(host);
}

TEST_CASE("Unplugged while calibrating") {
  Host host;
  Device device = host.open();
  const auto begun = device.calibration_begin();
  REQUIRE(begun.has_value());
  host.bus().unplug();
  const auto placed = device.calibration_step(begun->session, protocol::Target::kWhiteReference);
  REQUIRE_FALSE(placed.has_value());
  CHECK(placed.error().code == ErrorCode::kDisconnected);
  check_usable(host);
}

TEST_CASE("Two instruments: stopping one leaves the other's frames whole") {
  Host host;
  const int second = host.bus().add_instrument("seed=77");
  host.bus().plug(second);
  REQUIRE(soon([&] { return device::usb::scan_bus().size() == 2; }));
  Device one = host.open("usb:port=1-1");
  Device two = host.open_soon("usb:port=2-1");
  Outcome other;
  device::Stream stream = start_stream(one, endless_recipe());
  REQUIRE(stream.next().has_value());
  std::jthread beside([&] { other = integration::run(two, pattern_recipe(300)); });
  REQUIRE(stream.next().has_value());
  REQUIRE(stream.stop().has_value());
  CHECK_FALSE(drain(stream).has_value());
  CHECK(stream.summary().ledger.balances());
  beside.join();
  check_whole(other, 300);
  host.bus().unplug(second);
}

TEST_CASE("Two instruments and no name: the error lists both") {
  Host host;
  const int second = host.bus().add_instrument("seed=78");
  host.bus().plug(second);
  REQUIRE(soon([&] { return device::usb::scan_bus().size() == 2; }));
  Result<Device> device = host.try_open();
  REQUIRE_FALSE(device.has_value());
  CHECK(device.error().code == ErrorCode::kInvalidArgument);
  const std::string said = device.error().what + device.error().remedy;
  CHECK(said.find("SIM-0000004e") != std::string::npos);  // 78
  CHECK(said.find("SIM-00000001") != std::string::npos);
  host.bus().unplug(second);
}

TEST_CASE("stop() from inside the loop that takes frames ends the run with a balanced ledger") {
  Host host;
  Device device = host.open();
  device::Stream stream = start_stream(device, endless_recipe());
  int taken = 0;
  for (;;) {
    auto frame = stream.next();
    REQUIRE(frame.has_value());
    if (!*frame) {
      break;
    }
    if (++taken == 5) {
      REQUIRE(stream.stop().has_value());
    }
  }
  CHECK(stream.summary().ledger.balances());
  check_whole(integration::run(device, pattern_recipe(3)), 3);
}

TEST_CASE("request_stop() from another thread ends the run with a balanced ledger") {
  Host host;
  Device device = host.open();
  for (int k = 0; k < 20; ++k) {
    device::Stream stream = start_stream(device, endless_recipe());
    std::jthread other([&] {
      std::this_thread::sleep_for(std::chrono::microseconds(500 * k));
      stream.request_stop();
    });
    CHECK_FALSE(drain(stream).has_value());
    CHECK(stream.summary().ledger.balances());
  }
}

TEST_CASE("Inside a Watch's call an instrument can be opened, used, closed and stopped") {
  Host host;
  std::mutex mutex;
  std::vector<std::string> said;
  std::atomic<int> measured = 0;
  host.bus().unplug();
  {
    const device::usb::Watch watch = host.context().watch([&](const device::usb::Change& change) {
      const std::scoped_lock lock(mutex);
      said.push_back((change.kind == device::usb::Change::Kind::kArrived ? "arrived " : "left ") +
                     change.uri);
      if (change.kind == device::usb::Change::Kind::kArrived) {
        if (Result<Device> device = host.try_open(change.uri)) {
          if (device->configure(pattern_recipe(65535))) {
            if (auto stream = device->start()) {
              const bool good = stream->next().has_value() && stream->stop().has_value();
              measured += good ? 1 : 0;
            }
          }
        }
      }
    });
    host.bus().plug();
    CHECK(soon([&] { return measured == 1; }));
    host.bus().unplug();
    CHECK(soon([&] {
      const std::scoped_lock lock(mutex);
      return said.size() == 2;
    }));
  }
  CHECK(said == std::vector<std::string>{"arrived usb:serial=SIM-00000001", "left usb:serial=SIM-00000001"});
  host.bus().plug();
}

TEST_CASE("A Watch that is destroyed inside its own call is not called again") {
  Host host;
  std::atomic<int> calls = 0;
  std::optional<device::usb::Watch> watch;
  watch.emplace(host.context().watch([&](const device::usb::Change&) {
    watch.reset();
    ++calls;
  }));
  host.bus().unplug();
  CHECK(soon([&] { return calls == 1; }));
  host.bus().plug();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  CHECK(calls == 1);
}

TEST_CASE("The context may be destroyed first: devices go on as long as they live, or end as disconnected") {
  Host host;
  Device device = host.open();
  device::Stream stream = start_stream(device, endless_recipe());
  REQUIRE(stream.next().has_value());
  const Clock::time_point begin = Clock::now();
  host.destroy_context();
  CHECK(ms_since(begin) < 200);
  const std::optional<Error> error = drain(stream);
  REQUIRE(error.has_value());
  CHECK(error->code == ErrorCode::kDisconnected);
  CHECK(stream.summary().ledger.balances());
}

TEST_CASE("Destroyed in the middle of a stream, in any order, at any moment: nothing is left under way") {
  for (int k = 0; k < 40; ++k) {
    INFO("round " << k);
    Host host;
    auto device = std::make_unique<Device>(host.open());
    auto stream = std::make_unique<device::Stream>(start_stream(*device, endless_recipe()));
    for (int frames = 0; frames < k % 4; ++frames) {
      REQUIRE(stream->next().has_value());
    }
    if (k % 2 == 0) {
      stream.reset();
      device.reset();
    } else {
      host.destroy_context();
      stream.reset();
      device.reset();
    }
  }
}

TEST_CASE(
    "A program killed in the middle of a stream leaves the instrument stopped, and free for the next at "
    "once") {
  Host host;
  host.bus().allow_abandoned();
  for (int k = 0; k < 5; ++k) {
    Child holder({SCATTER_USB_HOLDER, "usb:"});
    REQUIRE(holder.line() == "streaming");
    holder.kill();
    const Clock::time_point begin = Clock::now();
    Device device = host.open_soon();
    CHECK(ms_since(begin) < 1000);
    const auto status = device.status();
    REQUIRE(status.has_value());
    CHECK(status->run_state == static_cast<std::uint8_t>(protocol::RunState::kIdle));
    check_whole(integration::run(device, pattern_recipe(3)), 3);
  }
}

TEST_CASE("A restart is answered before the instrument leaves the bus, every time") {
  Host host;
  // With a clock that does not wait for the host, the instrument is gone while the answer is on its way.
  const int second = host.bus().add_instrument("seed=5&clock=real");
  host.bus().plug(second);
  for (int k = 0; k < 20; ++k) {
    INFO("restart " << k);
    Device device = host.open_soon("usb:serial=SIM-00000005");
    REQUIRE(device.reboot().has_value());
  }
  host.bus().unplug(second);
}

TEST_CASE("What the device sent before it left is received, however late the kernel gives it back") {
  Host host;
  const auto uri = device::parse_uri("usb:");
  const device::Wait wait;
  auto transport = host.context().open(*uri, wait);
  REQUIRE(transport.has_value());
  std::vector<std::byte> out(protocol::kMaxFrameBytes);
  const auto ask = [&](const auto& message) {
    const std::size_t size =
        protocol::write_message(std::span(out), {.session = 77, .correlation = 1}, message);
    REQUIRE(
        (*transport)->write(std::span(out).first(size), (*transport)->now() + wait.timeout, {}).has_value());
  };
  const auto receive = [&] { return (*transport)->receive((*transport)->now() + wait.timeout, {}); };
  ask(protocol::Hello{.schema_digest = protocol::schema_digest()});
  REQUIRE(
      receive().has_value());  // Its memory is handed in again by the next call, which the kernel refuses.
  const std::uint64_t before = host.bus().statistics()["bytes_in"];
  host.bus().hold_received(true);
  ask(protocol::GetStatus{});
  REQUIRE(soon([&] { return host.bus().statistics()["bytes_in"] > before; }));
  host.bus().unplug();
  const std::jthread kernel([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    BusControl().hold_received(false);
  });
  const auto last = receive();
  REQUIRE(last.has_value());
  const auto parsed = protocol::parse_frame(*last);
  REQUIRE(parsed.frame.has_value());
  CHECK(parsed.frame->as<protocol::DeviceStatus>().has_value());
  const auto after = receive();
  REQUIRE_FALSE(after.has_value());
  CHECK(after.error().code == ErrorCode::kDisconnected);
  host.bus().plug();
}

TEST_CASE("A request that the bus is slow to carry is late, and the instrument is used as before") {
  Host host;
  Device device = host.open();
  host.bus().hold_sent(true);
  const auto late = device.status({.timeout = std::chrono::milliseconds(300), .stop = {}});
  REQUIRE_FALSE(late.has_value());
  CHECK(late.error().code == ErrorCode::kDeadlineExceeded);
  const auto later = device.status({.timeout = std::chrono::milliseconds(100), .stop = {}});
  REQUIRE_FALSE(later.has_value());
  CHECK(later.error().code == ErrorCode::kDeadlineExceeded);
  host.bus().hold_sent(false);
  CHECK(device.status().has_value());
  check_whole(integration::run(device, pattern_recipe(3)), 3);
}
