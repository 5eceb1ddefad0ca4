// Any bytes on the lines between the emulated board and what surrounds it. The first byte says how they are
// cut.
//
// Backplane: any cutting gives the same messages, and an intact one has a right check.
// Relay: from the device, after a zero the next good frame reaches the host as it is; from the host, after a
// silence the next good frame reaches the line and decodes to the same bytes; what waits stays bounded.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "protocol/serial.h"
#include "simulator/emulator/backplane_line.h"
#include "simulator/emulator/serial_relay.h"
#include "tests/fuzz/require.h"

namespace {

using scatter::fuzz::require;
using scatter::simulator::BackplaneDecoder;
using scatter::simulator::SerialRelay;
namespace backplane = scatter::firmware::backplane;
namespace protocol = scatter::protocol;
using Bytes = std::vector<std::byte>;

struct Heard {
  std::uint8_t kind;
  Bytes payload;
  bool intact;
  bool operator==(const Heard&) const = default;
};

std::vector<Heard> messages_of(std::span<const std::byte> bytes, std::size_t piece) {
  BackplaneDecoder decoder;
  std::vector<Heard> heard;
  while (!bytes.empty()) {
    const std::size_t count = std::min(piece, bytes.size());
    decoder.push(bytes.first(count), [&](const BackplaneDecoder::Message& message) {
      heard.push_back({message.kind, {message.payload.begin(), message.payload.end()}, message.intact});
    });
    bytes = bytes.subspan(count);
  }
  for (const Heard& message : heard) {
    require(message.payload.size() <= backplane::kMaxPayload);
  }
  return heard;
}

Bytes good_frame() {
  Bytes frame(protocol::kFrameOverhead + 5, std::byte{0x5A});
  protocol::FrameHeader header;
  header.message = 0x0123;
  header.sequence = 77;
  (void)protocol::finish_frame(frame, header, 5);
  return frame;
}

Bytes read_all(SerialRelay& relay) {
  Bytes out(relay.readable());
  out.resize(relay.host_read(out));
  return out;
}

void from_device(std::span<const std::byte> bytes, std::size_t piece) {
  SerialRelay relay;
  relay.attach();
  Bytes host;
  const auto feed = [&](std::span<const std::byte> some) {
    while (!some.empty()) {
      const std::size_t count = std::min({piece, some.size(), relay.room_from_device()});
      require(count > 0);
      relay.from_device(some.first(count));
      some = some.subspan(count);
      const Bytes read = read_all(relay);
      host.insert(host.end(), read.begin(), read.end());
    }
  };
  const Bytes good = good_frame();
  Bytes line(protocol::serial_max_size(good.size()));
  line.resize(protocol::write_serial(line, good, true));
  feed(bytes);
  feed(line);
  require(host.size() >= good.size() &&
          std::equal(good.begin(), good.end(), host.end() - static_cast<std::ptrdiff_t>(good.size())));
}

void from_host(std::span<const std::byte> bytes, std::size_t piece) {
  SerialRelay relay;
  relay.attach();
  std::vector<std::byte> buffer(protocol::kMaxFrameBytes);
  protocol::SerialDecoder line(buffer);
  Bytes last;
  const auto drain = [&] {
    require(relay.to_device().size() <= SerialRelay::kRoom + 2 * protocol::kMaxFrameBytes);
    line.push(relay.to_device(), [&](const protocol::Frame& frame) {
      last.assign(protocol::kFrameOverhead + frame.payload().size(), std::byte{});
      std::ranges::copy(frame.payload(), last.begin() + protocol::kHeaderBytes);
      (void)protocol::finish_frame(last, frame.header(), frame.payload().size());
    });
    relay.sent_to_device(relay.to_device().size());
  };
  const auto feed = [&](std::span<const std::byte> some) {
    while (!some.empty()) {
      const std::size_t count = std::min({piece, some.size(), relay.writable()});
      require(count > 0);
      relay.from_host(some.first(count));
      some = some.subspan(count);
      drain();
    }
  };
  feed(bytes);
  relay.host_was_silent();
  drain();
  const Bytes good = good_frame();
  feed(good);
  require(last == good);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::size_t piece = 1 + data[0] % 64;
  const auto bytes = std::as_bytes(std::span(data + 1, size - 1));
  require(messages_of(bytes, piece) == messages_of(bytes, bytes.size() + 1));
  from_device(bytes, piece);
  from_host(bytes, piece);
  return 0;
}
