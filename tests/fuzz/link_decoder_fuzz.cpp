// Any bytes into the link decoder. Promises: the frames and counters do not depend on the cutting; each
// byte is in one frame or counted as skipped; a frame is only what parse_frame accepts; a whole frame
// after the garbage is delivered.
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/link_decoder.h"
#include "protocol/message_traits.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

using namespace scatter::protocol;

namespace {

struct Seen {
  std::vector<std::byte> frames;
  std::size_t refused_bytes = 0;
  LinkCounters counters;
  friend bool operator==(const Seen&, const Seen&) = default;
};

Seen run(std::span<const std::byte> bytes, std::span<const std::byte> marker, std::size_t piece) {
  static std::array<std::byte, kMaxFrameBytes> buffer;
  LinkDecoder decoder(buffer);
  Seen seen;
  const auto keep = [&](const Frame& frame) {
    require(parse_frame(frame.bytes()).status == ParseStatus::kFrame);
    require(frame.payload().size() == frame.header().payload_length);
    seen.frames.insert(seen.frames.end(), frame.bytes().begin(), frame.bytes().end());
  };
  const auto refuse = [&](const FrameHeader& header, ParseStatus) {
    seen.refused_bytes += kFrameOverhead + header.payload_length;
  };
  const std::size_t step = piece == 0 ? bytes.size() + 1 : piece;
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    decoder.push(bytes.subspan(at, std::min(step, bytes.size() - at)), keep, refuse);
  }
  decoder.push(marker, keep, refuse);
  const std::size_t waiting = decoder.buffered();
  const auto& counted = decoder.counters();
  require(seen.frames.size() + seen.refused_bytes + counted.skipped_bytes + waiting ==
          bytes.size() + marker.size());
  decoder.give_up(keep);
  require(decoder.buffered() == 0);
  seen.counters = decoder.counters();
  return seen;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  std::array<std::byte, 64> marker{};
  const std::size_t marker_size = write_message(marker, header_for<Stop>(0xFEED, 0xFEEDFEED, 0xFEED), Stop{});
  const auto tail = std::span<const std::byte>(marker).first(marker_size);

  const Seen whole = run(bytes, tail, 0);
  require(whole == run(bytes, tail, 1));
  require(whole == run(bytes, tail, 1 + size % 37));
  // The marker is delivered, by itself or as the payload of a whole frame that claimed it.
  const auto& counters = whole.counters;
  if (counters.bad_version + counters.unknown_flags + counters.unknown_channel == 0) {
    require(std::search(whole.frames.begin(), whole.frames.end(), tail.begin(), tail.end()) !=
            whole.frames.end());
  }
  return 0;
}
