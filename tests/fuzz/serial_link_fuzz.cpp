// Any bytes in both directions of the serial link. The first byte says how they are cut.
//
// Received: every byte that the core gets belongs to a whole intact frame, and after a zero the next good
// frame arrives. Sent: whatever the core writes, the line carries whole frames between zeros and nothing
// else, and a good frame after anything arrives unless the bytes before it announced a frame that it became
// part of.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "firmware/core/serial_link.h"
#include "tests/fuzz/require.h"

namespace {

using scatter::firmware::Link;
using scatter::firmware::SerialLink;
using scatter::fuzz::require;
namespace protocol = scatter::protocol;
using Bytes = std::vector<std::byte>;

struct Line final : Link {
  Bytes in;
  std::size_t at = 0;
  Bytes out;
  std::size_t piece = 1;
  std::size_t read(std::span<std::byte> to) noexcept override {
    const std::size_t count = std::min({to.size(), piece, in.size() - at});
    std::copy_n(in.begin() + static_cast<std::ptrdiff_t>(at), count, to.begin());
    at += count;
    return count;
  }
  std::size_t write(std::span<const std::byte> bytes) noexcept override {
    const std::size_t count = std::min(bytes.size(), piece);
    out.insert(out.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
  bool connected() noexcept override { return true; }
};

Bytes good_frame() {
  Bytes frame(protocol::kFrameOverhead + 5, std::byte{0x5A});
  protocol::FrameHeader header;
  header.message = 0x0123;
  header.sequence = 77;
  (void)protocol::finish_frame(frame, header, 5);
  return frame;
}

void receive(std::span<const std::byte> bytes, std::size_t piece) {
  Line line;
  line.piece = piece;
  line.in.assign(bytes.begin(), bytes.end());
  line.in.push_back(std::byte{0});
  const Bytes good = good_frame();
  Bytes serial(protocol::serial_max_size(good.size()));
  serial.resize(protocol::write_serial(serial, good, false));
  line.in.insert(line.in.end(), serial.begin(), serial.end());

  SerialLink link(line);
  Bytes got;
  std::array<std::byte, 96> out{};
  for (std::size_t idle = 0; idle < 2;) {
    const std::size_t count = link.read(std::span(out).first(1 + piece % out.size()));
    idle = count == 0 ? idle + 1 : 0;
    got.insert(got.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count));
  }
  std::span<const std::byte> rest(got);
  std::size_t last = 0;
  while (!rest.empty()) {
    const protocol::ParseResult result = protocol::parse_frame(rest, protocol::kMaxSerialPayload);
    require(result.frame.has_value() || protocol::is_refused(result.status));
    last = result.consumed;
    rest = rest.subspan(result.consumed);
  }
  require(last == good.size() &&
          std::equal(good.begin(), good.end(), got.end() - static_cast<std::ptrdiff_t>(last)));
}

void send(std::span<const std::byte> bytes, std::size_t piece) {
  Line line;
  line.piece = piece;
  SerialLink link(line);
  std::size_t at = 0;
  for (std::size_t turn = 0; turn < 4 * bytes.size() + 16; ++turn) {
    at += link.write(bytes.subspan(at, std::min(piece, bytes.size() - at)));
    link.pump();
  }
  require(at <= bytes.size());
  // Between zeros lie COBS blocks of frames with a length that fits; their checksums are the core's affair.
  std::array<std::byte, protocol::kFrameOverhead + protocol::kMaxSerialPayload> buffer{};
  protocol::CobsDecoder blocks(buffer);
  std::span<const std::byte> rest(line.out);
  for (auto event = blocks.next(rest); event != protocol::CobsDecoder::Event::kNeedMore;
       event = blocks.next(rest)) {
    require(event == protocol::CobsDecoder::Event::kBlock);
    require(blocks.block().size() >= protocol::kFrameOverhead);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::span<const std::byte> bytes = std::as_bytes(std::span(data, size)).subspan(1);
  const std::size_t piece = std::size_t{1} + data[0];
  receive(bytes, piece);
  send(bytes, piece);
  return 0;
}
