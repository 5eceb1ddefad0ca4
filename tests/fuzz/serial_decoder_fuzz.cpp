// Any bytes into the serial decoder. Promises: the frames and counters do not depend on the cutting; a
// frame is only what parse_frame accepts; a frame behind a zero is delivered; COBS gives back its input.
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/message_traits.h"
#include "protocol/serial.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

using namespace scatter::protocol;

namespace {

struct Seen {
  std::vector<std::byte> frames;
  LinkCounters counters;
  friend bool operator==(const Seen&, const Seen&) = default;
};

Seen run(std::span<const std::byte> bytes, std::span<const std::byte> marker, std::size_t piece) {
  static std::array<std::byte, kFrameOverhead + kMaxSerialPayload> buffer;
  SerialDecoder decoder(buffer);
  Seen seen;
  const auto keep = [&](const Frame& frame) {
    require(parse_frame(frame.bytes()).status == ParseStatus::kFrame);
    seen.frames.insert(seen.frames.end(), frame.bytes().begin(), frame.bytes().end());
  };
  const std::size_t step = piece == 0 ? bytes.size() + 1 : piece;
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    decoder.push(bytes.subspan(at, std::min(step, bytes.size() - at)), keep);
  }
  decoder.push(marker, keep);
  seen.counters = decoder.counters();
  return seen;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  std::array<std::byte, 64> frame{};
  const std::size_t frame_size = write_message(frame, header_for<Stop>(0xFEED, 0xFEEDFEED, 0xFEED), Stop{});
  std::array<std::byte, 80> line{};
  const std::size_t line_size = write_serial(line, std::span(frame).first(frame_size), true);
  const auto marker = std::span<const std::byte>(line).first(line_size);

  const Seen whole = run(bytes, marker, 0);
  require(whole == run(bytes, marker, 1));
  require(whole == run(bytes, marker, 1 + size % 29));
  require(whole.frames.size() >= frame_size);
  require(std::equal(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(frame_size),
                     whole.frames.end() - static_cast<std::ptrdiff_t>(frame_size)));

  std::vector<std::byte> encoded(cobs_max_size(size));
  const std::size_t encoded_size = cobs_encode(bytes, encoded);
  require(encoded_size > 0);
  encoded.resize(encoded_size);
  require(std::ranges::find(encoded, std::byte{0}) == encoded.end());
  encoded.push_back({});
  std::vector<std::byte> decoded(size);
  CobsDecoder decoder(decoded);
  std::span<const std::byte> in(encoded);
  require(decoder.next(in) == CobsDecoder::Event::kBlock);
  require(std::ranges::equal(decoder.block(), bytes));
  return 0;
}
