#include "protocol/serial.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "tests/unit/protocol/test_bytes.h"

namespace scatter::protocol::test {
namespace {

Bytes cobs(const Bytes& bytes) {
  Bytes out(cobs_max_size(bytes.size()));
  out.resize(cobs_encode(bytes, out));
  return out;
}

Bytes line_of(const Bytes& frame, bool after_idle = false) {
  Bytes out(serial_max_size(frame.size()));
  out.resize(write_serial(out, frame, after_idle));
  return out;
}

struct Receiver {
  Bytes buffer = Bytes(kFrameOverhead + kMaxSerialPayload);
  SerialDecoder decoder{buffer};
  Frames frames;
  void push(std::span<const std::byte> bytes) {
    decoder.push(bytes, [this](const Frame& frame) { frames.push_back(copy(frame.bytes())); });
  }
};

// Examples of Cheshire and Baker 1999 and of the encoding's edges at 253, 254 and 255 bytes.
TEST_CASE("COBS gives the published encodings") {
  const auto check = [](const std::string& plain, const std::string& encoded) {
    CHECK(cobs(from_hex(plain)) == from_hex(encoded));
  };
  check("", "01");
  check("00", "0101");
  check("0000", "010101");
  check("11220033", "0311220233");
  check("11223344", "0511223344");
  check("11000000", "0211010101");
  std::string run;
  for (int i = 1; i <= 254; ++i) {
    const char* digits = "0123456789abcdef";
    run += digits[i / 16];
    run += digits[i % 16];
  }
  check(run, "ff" + run);
  check("00" + run, "01ff" + run);
  check(run + "ff", "ff" + run + "02ff");
  check(run.substr(2) + "ff00", "ff" + run.substr(2) + "ff0101");
}

// PROVES: SPEC 3.1
TEST_CASE("COBS output holds no zero, is as short as stated and decodes to its input") {
  std::mt19937 random(1);
  for (std::size_t size = 0; size < 1100; ++size) {
    Bytes bytes = random_bytes(random, size);
    const unsigned zeros = random() % 4;
    for (std::byte& b : bytes) {
      if (zeros == 0 ? b == std::byte{0} : random() % (1U << (2 * zeros)) == 0) {
        b = zeros == 0 ? std::byte{1} : std::byte{0};
      }
    }
    Bytes encoded = cobs(bytes);
    REQUIRE(std::ranges::find(encoded, std::byte{0}) == encoded.end());
    REQUIRE(encoded.size() <= cobs_max_size(size));
    REQUIRE(encoded.size() > size);
    encoded.push_back({});
    Bytes buffer(size);
    CobsDecoder decoder(buffer);
    std::span<const std::byte> in(encoded);
    REQUIRE(decoder.next(in) == CobsDecoder::Event::kBlock);
    REQUIRE(std::ranges::equal(decoder.block(), bytes));
    REQUIRE(in.empty());
    if (size > 0) {
      CobsDecoder small(std::span<std::byte>(buffer).first(size - 1));
      in = encoded;
      REQUIRE(small.next(in) == CobsDecoder::Event::kTooLong);
    }
  }
}

// PROVES: SPEC 3.2, 3.4
TEST_CASE("Noise on an idle line is ended by the leading zero and costs no frame") {
  std::mt19937 random(2);
  const Bytes frame = make_frame(Credit{.run_id = 1, .may_send_until = 2}, 3);
  for (int round = 0; round < 500; ++round) {
    Receiver receiver;
    receiver.push(random_bytes(random, random() % 40));
    receiver.push(line_of(frame, true));
    REQUIRE(receiver.frames == Frames{frame});
  }
}

// PROVES: SPEC 3.4
TEST_CASE("A damaged, cut or lost byte on a serial line costs at most its frame and the next") {
  const Bytes first = make_frame(Credit{.run_id = 1, .may_send_until = 2}, 1);
  const Bytes second = make_frame(LogEvent{.level = 2, .device_time_us = 7, .text = "noise"}, 2);
  const Bytes third = make_frame(Stop{}, 3);
  const Bytes line = line_of(first);
  Bytes rest = line_of(second);
  append(rest, line_of(third));
  for (std::size_t at = 0; at < line.size(); ++at) {
    const bool closing_zero = at + 1 == line.size();
    for (int kind = 0; kind < 10; ++kind) {
      Bytes damaged = line;
      if (kind < 8) {
        damaged = flipped(std::move(damaged), 8 * at + static_cast<std::size_t>(kind));
      } else if (kind == 8) {
        damaged.erase(damaged.begin() + static_cast<std::ptrdiff_t>(at));
      } else {
        damaged.resize(at);
      }
      append(damaged, rest);
      Receiver receiver;
      receiver.push(damaged);
      INFO("byte " << at << " kind " << kind);
      if (closing_zero || kind == 9) {
        // The block runs into the next one: both are lost, or only the second when nothing was left of the
        // first.
        REQUIRE(receiver.frames.size() <= 2);
        REQUIRE(receiver.frames.back() == third);
      } else {
        REQUIRE(receiver.frames == Frames{second, third});
      }
      for (const Bytes& frame : receiver.frames) {
        REQUIRE((frame == first || frame == second || frame == third));
      }
    }
  }
}

// PROVES: SPEC 2.1
TEST_CASE("Any cutting of a serial line into pieces gives the same frames and counters") {
  std::mt19937 random(4);
  for (int round = 0; round < 100; ++round) {
    Bytes bytes;
    for (std::uint32_t i = 0; i < 10; ++i) {
      const Bytes pixels = random_bytes(random, random() % 1000);
      FrameData data;
      data.data = pixels;
      Bytes line = line_of(make_frame(data, i), random() % 2 == 0);
      if (random() % 3 == 0) {
        line = flipped(std::move(line), random() % (line.size() * 8));
      }
      append(bytes, line);
    }
    Receiver whole;
    whole.push(bytes);
    Receiver pieces;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t size = std::min<std::size_t>(bytes.size() - at, 1 + random() % 50);
      pieces.push(std::span(bytes).subspan(at, size));
      at += size;
    }
    REQUIRE(pieces.frames == whole.frames);
    REQUIRE(pieces.decoder.counters() == whole.decoder.counters());
  }
}

TEST_CASE("Serial writing into too little room gives nothing") {
  const Bytes frame = make_frame(Credit{.run_id = 1, .may_send_until = 2}, 3);
  const std::size_t needed = line_of(frame, true).size();
  for (std::size_t room = 0; room < needed; ++room) {
    Bytes out(room);
    REQUIRE(write_serial(out, frame, true) == 0);
  }
  Bytes out(needed);
  CHECK(write_serial(out, frame, true) == needed);
}

}  // namespace
}  // namespace scatter::protocol::test
