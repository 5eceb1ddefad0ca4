#include "protocol/link_decoder.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "protocol/crc.h"
#include "tests/unit/protocol/test_bytes.h"

namespace scatter::protocol::test {
namespace {

/// A decoder with its buffer; collects the bytes of delivered frames.
struct Receiver {
  Bytes buffer = Bytes(kMaxFrameBytes);
  LinkDecoder decoder{buffer};
  Frames frames;
  std::vector<ParseStatus> refused;

  void push(std::span<const std::byte> bytes) {
    decoder.push(
        bytes, [this](const Frame& frame) { frames.push_back(copy(frame.bytes())); },
        [this](const FrameHeader&, ParseStatus status) { refused.push_back(status); });
  }
  void give_up() {
    decoder.give_up([this](const Frame& frame) { frames.push_back(copy(frame.bytes())); });
  }
};

Bytes chunk(std::uint32_t number, std::size_t size) {
  std::mt19937 random(number);
  const Bytes pixels = random_bytes(random, size);
  FrameData data;
  data.frame_id = number;
  data.data = pixels;
  return make_frame(data, number);
}

// PROVES: SPEC 1.2, 2.2
TEST_CASE("Decoder delivers nothing when any single bit of a frame flips") {
  for (const Bytes& frame : {make_frame(Stop{}), make_frame(Credit{.run_id = 5, .may_send_until = 77}),
                             chunk(1, 61), make_frame(Hello{})}) {
    for (std::size_t bit = 0; bit < frame.size() * 8; ++bit) {
      Receiver receiver;
      receiver.push(flipped(frame, bit));
      receiver.give_up();
      INFO("bit " << bit);
      REQUIRE(receiver.frames.empty());
      REQUIRE(receiver.refused.empty());
      REQUIRE(receiver.decoder.counters().skipped_bytes == frame.size());
    }
  }
}

// PROVES: SPEC 1.2, 2.2
TEST_CASE("Decoder delivers nothing when any two bits of a small frame flip") {
  const Bytes frame = make_frame(Credit{.run_id = 5, .may_send_until = 77});
  for (std::size_t first = 0; first < frame.size() * 8; ++first) {
    const Bytes once = flipped(frame, first);
    for (std::size_t second = first + 1; second < frame.size() * 8; ++second) {
      const ParseResult parsed = parse_frame(flipped(once, second));
      REQUIRE_FALSE(parsed.frame);
      REQUIRE_FALSE(is_refused(parsed.status));
    }
  }
}

// PROVES: SPEC 1.2, 2.2
TEST_CASE("Decoder delivers nothing when 2 to 5 sampled bits of a large frame flip") {
  std::mt19937 random(11);
  const Bytes frame = chunk(3, 8000);
  for (int i = 0; i < 4000; ++i) {
    Bytes damaged = frame;
    const std::size_t flips = 2 + i % 4;
    for (std::size_t k = 0; k < flips; ++k) {
      damaged = flipped(std::move(damaged), random() % (frame.size() * 8));
    }
    if (damaged != frame) {
      REQUIRE_FALSE(parse_frame(damaged).frame);
    }
  }
}

// PROVES: SPEC 2.3
TEST_CASE("A frame cut at any byte costs itself only") {
  const Bytes victim = chunk(1, 50);
  const Bytes next = chunk(2, 200);
  for (std::size_t cut = 0; cut < victim.size(); ++cut) {
    Receiver receiver;
    receiver.push(std::span(victim).first(cut));
    receiver.push(next);
    receiver.give_up();
    INFO("cut at " << cut);
    REQUIRE(receiver.frames == Frames{next});
    REQUIRE(receiver.decoder.counters().skipped_bytes == cut);
  }
}

// PROVES: SPEC 2.3
TEST_CASE("A frame with any one byte lost costs itself only") {
  const Bytes victim = chunk(1, 50);
  const Bytes next = chunk(2, 20);
  for (std::size_t lost = 0; lost < victim.size(); ++lost) {
    Bytes bytes = victim;
    bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(lost));
    append(bytes, next);
    Receiver receiver;
    receiver.push(bytes);
    receiver.give_up();
    INFO("lost byte " << lost);
    REQUIRE(receiver.frames == Frames{next});
  }
}

// PROVES: SPEC 2.3
TEST_CASE("Frames inside the bytes that a broken frame claimed are delivered") {
  // A header that claims 16 KiB, whose payload never came; whole frames follow at once.
  Bytes bytes = chunk(1, 16000);
  bytes.resize(kHeaderBytes + 100);
  Frames expected;
  for (std::uint32_t i = 2; i < 60; ++i) {
    expected.push_back(chunk(i, 10 * i));
    append(bytes, expected.back());
  }
  SECTION("when the claimed bytes have come") {
    Receiver receiver;
    receiver.push(bytes);
    receiver.give_up();
    CHECK(receiver.frames == expected);
    CHECK(receiver.decoder.counters().bad_payload == 1);
    CHECK(receiver.decoder.counters().skipped_bytes == kHeaderBytes + 100);
  }
  SECTION("when the receiver gives up waiting") {
    bytes.resize(kHeaderBytes + 100);
    append(bytes, expected.front());
    Receiver receiver;
    receiver.push(bytes);
    CHECK(receiver.frames.empty());
    receiver.give_up();
    CHECK(receiver.frames == Frames{expected.front()});
    CHECK(receiver.decoder.buffered() == 0);
  }
}

// PROVES: SPEC 2.1
TEST_CASE("Any cutting of the bytes into pieces gives the same frames and the same counters") {
  std::mt19937 random(21);
  for (int round = 0; round < 60; ++round) {
    Bytes bytes;
    for (int i = 0; i < 12; ++i) {
      Bytes frame = chunk(static_cast<std::uint32_t>(random()), random() % (round % 5 == 0 ? 9000 : 120));
      switch (random() % 6) {
        case 0:
          append(bytes, random_bytes(random, random() % 90));  // Garbage burst.
          break;
        case 1:
          frame = flipped(std::move(frame), random() % (frame.size() * 8));
          break;
        case 2:
          frame.resize(random() % frame.size());
          break;
        case 3:
          append(bytes, frame);  // Duplicate.
          break;
        default:
          break;
      }
      append(bytes, frame);
    }
    Receiver whole;
    whole.push(bytes);
    whole.give_up();
    for (const std::size_t longest : {std::size_t{1}, std::size_t{3}, std::size_t{40}, std::size_t{700}}) {
      Receiver pieces;
      for (std::size_t at = 0; at < bytes.size();) {
        const std::size_t size = std::min(bytes.size() - at, 1 + random() % longest);
        pieces.push(std::span(bytes).subspan(at, size));
        at += size;
      }
      pieces.give_up();
      REQUIRE(pieces.frames == whole.frames);
      REQUIRE(pieces.decoder.counters() == whole.decoder.counters());
    }
    // Nothing lost, nothing invented: every byte is in a frame or counted as skipped.
    std::size_t delivered = 0;
    for (const Bytes& frame : whole.frames) {
      delivered += frame.size();
    }
    REQUIRE(delivered + whole.decoder.counters().skipped_bytes == bytes.size());
  }
}

// PROVES: SPEC 2.3
TEST_CASE("After any garbage burst the next frame is delivered") {
  std::mt19937 random(31);
  for (int round = 0; round < 300; ++round) {
    Bytes bytes = random_bytes(random, random() % 2000);
    for (std::size_t i = 0; i + 1 < bytes.size(); i += 1 + random() % 64) {
      bytes[i] = std::byte{0xA7};  // As many false beginnings as possible.
      bytes[i + 1] = std::byte{0x5C};
    }
    const Bytes frame = chunk(static_cast<std::uint32_t>(round), 33);
    append(bytes, frame);
    Receiver receiver;
    receiver.push(bytes);
    REQUIRE(receiver.frames == Frames{frame});
  }
}

// PROVES: SPEC 1.4, 1.5, 1.6, 1.7
TEST_CASE("Frames of another version, flag or channel are refused, counted and passed over") {
  const FrameHeader credit = header_for<Credit>(9, 8, 7);
  FrameHeader version = credit;
  version.wire_major = 2;
  FrameHeader flag = credit;
  flag.incompatible_flags = 0x10;
  FrameHeader channel = credit;
  channel.channel = static_cast<Channel>(9);
  FrameHeader harmless = credit;
  harmless.compatible_flags = 0xFF;
  const Bytes payload(8);
  Bytes bytes;
  for (const FrameHeader& header : {version, flag, channel, harmless}) {
    append(bytes, make_frame(header, payload));
  }
  Receiver receiver;
  receiver.push(bytes);
  CHECK(receiver.frames == Frames{make_frame(harmless, payload)});
  CHECK(receiver.refused ==
        std::vector{ParseStatus::kBadVersion, ParseStatus::kUnknownFlags, ParseStatus::kUnknownChannel});
  const LinkCounters expected{.good = 1, .bad_version = 1, .unknown_flags = 1, .unknown_channel = 1};
  CHECK(receiver.decoder.counters() == expected);
}

// PROVES: SPEC 1.3
TEST_CASE("A length is not believed before the header's checksum proves it") {
  Bytes frame = chunk(1, 100);
  frame[9] = std::byte{0x3F};  // Claims 16 KB; the header checksum no longer fits.
  const Bytes next = chunk(2, 10);
  append(frame, next);
  Receiver receiver;
  receiver.push(frame);
  CHECK(receiver.frames == Frames{next});  // At once, without waiting for 16 KB.
}

TEST_CASE("A decoder with a small buffer refuses longer payloads and takes shorter ones") {
  Bytes buffer(kFrameOverhead + 64);
  LinkDecoder decoder(buffer);
  Frames frames;
  const auto keep = [&](const Frame& frame) { frames.push_back(copy(frame.bytes())); };
  const Bytes fits = chunk(1, 64 - min_encoded_size<FrameData>());
  const Bytes too_long = chunk(2, 65 - min_encoded_size<FrameData>());
  for (const std::byte b : too_long) {
    decoder.push({&b, 1}, keep);
  }
  for (const std::byte b : fits) {
    decoder.push({&b, 1}, keep);
  }
  CHECK(frames == Frames{fits});
  CHECK(decoder.counters().bad_length == 1);
}

TEST_CASE("Frames of the largest size in pieces fit a buffer of exactly one frame") {
  std::mt19937 random(41);
  const Bytes largest = chunk(41, kMaxPayload - min_encoded_size<FrameData>());
  REQUIRE(largest.size() == kMaxFrameBytes);
  const Bytes damaged = flipped(largest, 8 * 5000);
  Bytes bytes;
  for (const Bytes& next : {largest, damaged, largest, damaged}) {
    append(bytes, next);
  }
  Bytes buffer(kMaxFrameBytes + 16, std::byte{0x5A});  // What lies behind must stay as it is.
  LinkDecoder decoder(std::span<std::byte>(buffer).first(kMaxFrameBytes));
  int delivered = 0;
  const auto compare = [&](const Frame& frame) {
    ++delivered;
    CHECK(std::ranges::equal(frame.bytes(), largest));
  };
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t size = std::min<std::size_t>(bytes.size() - at, 1 + random() % 5000);
    decoder.push(std::span(bytes).subspan(at, size), compare);
    at += size;
  }
  decoder.give_up(compare);
  CHECK(delivered == 2);
  CHECK(decoder.counters().bad_payload == 2);
  CHECK(std::ranges::count(std::span(buffer).last(16), std::byte{0x5A}) == 16);
}

TEST_CASE("Frames that lie whole in the pushed bytes are not copied") {
  Bytes bytes = chunk(1, 500);
  append(bytes, chunk(2, 700));
  Receiver receiver;
  receiver.decoder.push(bytes, [&](const Frame& frame) {
    CHECK(frame.bytes().data() >= bytes.data());
    CHECK(frame.bytes().data() + frame.bytes().size() <= bytes.data() + bytes.size());
  });
  CHECK(receiver.decoder.counters().good == 2);
}

// PROVES: SPEC 1.1
TEST_CASE("Nothing is written when a frame does not fit or its payload is over the limit") {
  const Bytes payload(100);
  for (std::size_t room = 0; room < kFrameOverhead + payload.size(); ++room) {
    Bytes out(room, std::byte{0x55});
    REQUIRE(write_frame(out, {}, payload) == 0);
    REQUIRE(out == Bytes(room, std::byte{0x55}));
  }
  Bytes large(kMaxFrameBytes + 1);
  CHECK(write_frame(large, {}, Bytes(kMaxPayload + 1)) == 0);
  CHECK(write_frame(large, {}, Bytes(kMaxPayload)) == kMaxFrameBytes);
}

}  // namespace
}  // namespace scatter::protocol::test
