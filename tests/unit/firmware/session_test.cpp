#include <catch2/catch.hpp>

#include "tests/unit/firmware/fake_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

template <typename... M>
std::vector<std::uint16_t> request_ids(const std::tuple<M...>*) {
  std::vector<std::uint16_t> ids;
  ((static_cast<std::uint16_t>(M::kId) < 0x0100 ? ids.push_back(static_cast<std::uint16_t>(M::kId)) : void()),
   ...);
  return ids;
}

/// Sends a control frame with any id and payload.
std::uint16_t send_raw(FakeBoard& board, std::uint16_t session, std::uint16_t id, std::uint16_t correlation,
                       std::span<const std::byte> payload, std::uint8_t flags = 0,
                       std::uint8_t major = kWireMajor) {
  FrameHeader header;
  header.message = id;
  header.session = session;
  header.correlation = correlation;
  header.incompatible_flags = flags;
  header.wire_major = major;
  std::vector<std::byte> bytes(payload.size() + kFrameOverhead);
  REQUIRE(write_frame(bytes, header, payload) == bytes.size());
  board.link.to_device.insert(board.link.to_device.end(), bytes.begin(), bytes.end());
  return correlation;
}

}  // namespace

TEST_CASE("HELLO tells who answers and opens a session") {
  FakeBoard board;
  FakeHost host(board);
  const HelloReply reply = host.hello();
  CHECK(reply.wire_major == 1);
  CHECK(reply.serial.str() == "T0001");
  CHECK(reply.product.str() == "HS-1 test");
  CHECK(reply.boot_count == 1);
  CHECK(reply.max_payload == 16384);
  CHECK(reply.epoch == 0);
  CHECK(reply.capabilities == 0);
  CHECK(host.instrument().session_open());
}

TEST_CASE("A request before HELLO is refused and told so") {
  FakeBoard board;
  FakeHost host(board);
  CHECK(host.status_of(GetStatus{}) == StatusCode::kFailedPrecondition);
}

TEST_CASE("Without a common wire major the answer is VERSION_MISMATCH and the session in force lives on") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  host.session = 0x2222;
  CHECK(host.status_of(Hello{.min_wire_major = 9, .max_wire_major = 12}) == StatusCode::kVersionMismatch);
  host.session = 0x1234;
  CHECK(host.ask(GetStatus{}).header.id() == MessageId::kDeviceStatus);
}

TEST_CASE("Frames of an earlier session are dropped without an answer and counted") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  host.session = 0x7777;
  host.hello();
  host.session = 0x1234;
  const std::uint16_t stale = host.send(GetStatus{});
  host.settle();
  CHECK(host.replies(stale).empty());
  host.session = 0x7777;
  CHECK(host.ask(GetStatus{}).as<DeviceStatus>().stale_session == 1);
}

TEST_CASE("Every request of the schema gets exactly one final reply, with any payload") {
  const std::vector<std::vector<std::byte>> payloads{{},
                                                     std::vector<std::byte>(1, std::byte{0xFF}),
                                                     std::vector<std::byte>(300, std::byte{0}),
                                                     std::vector<std::byte>(300, std::byte{0xFF})};
  for (const bool with_stage : {false, true}) {
    FakeBoard board;
    board.with_stage = with_stage;
    FakeHost host(board);
    host.hello();
    std::uint16_t correlation = 1000;
    for (const std::uint16_t id : request_ids(static_cast<AllMessages*>(nullptr))) {
      if (id == static_cast<std::uint16_t>(MessageId::kHello) ||
          id == static_cast<std::uint16_t>(MessageId::kReboot) ||
          id == static_cast<std::uint16_t>(MessageId::kCredit)) {
        continue;
      }
      for (const auto& payload : payloads) {
        send_raw(board, host.session, id, ++correlation, payload);
        host.run_for(1'000'000);
        int finals = 0;
        for (const Received& r : host.replies(correlation)) {
          finals += FakeHost::is_pending(r) ? 0 : 1;
        }
        INFO("request " << id << ", payload of " << payload.size());
        CHECK(finals == 1);
      }
    }
  }
}

TEST_CASE("Unknown requests and the update messages are UNIMPLEMENTED") {
  FakeBoard board;
  FakeHost host(board);
  CHECK((host.hello().capabilities & kCapabilityUpdate) == 0);
  CHECK(host.status_of(UpdateStatus{}) == StatusCode::kUnimplemented);
  send_raw(board, host.session, 0x0777, 500, {});
  host.settle();
  REQUIRE(host.replies(500).size() == 1);
  CHECK(host.replies(500)[0].as<StatusReply>().status == StatusCode::kUnimplemented);
  CHECK(host.replies(500)[0].as<StatusReply>().request == 0x0777);
}

TEST_CASE("Unknown events are ignored and counted; they get no reply") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const std::size_t before = host.received.size();
  host.send(LogEvent{}, Channel::kEvent);
  host.settle();
  CHECK(host.received.size() == before);
  CHECK(host.ask(GetStatus{}).as<DeviceStatus>().unknown_events == 1);
}

TEST_CASE("An unknown incompatible flag or wire major is answered VERSION_MISMATCH") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  send_raw(board, host.session, static_cast<std::uint16_t>(MessageId::kGetStatus), 600, {}, 0x80);
  send_raw(board, host.session, static_cast<std::uint16_t>(MessageId::kGetStatus), 601, {}, 0, 7);
  host.settle();
  for (const std::uint16_t correlation : {std::uint16_t{600}, std::uint16_t{601}}) {
    REQUIRE(host.replies(correlation).size() == 1);
    CHECK(host.replies(correlation)[0].as<StatusReply>().status == StatusCode::kVersionMismatch);
  }
}

TEST_CASE("A repeated request is answered with the same bytes and executed once") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const SetConfiguration message{.recipe = fixed_recipe()};
  const std::uint16_t correlation = host.send(message);
  host.send_as(message, correlation);
  host.settle();
  host.send_as(message, correlation);
  host.settle();
  const auto replies = host.replies(correlation);
  REQUIRE(replies.size() == 3);
  CHECK(replies[0].payload == replies[1].payload);
  CHECK(replies[0].header == replies[2].header);
  CHECK(host.ask(GetConfiguration{}).as<Configuration>().epoch == 1);
  CHECK(host.ask(GetStatus{}).as<DeviceStatus>().duplicates == 2);
}

TEST_CASE("A repeated HELLO does not end the run it began") {
  FakeBoard board;
  FakeHost host(board);
  const std::uint16_t correlation = host.send(Hello{});
  host.settle();
  host.start(host.configure(fixed_recipe()));
  host.send_as(Hello{}, correlation);
  host.settle();
  CHECK(host.replies(correlation).size() == 2);
  CHECK(host.instrument().run_state() == RunState::kRunning);
}

TEST_CASE("The descriptor read in small chunks is the descriptor, proved by its CRC") {
  FakeBoard board;
  FakeHost host(board);
  host.max_payload = 1024;
  CHECK(host.hello().max_payload == 1024);
  std::vector<std::byte> object;
  ObjectChunk last;
  do {
    const Received r = host.ask(
        ObjectRead{.object = 1, .offset = static_cast<std::uint32_t>(object.size()), .length = 0xFFFF'FFFF});
    CHECK(r.payload.size() <= 1024);
    last = r.as<ObjectChunk>();
    CHECK(last.offset == object.size());
    object.insert(object.end(), last.data.begin(), last.data.end());
  } while (object.size() < last.total);
  CHECK(crc32c(object) == last.object_crc);
  const auto descriptor = decode<Descriptor>(object);
  REQUIRE(descriptor);
  CHECK(*descriptor == board.factory.data);
  CHECK(host.status_of(ObjectRead{.object = 1, .offset = last.total + 1, .length = 1}) ==
        StatusCode::kOutOfRange);
  CHECK(host.status_of(ObjectRead{.object = 3, .offset = 0, .length = 1}) == StatusCode::kNotFound);
  CHECK(host.status_of(ObjectRead{.object = 99, .offset = 0, .length = 1}) == StatusCode::kNotFound);
}

TEST_CASE("Damaged and garbage bytes are counted and the next request is served") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  for (int i = 0; i < 1000; ++i) {
    board.link.to_device.push_back(static_cast<std::byte>(i * 37));
  }
  CHECK(host.ask(GetStatus{}).as<DeviceStatus>().bytes_skipped == 1000);
  const std::size_t at = board.link.to_device.size() + kHeaderBytes;
  host.send(KeyValueGet{.key = "serial"});
  board.link.to_device[at] ^= std::byte{1};
  CHECK(host.ask(GetStatus{}).as<DeviceStatus>().frames_bad_payload == 1);
}

TEST_CASE("A frame that stops arriving does not block the requests behind it for longer than a second") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  std::vector<std::byte> head(8000);
  FrameHeader header;
  header.message = static_cast<std::uint16_t>(MessageId::kUpdateWrite);
  REQUIRE(write_frame(head, header, std::vector<std::byte>(4000)) > 0);
  board.link.to_device.insert(board.link.to_device.end(), head.begin(), head.begin() + kHeaderBytes);
  const std::uint64_t began = board.clock.time_us;
  host.ask(GetStatus{});
  CHECK(board.clock.time_us - began <= 1'000'001);
}

TEST_CASE("Reboot replies before the reset") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const std::uint16_t correlation = host.send(Reboot{});
  host.run_for(1'000'000);
  CHECK(host.final_reply(correlation)->as<StatusReply>().status == StatusCode::kOk);
  CHECK(board.keeper.reboots == 1);
}

TEST_CASE("Keys: the name is writable, the serial number read-only, others unknown") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  CHECK(host.status_of(KeyValueSet{.key = "name", .value = "bench 3"}) == StatusCode::kOk);
  CHECK(host.ask(KeyValueGet{.key = "name"}).as<KeyValue>().value.str() == "bench 3");
  CHECK(host.status_of(KeyValueSet{.key = "serial", .value = "X"}) == StatusCode::kPermissionDenied);
  CHECK(host.ask(KeyValueGet{.key = "serial"}).as<KeyValue>().value.str() == "T0001");
  CHECK(host.ask(KeyValueGet{.key = "serial"}).as<KeyValue>().read_only == 1);
  CHECK(host.status_of(KeyValueGet{.key = "colour"}) == StatusCode::kNotFound);
}

TEST_CASE("The clock is told in device microseconds") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  board.clock.time_us = 5'000'000;
  const auto synced = host.ask(ClockSync{.host_time_us = 1'700'000'000'000'000}).as<ClockSynced>();
  CHECK(synced.device_time_us == 5'000'000);
  CHECK(synced.host_time_us == 1'700'000'000'000'000);
}

TEST_CASE("The watchdog is kicked in every poll and the loop never sleeps longer than a second") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const std::uint32_t before = board.keeper.kicks;
  host.run_for(10'000'000);
  CHECK(board.keeper.kicks - before >= 10);
}
