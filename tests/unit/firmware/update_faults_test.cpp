// The fault matrix's column of firmware updates: damaged, cut-off and repeated frames; see also
// tests/power_cuts.
#include <catch2/catch.hpp>

#include "tests/unit/firmware/update_device.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

constexpr std::uint32_t kChunk = 64;

/// A whole update_write frame as it goes over the wire.
std::vector<std::byte> write_frame_bytes(const Image& image, std::uint32_t offset, std::uint16_t session,
                                         std::uint16_t correlation) {
  UpdateWrite message;
  message.offset = offset;
  message.data = std::span(image.body).subspan(offset, kChunk);
  FrameHeader header;
  header.session = session;
  header.correlation = correlation;
  std::vector<std::byte> bytes(encoded_size(message) + kFrameOverhead);
  REQUIRE(write_message(bytes, header, message) == bytes.size());
  return bytes;
}

void put(Device& device, std::span<const std::byte> bytes) {
  device.board.link.to_device.insert(device.board.link.to_device.end(), bytes.begin(), bytes.end());
}

void require_body(Device& device, const Image& image, std::uint32_t end) {
  std::vector<std::byte> found(end);
  REQUIRE(device.slots.slot(1).read(kImageBodyOffset, found));
  CHECK(std::equal(found.begin(), found.end(), image.body.begin()));
}

}  // namespace

TEST_CASE("No flipped bits of an update_write frame reach the flash, and sending it again does") {
  const std::uint32_t flips = GENERATE(1U, 2U, 5U);
  Device device;
  const Image b = Device::image("2.0.0", 1, 1, 15'000);
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  std::uint32_t at = 0;
  std::uint32_t random = 1;
  const std::size_t bits = 8 * write_frame_bytes(b, 0, 1, 1).size();
  for (std::size_t bit = 0; bit < bits && at + kChunk < 15'000; bit += 4) {
    std::vector<std::byte> frame = write_frame_bytes(b, at, device.host->session, 0x700);
    std::size_t flipped = bit;
    for (std::uint32_t i = 0; i < flips; ++i) {
      frame[flipped / 8] ^= static_cast<std::byte>(1U << flipped % 8);
      random = random * 1'664'525 + 1'013'904'223;
      flipped = (flipped + 1 + (random >> 8U) % (bits / 8)) % bits;  // Five such steps never come round.
    }
    put(device, frame);
    device.host->run_for(1'500'000);  // The decoder gives a damaged length up.
    INFO("bit " << bit);
    CHECK(device.host->replies(0x700).empty());
    REQUIRE(device.write(b, at, kChunk).status == StatusCode::kOk);
    at += kChunk;
  }
  require_body(device, b, at);
  device.write_rest(b, 15'000);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kOk);
}

TEST_CASE("A frame that ends anywhere because the cable is pulled is sent again in the next session") {
  Device device;
  const Image b = Device::image("2.0.0", 1, 1, 15'000);
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  const std::size_t size = write_frame_bytes(b, 0, 1, 1).size();
  for (std::size_t length = 0; length < size; ++length) {
    const auto at = static_cast<std::uint32_t>(length) * kChunk;
    const std::vector<std::byte> frame = write_frame_bytes(b, at, device.host->session, 0x700);
    put(device, std::span(frame).first(length));
    device.host->run_for(1'000);
    device.board.link.attached = false;
    device.host->run_for(1'000);
    device.board.link.attached = true;
    ++device.host->session;
    device.host->hello();
    INFO("after " << length << " bytes");
    REQUIRE(device.state().received == at);
    REQUIRE(device.write(b, at, kChunk).status == StatusCode::kOk);
  }
  require_body(device, b, static_cast<std::uint32_t>(size) * kChunk);
}

TEST_CASE("Every frame of an update sent twice is executed once") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  const auto twice = [&](const auto& message, std::uint16_t correlation) {
    device.host->send_as(message, correlation);
    device.host->send_as(message, correlation);
    REQUIRE(device.host->run(1'000'000, [&] { return device.host->final_reply(correlation).has_value(); }));
    device.host->run_for(1'000);
    CHECK(device.host->final_reply(correlation)->as<StatusReply>().status == StatusCode::kOk);
  };
  UpdateBegin begin;
  std::ranges::transform(b.header_bytes, begin.header.begin(),
                         [](std::byte byte) { return static_cast<std::uint8_t>(byte); });
  const std::uint64_t before = device.slots.supply.operations();
  twice(begin, 0x700);
  // 5 units erased, one header: not twice that.
  CHECK(device.slots.supply.operations() - before == 6);
  std::uint16_t correlation = 0x701;
  for (std::uint32_t at = 0; at < 9000; at += 960) {
    UpdateWrite write;
    write.offset = at;
    write.data = std::span(b.body).subspan(at, std::min<std::size_t>(960, 9000 - at));
    twice(write, correlation++);
  }
  twice(UpdateFinish{}, 0x7F0);
  require_body(device, b, 9000);
  CHECK(read_marks(device.slots.slot(1)).last == MarkKind::kReady);
}

TEST_CASE("A host that falls silent for hours in the middle of an update finds it as it was") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  device.write_rest(b, 4096);
  device.board.clock.time_us += 5ULL * 3600 * 1'000'000;
  device.host->run_for(10'000'000);
  CHECK(device.state().received == 4096);
  device.write_rest(b, 9000);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kOk);
}
