#include <catch2/catch.hpp>

#include "tests/unit/device/scripted_device.h"

namespace scatter::device::test {
namespace {

using namespace std::chrono_literals;
using protocol::Channel;
using protocol::MessageId;
using protocol::StatusCode;

TEST_CASE("Open says HELLO and reads the descriptor in chunks, checksum checked") {
  const Pair pair = open_pair();
  REQUIRE(pair.host);
  CHECK(pair.host->hello().serial.str() == "TEST-1");
  CHECK(pair.host->descriptor() == test_descriptor());
  CHECK(pair.device->executed[MessageId::kObjectRead] > 1);
}

TEST_CASE("The session nonce is the same when the transport's clock is the same") {
  const Pair first = open_pair();
  const Pair second = open_pair();
  REQUIRE(first.host);
  REQUIRE(second.host);
  CHECK(first.device->nonce == second.device->nonce);
  OpenOptions options;
  options.nonce = 77;
  const Pair third = open_pair({}, options);
  REQUIRE(third.host);
  CHECK(third.device->nonce == 77);
}

// PROVES: protocol.md 2, commands are at-most-once.
TEST_CASE("A request whose reply is lost is asked again and executed once") {
  for (int lost = 1; lost <= 4; ++lost) {
    Pair pair = open_pair();
    REQUIRE(pair.host);
    int left = lost;
    pair.device->script.outgoing = [&left](const protocol::FrameHeader& header, Bytes frame) {
      if (header.id() == MessageId::kConfigurationAccepted && left-- > 0) {
        return std::vector<Bytes>{};
      }
      return std::vector<Bytes>{std::move(frame)};
    };
    const auto configured = pair.host->configure(test_recipe(2), {.timeout = 20s, .stop = {}});
    REQUIRE(configured);
    CHECK(configured->epoch == 1);
    CHECK(pair.device->executed[MessageId::kSetConfiguration] == 1);
    CHECK(pair.device->heard[MessageId::kSetConfiguration] == lost + 1);
    CHECK(pair.device->epoch == 1);
  }
}

TEST_CASE("A lost request is repeated with growing pauses until the deadline") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  std::vector<Duration> sent;
  const TimePoint start = pair.device->now();
  pair.device->script.incoming = [&](const protocol::Frame&) {
    sent.push_back(pair.device->now() - start);
    return false;
  };
  const auto status = pair.host->status({.timeout = 5s, .stop = {}});
  REQUIRE_FALSE(status);
  CHECK(status.error().code == ErrorCode::kDeadlineExceeded);
  CHECK_FALSE(status.error().remedy.empty());
  CHECK(pair.device->now() - start == 5s);
  // 0.25 s, then twice as long each time, at most 2 s.
  CHECK(sent == std::vector<Duration>{0ms, 250ms, 750ms, 1750ms, 3750ms});
}

TEST_CASE("The session goes on after a deadline, and the late reply is not taken for another's") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  pair.device->script.request = [&](const protocol::Frame& frame) {
    if (frame.id() != MessageId::kGetStatus) {
      return false;
    }
    protocol::DeviceStatus late;
    late.run_id = 99;
    pair.device->answer(frame.header(), late, 1500ms);
    return true;
  };
  pair.device->script.incoming = [&](const protocol::Frame& frame) {
    return pair.device->heard[frame.id()] == 0;  // Repetitions are lost.
  };
  CHECK(pair.host->status({.timeout = 1s, .stop = {}}).error().code == ErrorCode::kDeadlineExceeded);
  pair.device->script = {};
  const auto again = pair.host->status({.timeout = 5s, .stop = {}});
  REQUIRE(again);
  CHECK(again->run_id == 0);
}

TEST_CASE("PENDING keeps the request waiting until its reply comes, executed once") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  pair.device->script.request = [&](const protocol::Frame& frame) {
    pair.device->answer_status(frame.header(), StatusCode::kPending, "", 3000);
    pair.device->answer(frame.header(), protocol::CalibrationPlaced{.placed = 1, .instruction = {}}, 2900ms);
    return true;
  };
  const auto placed =
      pair.host->calibration_step(1, protocol::Target::kWhiteReference, {.timeout = 10s, .stop = {}});
  REQUIRE(placed);
  CHECK(placed->placed == 1);
  CHECK(pair.device->executed[MessageId::kCalibrationStep] == 1);
}

TEST_CASE("A reply that arrives together with its PENDING is taken at once") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  Bytes together;
  pair.device->script.request = [&](const protocol::Frame& frame) {
    pair.device->answer_status(frame.header(), StatusCode::kPending, "", 5000);
    pair.device->answer_status(frame.header(), StatusCode::kOk);
    return true;
  };
  pair.device->script.outgoing = [&](const protocol::FrameHeader&, const Bytes& bytes) -> std::vector<Bytes> {
    const bool first = together.empty();
    together.insert(together.end(), bytes.begin(), bytes.end());
    return first ? std::vector<Bytes>() : std::vector<Bytes>{std::exchange(together, {})};
  };
  const TimePoint before = pair.host->now();
  REQUIRE(pair.host->calibration_restore_factory());
  CHECK(pair.host->now() - before < std::chrono::milliseconds(1));
}

TEST_CASE("PENDING for ever ends at the caller's deadline") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  pair.device->script.request = [&](const protocol::Frame& frame) {
    pair.device->answer_status(frame.header(), StatusCode::kPending, "", 0xFFFFFFFF);
    return true;
  };
  const TimePoint start = pair.device->now();
  const auto placed =
      pair.host->calibration_step(1, protocol::Target::kWhiteReference, {.timeout = 4s, .stop = {}});
  REQUIRE_FALSE(placed);
  CHECK(placed.error().code == ErrorCode::kDeadlineExceeded);
  CHECK(pair.device->now() - start == 4s);
}

TEST_CASE("A status reply becomes an error with the device's code and text and a remedy") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  pair.device->script.request = [&](const protocol::Frame& frame) {
    pair.device->answer_status(frame.header(), StatusCode::kPermissionDenied, "serial is read-only");
    return true;
  };
  const Status set = pair.host->set_key_value("serial", "X");
  REQUIRE_FALSE(set);
  CHECK(set.error().code == ErrorCode::kPermissionDenied);
  CHECK(set.error().what.find("serial is read-only") != std::string::npos);
  CHECK(set.error().remedy == protocol::info(StatusCode::kPermissionDenied).remedy);
}

TEST_CASE("A device in use is told by name, even though it names no session and hangs up") {
  const Pair pair = open_pair([](ScriptedDevice& device) {
    device.script.request = [&device](const protocol::Frame&) {
      protocol::StatusReply busy;
      busy.status = StatusCode::kBusy;
      busy.text = "the instrument is held by lab-2";
      device.nonce = 0;
      device.send(Channel::kControl, 0, busy);
      device.hang_up();
      return true;
    };
  });
  REQUIRE_FALSE(pair.host);
  CHECK(pair.host.error().code == ErrorCode::kBusy);
  CHECK(pair.host.error().what.find("lab-2") != std::string::npos);
}

TEST_CASE("The answer of a device that restarts counts, although the device was gone while it was asked") {
  Pair pair = open_pair();
  pair.device->script.request = [device = pair.device](const protocol::Frame& frame) {
    if (frame.id() != protocol::MessageId::kReboot) {
      return false;
    }
    device->answer_status(frame.header(), protocol::StatusCode::kOk);
    device->hang_up();
    return true;
  };
  CHECK(pair.host->reboot().has_value());
  CHECK(pair.host->status().error().code == ErrorCode::kDisconnected);
}

TEST_CASE("A device of another wire version is told apart from a broken one") {
  SECTION("by its refusal") {
    const Pair pair = open_pair([](ScriptedDevice& device) {
      device.script.request = [&device](const protocol::Frame& frame) {
        device.answer_status(frame.header(), StatusCode::kVersionMismatch, "speaks 2..3");
        return true;
      };
    });
    REQUIRE_FALSE(pair.host);
    CHECK(pair.host.error().code == ErrorCode::kVersionMismatch);
    CHECK(pair.host.error().what.find("this program is older") != std::string::npos);
  }
  SECTION("by frames of another major, which says the older side") {
    const std::uint8_t major = GENERATE(std::uint8_t{0}, std::uint8_t{2}, std::uint8_t{255});
    const Pair pair = open_pair([major](ScriptedDevice& device) {
      device.script.request = [&device, major](const protocol::Frame& frame) {
        protocol::FrameHeader header;
        header.wire_major = major;
        header.session = frame.header().session;
        header.correlation = frame.header().correlation;
        Bytes bytes(200);
        bytes.resize(protocol::write_frame(bytes, header, {}));
        device.send_raw(std::move(bytes));
        return true;
      };
    });
    REQUIRE_FALSE(pair.host);
    CHECK(pair.host.error().code == ErrorCode::kVersionMismatch);
    const std::string& what = pair.host.error().what;
    CHECK(what.find(major == 0 ? "firmware is older" : "this program is older") != std::string::npos);
    CHECK(what.find("wire version " + std::to_string(major)) != std::string::npos);
    CHECK_FALSE(pair.host.error().remedy.empty());
  }
}

TEST_CASE("A peer that sends garbage or hangs up ends open() in time with an error") {
  SECTION("garbage") {
    const Pair pair = open_pair([](ScriptedDevice& device) {
      device.script.request = [&device](const protocol::Frame&) {
        for (int k = 0; k < 50; ++k) {
          device.send_raw(Bytes(1000, static_cast<std::byte>(k % 3 == 0 ? 0xA7 : k)), 100ms * k);
        }
        return true;
      };
    });
    REQUIRE_FALSE(pair.host);
    CHECK(pair.host.error().code == ErrorCode::kDeadlineExceeded);
  }
  SECTION("hang-up") {
    const Pair pair = open_pair([](ScriptedDevice& device) { device.hang_up(); });
    REQUIRE_FALSE(pair.host);
    CHECK(pair.host.error().code == ErrorCode::kDisconnected);
  }
  SECTION("a frame that never ends") {
    const Pair pair = open_pair([](ScriptedDevice& device) {
      device.script.request = [&device](const protocol::Frame& frame) {
        protocol::FrameHeader header;
        header.session = frame.header().session;
        Bytes bytes(5000);
        bytes.resize(protocol::write_frame(bytes, header, Bytes(4000)));
        bytes.resize(200);
        device.send_raw(std::move(bytes));
        device.script.request = {};
        return true;
      };
    });
    // The claimed bytes are given up and the repeated HELLO is answered.
    REQUIRE(pair.host);
  }
}

TEST_CASE("Frames of an earlier session are discarded and counted") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  const std::uint16_t mine = pair.device->nonce;
  pair.device->nonce = static_cast<std::uint16_t>(mine + 1);
  pair.device->send(Channel::kEvent, 0, protocol::LogEvent{.level = 1, .device_time_us = 0, .text = "old"});
  pair.device->nonce = mine;
  REQUIRE(pair.host->status());
  CHECK(pair.host->take_events().empty());
  CHECK(pair.host->link_statistics().stale_frames == 1);
}

TEST_CASE("Events are kept for the caller, the newest 256 at most") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  for (std::uint32_t k = 0; k < 300; ++k) {
    pair.device->send(Channel::kEvent, 0,
                      protocol::LogEvent{.level = 1, .device_time_us = k, .text = "hello"});
  }
  REQUIRE(pair.host->status());
  const std::vector<DeviceEvent> events = pair.host->take_events();
  REQUIRE(events.size() == 256);
  CHECK(events.front().device_time_us == 44);
  CHECK(events.back().device_time_us == 299);
}

TEST_CASE("A stop request ends a wait with ABORTED") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  std::stop_source source;
  source.request_stop();
  const auto status = pair.host->status({.timeout = 5s, .stop = source.get_token()});
  REQUIRE_FALSE(status);
  CHECK(status.error().code == ErrorCode::kAborted);
}

TEST_CASE("An object with a wrong checksum or chunks that do not fit is refused") {
  const auto spoil = [](const std::function<void(protocol::ObjectChunk&)>& change) {
    const Pair pair = open_pair([&change](ScriptedDevice& device) {
      device.script.request = [&device, &change](const protocol::Frame& frame) {
        const auto read = frame.as<protocol::ObjectRead>();
        if (!read) {
          return false;
        }
        const Bytes bytes(50, std::byte{1});
        protocol::ObjectChunk chunk;
        chunk.object = read->object;
        chunk.offset = read->offset;
        chunk.total = 100;
        chunk.object_crc = 1;
        chunk.data = bytes;
        change(chunk);
        device.answer(frame.header(), chunk);
        return true;
      };
    });
    REQUIRE_FALSE(pair.host);
    return pair.host.error().code;
  };
  CHECK(spoil([](protocol::ObjectChunk&) {}) == ErrorCode::kDataLoss);
  CHECK(spoil([](protocol::ObjectChunk& c) { c.offset += 1; }) == ErrorCode::kDataLoss);
  CHECK(spoil([](protocol::ObjectChunk& c) { c.data = {}; }) == ErrorCode::kDataLoss);
  CHECK(spoil([](protocol::ObjectChunk& c) { c.total = 10; }) == ErrorCode::kDataLoss);
  CHECK(spoil([](protocol::ObjectChunk& c) { c.total = 0xFFFFFFFF; }) == ErrorCode::kResourceExhausted);
}

}  // namespace
}  // namespace scatter::device::test
