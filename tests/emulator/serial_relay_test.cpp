// The relay between sockets and serial lines, without either.
#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

#include "simulator/emulator/serial_relay.h"

using namespace scatter;
using namespace scatter::simulator;
using Bytes = std::vector<std::byte>;

namespace {

Bytes frame_of(std::uint32_t sequence, std::size_t payload, std::mt19937& random) {
  Bytes body(payload);
  std::ranges::generate(body, [&] { return static_cast<std::byte>(random() % 3); });
  Bytes frame(protocol::kFrameOverhead + payload);
  REQUIRE(protocol::write_frame(frame, {.message = 77, .sequence = sequence, .session = 9}, body) ==
          frame.size());
  return frame;
}

Bytes on_the_line(std::span<const std::byte> frame) {
  Bytes line(protocol::serial_max_size(protocol::kMaxSerialPayload));
  line.resize(protocol::write_serial(line, frame, true));
  return line;
}

Bytes read_all(SerialRelay& relay) {
  Bytes out(relay.readable());
  CHECK(relay.host_read(out) == out.size());
  return out;
}

/// What a serial decoder finds in what the relay has for the device.
Bytes frames_for_device(SerialRelay& relay) {
  Bytes buffer(protocol::kFrameOverhead + protocol::kMaxSerialPayload);
  protocol::SerialDecoder decoder(buffer);
  Bytes out;
  decoder.push(relay.to_device(), [&](const protocol::Frame& frame) {
    out.insert(out.end(), frame.bytes().begin(), frame.bytes().end());
  });
  relay.sent_to_device(relay.to_device().size());
  return out;
}

}  // namespace

TEST_CASE("Frames pass the relay unchanged in both directions, however they are cut") {
  std::mt19937 random(1);
  for (int round = 0; round < 20; ++round) {
    SerialRelay relay;
    relay.attach();
    Bytes sent;
    Bytes got;
    Bytes line;
    Bytes got_by_host;
    for (std::uint32_t k = 0; k < 40; ++k) {
      const Bytes frame = frame_of(k, random() % (protocol::kMaxSerialPayload + 1), random);
      sent.insert(sent.end(), frame.begin(), frame.end());
      const Bytes serial = on_the_line(frame);
      line.insert(line.end(), serial.begin(), serial.end());
    }
    for (std::size_t at = 0; at < sent.size();) {
      const std::size_t piece =
          std::min<std::size_t>({1 + random() % 3000, sent.size() - at, relay.writable()});
      relay.from_host(std::span<const std::byte>(sent).subspan(at, piece));
      at += piece;
      const Bytes frames = frames_for_device(relay);
      got.insert(got.end(), frames.begin(), frames.end());
    }
    for (std::size_t at = 0; at < line.size();) {
      const std::size_t piece =
          std::min<std::size_t>({1 + random() % 3000, line.size() - at, relay.room_from_device()});
      relay.from_device(std::span<const std::byte>(line).subspan(at, piece));
      at += piece;
      const Bytes bytes = read_all(relay);
      got_by_host.insert(got_by_host.end(), bytes.begin(), bytes.end());
    }
    CHECK(got == sent);
    CHECK(got_by_host == sent);
  }
}

TEST_CASE("A side that does not read makes the other wait, and memory stays bounded") {
  std::mt19937 random(2);
  SerialRelay relay;
  relay.attach();
  std::size_t taken = 0;
  while (relay.writable() > 0 && taken < 1'000'000) {
    const Bytes frame = frame_of(0, 0, random);  // The smallest grow most.
    const std::size_t piece = std::min(relay.writable(), frame.size());
    relay.from_host(std::span<const std::byte>(frame).first(piece));
    taken += piece;
  }
  CHECK(relay.to_device().size() <= SerialRelay::kRoom);
  CHECK(taken > SerialRelay::kRoom / 2);
  std::size_t came = 0;
  while (relay.room_from_device() > 0 && came < 1'000'000) {
    const Bytes line = on_the_line(frame_of(0, 1000, random));
    const std::size_t piece = std::min(relay.room_from_device(), line.size());
    relay.from_device(std::span<const std::byte>(line).first(piece));
    came += piece;
  }
  CHECK(relay.readable() <= SerialRelay::kRoom);
  CHECK(came > SerialRelay::kRoom / 2);
}

TEST_CASE("Garbage and damaged frames go nowhere, and the next whole frame passes") {
  std::mt19937 random(3);
  SerialRelay relay;
  relay.attach();
  const Bytes good = frame_of(5, 100, random);
  Bytes noise(700);
  std::ranges::generate(noise, [&] { return static_cast<std::byte>(random()); });
  Bytes damaged = frame_of(4, 50, random);
  damaged[30] ^= std::byte{1};
  Bytes to_device = damaged;
  to_device.insert(to_device.end(), good.begin(), good.end());
  relay.from_host(to_device);
  CHECK(frames_for_device(relay) == good);
  relay.from_device(noise);
  relay.from_device(on_the_line(damaged));
  relay.from_device(on_the_line(good));
  CHECK(read_all(relay) == good);
  CHECK(relay.counters().from_host.bad_payload == 1);
}

TEST_CASE("A frame of another wire version reaches the other side, so that it can refuse it") {
  std::mt19937 random(4);
  SerialRelay relay;
  relay.attach();
  Bytes frame(protocol::kFrameOverhead);
  REQUIRE(protocol::write_frame(frame, {.wire_major = 9, .message = 1, .session = 3, .correlation = 8}, {}) >
          0);
  relay.from_host(frame);
  Bytes buffer(protocol::kFrameOverhead + protocol::kMaxSerialPayload);
  protocol::SerialDecoder decoder(buffer);
  int refused = 0;
  decoder.push(
      relay.to_device(), [](const protocol::Frame&) { FAIL("not a frame of this version"); },
      [&](const protocol::FrameHeader& header, protocol::ParseStatus status) {
        ++refused;
        CHECK(status == protocol::ParseStatus::kBadVersion);
        CHECK(header.wire_major == 9);
        CHECK(header.correlation == 8);
      });
  CHECK(refused == 1);
}

TEST_CASE("Nothing of one host reaches the next, and a restart lets the last words through") {
  std::mt19937 random(5);
  SerialRelay relay;
  relay.attach();
  const Bytes frame = frame_of(1, 200, random);
  relay.from_host(std::span<const std::byte>(frame).first(150));
  relay.from_device(on_the_line(frame));
  relay.detach();
  CHECK(relay.readable() == 0);
  CHECK(relay.writable() == 0);
  relay.from_device(on_the_line(frame));  // Nobody listens.
  relay.attach();
  CHECK(relay.readable() == 0);
  relay.from_host(std::span<const std::byte>(frame).subspan(150));
  CHECK(frames_for_device(relay).empty());
  relay.from_device(on_the_line(frame));
  relay.device_gone();
  CHECK_FALSE(relay.attached());
  CHECK(relay.writable() == 0);
  CHECK(read_all(relay) == frame);
}

TEST_CASE("A host that never finishes a frame is served again after a silence") {
  // PROVES: SPEC 2.5
  std::mt19937 random(6);
  SerialRelay relay;
  relay.attach();
  const Bytes cut = frame_of(1, 900, random);
  const Bytes next = frame_of(2, 20, random);
  relay.from_host(std::span<const std::byte>(cut).first(100));
  relay.from_host(next);  // Lies inside what the cut frame claims.
  CHECK(frames_for_device(relay).empty());
  relay.host_was_silent();
  CHECK(frames_for_device(relay) == next);
}
