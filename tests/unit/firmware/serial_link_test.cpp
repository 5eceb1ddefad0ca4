// The core's link over a line that takes and gives bytes as it pleases.
#include "firmware/core/serial_link.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstddef>
#include <vector>

#include "protocol/frame.h"
#include "tests/unit/firmware/fake_board.h"

namespace scatter::firmware {
namespace {

using Bytes = std::vector<std::byte>;

Bytes frame_of(std::size_t payload, std::uint32_t sequence) {
  Bytes bytes(protocol::kFrameOverhead + payload);
  for (std::size_t i = 0; i < payload; ++i) {
    bytes[protocol::kHeaderBytes + i] = static_cast<std::byte>(i * 37 + sequence);
  }
  protocol::FrameHeader header;
  header.message = 0x0102;
  header.channel = protocol::Channel::kStream;
  header.sequence = sequence;
  REQUIRE(protocol::finish_frame(bytes, header, payload) == bytes.size());
  return bytes;
}

/// Frames that a receiver of the line makes out of `line`.
std::vector<Bytes> decoded(const Bytes& line) {
  std::array<std::byte, protocol::kFrameOverhead + protocol::kMaxSerialPayload> buffer{};
  protocol::SerialDecoder decoder(buffer);
  std::vector<Bytes> frames;
  decoder.push(line, [&](const protocol::Frame& frame) {
    frames.emplace_back(frame.bytes().begin(), frame.bytes().end());
  });
  return frames;
}

/// Writes `bytes` in pieces of `piece`, letting the line take `per_turn` bytes a turn.
Bytes sent_over(const Bytes& bytes, std::size_t piece, std::size_t per_turn) {
  fake::FakeLink line;
  line.most_per_write = per_turn;
  SerialLink link(line);
  std::size_t at = 0;
  for (int turn = 0; turn < 100'000 && (at < bytes.size() || !link.idle()); ++turn) {
    const std::size_t size = std::min(piece, bytes.size() - at);
    at += link.write({bytes.data() + at, size});
    link.pump();
  }
  CHECK(at == bytes.size());
  CHECK(link.idle());
  CHECK(link.unsendable() == 0);
  return line.to_host;
}

Bytes received_from(fake::FakeLink& line, std::size_t piece, SerialLink& link) {
  Bytes all;
  Bytes out(piece);
  for (std::size_t count = link.read(out); count > 0; count = link.read(out)) {
    all.insert(all.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count));
  }
  CHECK(line.to_device.empty());
  return all;
}

void put_on_line(fake::FakeLink& line, const Bytes& bytes) {
  line.to_device.insert(line.to_device.end(), bytes.begin(), bytes.end());
}

Bytes serial(const Bytes& frame) {
  Bytes out(protocol::serial_max_size(frame.size()));
  out.resize(protocol::write_serial(out, frame, true));
  return out;
}

}  // namespace

TEST_CASE("Frames reach the line whole however the core cuts them and however little the line takes") {
  Bytes all;
  std::vector<Bytes> frames;
  for (std::uint32_t k = 0; const std::size_t payload : {0UL, 1UL, 253UL, 254UL, 255UL, 700UL, 1024UL}) {
    frames.push_back(frame_of(payload, k++));
    all.insert(all.end(), frames.back().begin(), frames.back().end());
  }
  for (const std::size_t piece : {1UL, 7UL, 24UL, 25UL, 600UL, all.size()}) {
    for (const std::size_t per_turn : {1UL, 3UL, 64UL, 5000UL}) {
      CHECK(decoded(sent_over(all, piece, per_turn)) == frames);
    }
  }
}

TEST_CASE("A line that is full keeps at most two frames waiting and loses none") {
  fake::FakeLink line;
  line.capacity = 0;
  SerialLink link(line);
  const Bytes frame = frame_of(1024, 1);
  CHECK(link.write(frame) == frame.size());
  CHECK(link.write(frame) == frame.size());
  CHECK(link.write(frame) == 0);
  CHECK(!link.idle());
  line.capacity = 100'000;
  link.pump();
  link.pump();
  CHECK(link.idle());
  CHECK(decoded(line.to_host) == std::vector<Bytes>{frame, frame});
}

TEST_CASE("A frame longer than the line carries is dropped and the next one leaves whole") {
  fake::FakeLink line;
  SerialLink link(line);
  const Bytes good = frame_of(20, 2);
  Bytes all = frame_of(1025, 1);
  all.insert(all.end(), good.begin(), good.end());
  CHECK(link.write(all) == all.size());
  link.pump();
  CHECK(link.unsendable() > 0);
  CHECK(decoded(line.to_host) == std::vector<Bytes>{good});
}

TEST_CASE("The core receives the frames that were sent, in pieces of any size") {
  for (const std::size_t piece : {1UL, 5UL, 100UL, 4096UL}) {
    fake::FakeLink line;
    SerialLink link(line);
    Bytes wanted;
    for (std::uint32_t k = 0; k < 5; ++k) {
      const Bytes frame = frame_of(k * 250, k);
      wanted.insert(wanted.end(), frame.begin(), frame.end());
      put_on_line(line, serial(frame));
    }
    CHECK(received_from(line, piece, link) == wanted);
    CHECK(link.counters().good == 5);
  }
}

TEST_CASE("A byte that the line loses costs the frames it hits and no other") {
  const std::vector<Bytes> frames{frame_of(40, 0), frame_of(40, 1), frame_of(40, 2)};
  Bytes whole;
  for (const Bytes& frame : frames) {
    const Bytes one = serial(frame);
    whole.insert(whole.end(), one.begin(), one.end());
  }
  const std::size_t one = serial(frames[0]).size();
  for (std::size_t lost = 0; lost < whole.size(); ++lost) {
    fake::FakeLink line;
    SerialLink link(line);
    Bytes damaged = whole;
    damaged.erase(damaged.begin() + static_cast<std::ptrdiff_t>(lost));
    put_on_line(line, damaged);
    const Bytes got = received_from(line, 256, link);
    Bytes spared;
    for (std::size_t k = 0; k < frames.size(); ++k) {
      // The zeros around a frame are doubled: to lose one of a pair does no harm.
      const bool hit = lost >= k * one + 1 && lost < (k + 1) * one - 1;
      const bool last_zero = k + 1 == frames.size() && lost == whole.size() - 1;
      if (!hit && !last_zero) {
        spared.insert(spared.end(), frames[k].begin(), frames[k].end());
      }
    }
    CHECK(got == spared);
  }
}

TEST_CASE("A frame that this version refuses is handed on, so that the core can answer it") {
  fake::FakeLink line;
  SerialLink link(line);
  Bytes frame(protocol::kFrameOverhead);
  protocol::FrameHeader header;
  header.wire_major = 9;
  header.message = 1;
  header.correlation = 7;
  REQUIRE(protocol::finish_frame(frame, header, 0) == frame.size());
  put_on_line(line, serial(frame));
  CHECK(received_from(line, 64, link) == frame);
  CHECK(link.counters().bad_version == 1);
}

TEST_CASE("The serial link names the longest payload of serial lines and passes on whether a host is there") {
  fake::FakeLink line;
  SerialLink link(line);
  CHECK(link.max_payload() == protocol::kMaxSerialPayload);
  CHECK(link.connected());
  line.attached = false;
  CHECK(!link.connected());
}

}  // namespace scatter::firmware
