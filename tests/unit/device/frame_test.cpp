#include <catch2/catch.hpp>
#include <random>
#include <thread>

#include "host_sdk/device/frame.h"
#include "host_sdk/device/frame_assembler.h"
#include "host_sdk/device/pixel_pool.h"
#include "protocol/crc.h"
#include "tests/unit/device/scripted_device.h"

namespace scatter::device::test {
namespace {

/// Packs bit by bit, least significant first: PFNC's definition, written without its shortcuts.
Bytes pack(const std::vector<std::uint16_t>& pixels, unsigned bits) {
  Bytes out((pixels.size() * bits + 7) / 8);
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    for (unsigned b = 0; b < bits; ++b) {
      const std::size_t at = k * bits + b;
      out[at / 8] |= static_cast<std::byte>(((pixels[k] >> b) & 1U) << (at % 8));
    }
  }
  return out;
}

TEST_CASE("Packed pixels unpack to what was packed, for every length") {
  std::mt19937 random(1);
  for (std::size_t count = 0; count < 70; ++count) {
    for (const unsigned bits : {10U, 12U}) {
      std::vector<std::uint16_t> pixels(count);
      for (std::uint16_t& pixel : pixels) {
        pixel = static_cast<std::uint16_t>(random() & ((1U << bits) - 1U));
      }
      const Bytes packed = pack(pixels, bits);
      const auto format = bits == 10 ? protocol::PixelFormat::kMono10p : protocol::PixelFormat::kMono12p;
      REQUIRE(packed.size() == packed_bytes(format, count));
      std::vector<std::uint16_t> out(count, 0xFFFF);
      bits == 10 ? unpack_mono10p(packed, out) : unpack_mono12p(packed, out);
      REQUIRE(out == pixels);
    }
  }
}

TEST_CASE("Unpack refuses frames that are not complete and rooms of another size") {
  Frame frame;
  frame.begin.width = 2;
  frame.begin.height = 1;
  std::vector<std::uint16_t> out(2);
  CHECK(unpack(frame, out).error().code == ErrorCode::kFailedPrecondition);
  frame.status = FrameStatus::kComplete;
  CHECK(unpack(frame, out).error().code == ErrorCode::kInvalidArgument);
  frame.pixels =
      std::shared_ptr<std::byte[]>(new std::byte[4]{std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4}});
  frame.size_bytes = 4;
  REQUIRE(unpack(frame, out));
  CHECK(out == std::vector<std::uint16_t>{0x0201, 0x0403});
  out.resize(3);
  CHECK(unpack(frame, out).error().code == ErrorCode::kInvalidArgument);
}

TEST_CASE("Pixel buffers are aligned, reused when dropped, and may outlive their pool") {
  auto pool = std::make_unique<PixelPool>();
  auto first = pool->take(1000);
  REQUIRE(first);
  CHECK(reinterpret_cast<std::uintptr_t>(first.get()) % 64 == 0);
  const std::byte* where = first.get();
  first.reset();
  auto again = pool->take(900);
  CHECK(again.get() == where);
  std::thread([kept = pool->take(64)]() mutable { kept.reset(); }).join();
  pool.reset();
  again[0] = std::byte{1};
}

/// Feeds messages to an assembler as wire frames.
class Feeder {
 public:
  explicit Feeder(const AssemblerLimits& limits = {}) : assembler(std::make_shared<PixelPool>(), limits) {}
  template <typename Message>
  void operator()(const Message& message) {
    Bytes bytes(protocol::kMaxFrameBytes);
    protocol::FrameHeader header;
    header.channel = protocol::Channel::kStream;
    bytes.resize(protocol::write_message(std::span(bytes), header, message));
    const protocol::ParseResult parsed = protocol::parse_frame(bytes);
    REQUIRE(parsed.frame);
    assembler.accept(*parsed.frame, 1);
  }
  void begin(std::uint32_t id, std::uint32_t total = kFrameBytes) {
    protocol::FrameBegin begin;
    begin.run_id = 1;
    begin.frame_id = id;
    begin.epoch = 5;
    begin.width = kWidth;
    begin.height = kHeight;
    begin.total = total;
    (*this)(begin);
  }
  void data(std::uint32_t id, std::uint32_t from, std::uint32_t to) {
    const Bytes pixels = test_pixels(id);
    protocol::FrameData data;
    data.run_id = 1;
    data.frame_id = id;
    data.offset = from;
    data.total = kFrameBytes;
    data.data = std::span<const std::byte>(pixels).subspan(from, to - from);
    (*this)(data);
  }
  void end(std::uint32_t id) {
    protocol::FrameEnd end;
    end.run_id = 1;
    end.frame_id = id;
    end.frame_crc = protocol::crc32c(test_pixels(id));
    (*this)(end);
  }
  FrameAssembler assembler;
};

TEST_CASE("Chunks of any size in any order, overlapping and repeated, give the same frame") {
  std::mt19937 random(2);
  for (int round = 0; round < 300; ++round) {
    Feeder feed;
    feed.begin(0);
    feed.end(0);
    int pieces = 0;
    while (feed.assembler.ready() == 0) {
      const auto from = static_cast<std::uint32_t>(random() % kFrameBytes);
      const auto to = static_cast<std::uint32_t>(from + 1 + random() % (kFrameBytes - from));
      feed.data(0, from, to);
      REQUIRE(++pieces < 5000);
    }
    const auto frame = feed.assembler.pop();
    REQUIRE(frame->status == FrameStatus::kComplete);
    const Bytes expected = test_pixels(0);
    REQUIRE(std::equal(expected.begin(), expected.end(), frame->bytes().begin()));
  }
}

TEST_CASE("Missing ranges are exact, and their bytes are zero") {
  Feeder feed;
  feed.begin(0);
  feed.data(0, 4, 8);
  feed.data(0, 20, 30);
  feed.data(0, 8, 10);
  feed.assembler.flush();
  const auto frame = feed.assembler.pop();
  REQUIRE(frame);
  CHECK(frame->status == FrameStatus::kIncomplete);
  CHECK(frame->missing == std::vector<ByteRange>{{0, 4}, {10, 20}, {30, kFrameBytes}});
  const Bytes expected = test_pixels(0);
  for (std::uint32_t k = 0; k < kFrameBytes; ++k) {
    const bool there = (k >= 4 && k < 10) || (k >= 20 && k < 30);
    REQUIRE(frame->bytes()[k] == (there ? expected[k] : std::byte{0}));
  }
}

TEST_CASE("A frame of other settings or a size that contradicts its window is corrupt") {
  SECTION("epoch") {
    AssemblerLimits limits;
    limits.epoch = 6;
    Feeder feed(limits);
    feed.begin(0);
    feed.data(0, 0, kFrameBytes);
    feed.end(0);
    CHECK(feed.assembler.pop()->status == FrameStatus::kCorrupt);
  }
  SECTION("size") {
    Feeder feed;
    feed.begin(0, 10);
    protocol::FrameData data;
    data.run_id = 1;
    data.total = 10;
    const Bytes bytes(10);
    data.data = bytes;
    feed(data);
    feed.end(0);
    CHECK(feed.assembler.pop()->status == FrameStatus::kCorrupt);
  }
}

TEST_CASE("Chunks beyond the credit, of other runs, too large or malformed are refused and counted") {
  AssemblerLimits limits;
  limits.until = 4;
  limits.max_frame_bytes = kFrameBytes;
  Feeder feed(limits);
  feed.begin(0);
  feed.begin(4);
  CHECK(feed.assembler.counters().unrequested_chunks == 1);
  feed.begin(1, kFrameBytes + 1);
  CHECK(feed.assembler.counters().unrequested_chunks == 2);
  protocol::FrameData data;
  data.run_id = 2;
  feed(data);
  CHECK(feed.assembler.counters().unrequested_chunks == 3);
  data.run_id = 1;
  data.offset = 60;
  data.total = kFrameBytes;
  const Bytes bytes(10);
  data.data = bytes;
  feed(data);
  CHECK(feed.assembler.counters().unrequested_chunks == 4);
  data.offset = 0xFFFFFFFF;
  feed(data);
  CHECK(feed.assembler.counters().unrequested_chunks == 5);
  CHECK(feed.assembler.open() == 1);
}

TEST_CASE("Open frames are bounded: the oldest is settled when another one comes") {
  AssemblerLimits limits;
  limits.max_open = 3;
  Feeder feed(limits);
  for (std::uint32_t id = 0; id < 10; ++id) {
    feed.data(id, 0, 4);
    CHECK(feed.assembler.open() <= 3);
  }
  CHECK(feed.assembler.ready() == 7);
}

TEST_CASE("Frame ids go on across the wrap at 2^32") {
  Feeder feed;
  feed.assembler.skip_to(0x7FFFFFFF);
  feed.assembler.skip_to(0xFFFFFFFE);
  for (std::uint32_t id : {0xFFFFFFFEU, 0xFFFFFFFFU, 0U, 1U}) {
    feed.begin(id);
    feed.data(id, 0, kFrameBytes);
    feed.end(id);
    const auto frame = feed.assembler.pop();
    REQUIRE(frame);
    CHECK(frame->status == FrameStatus::kComplete);
    CHECK(frame->begin.frame_id == id);
  }
}

}  // namespace
}  // namespace scatter::device::test
