// Recordings of any bytes: as they are, and as records with right checksums and hostile contents.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "host_sdk/device/recording_format.h"
#include "host_sdk/device/recording_reader.h"
#include "protocol/crc.h"
#include "protocol/frame.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

namespace {

using namespace scatter;
using namespace scatter::device;

void put(std::vector<std::byte>& file, std::span<const std::byte> bytes) {
  file.insert(file.end(), bytes.begin(), bytes.end());
}

/// Each piece of the input becomes a valid record: type, message id, length, then the payload; wire
/// payloads are wrapped in a frame with right checksums.
std::vector<std::byte> forge(std::span<const std::byte> input) {
  std::vector<std::byte> file;
  put(file, recording::encode_file_header({.creation_unix_ns = 1, .tool = "fuzz"}));
  while (input.size() >= 3) {
    recording::RecordHeader header;
    header.type = static_cast<recording::RecordType>(static_cast<unsigned>(input[0]) % 8);
    const auto message = static_cast<std::uint16_t>(input[1]);
    const std::size_t length = std::min<std::size_t>(static_cast<std::size_t>(input[2]), input.size() - 3);
    std::vector<std::byte> payload(input.begin() + 3,
                                   input.begin() + 3 + static_cast<std::ptrdiff_t>(length));
    input = input.subspan(3 + length);
    if (header.type == recording::RecordType::kWire) {
      // 0x80 and up: the replies Started and RunReport; else stream messages and events.
      protocol::FrameHeader frame;
      frame.message = message >= 0x80 ? static_cast<std::uint16_t>(0x8000U | (message & 0x0FU))
                                      : static_cast<std::uint16_t>(0x0100U | (message & 0x03U));
      frame.channel = message >= 0x80 ? protocol::Channel::kControl : protocol::Channel::kStream;
      std::vector<std::byte> wire(protocol::kFrameOverhead + payload.size());
      require(protocol::write_frame(wire, frame, payload) == wire.size());
      payload = std::move(wire);
      header.message = frame.message;
    } else {
      header.payload_crc = protocol::crc32c(payload);
    }
    header.length = static_cast<std::uint32_t>(payload.size());
    put(file, recording::encode(header));
    put(file, payload);
    file.resize(recording::padded(file.size()));
  }
  return file;
}

void read(std::span<const std::byte> bytes) {
  const Result<RecordingReader> reader = RecordingReader::from_bytes(bytes);
  if (!reader) {
    require(!reader.error().what.empty() && !reader.error().remedy.empty());
    return;
  }
  require(reader->integrity().bytes_lost <= bytes.size());
  require(reader->integrity().perfect() == reader->integrity().text().empty());
  (void)reader->descriptor();
  (void)reader->hello();
  for (const std::string& name : reader->attachment_names()) {
    const auto blob = reader->attachment(name);
    require(blob.has_value() && blob->data() >= bytes.data() &&
            blob->data() + blob->size() <= bytes.data() + bytes.size());
  }
  for (std::size_t run = 0; run < reader->runs().size(); ++run) {
    Result<RunCursor> cursor = reader->frames(run);
    require(cursor.has_value());
    std::uint64_t complete = 0;
    for (;;) {
      const Result<std::optional<Frame>> frame = cursor->next();
      require(frame.has_value());
      if (!*frame) {
        break;
      }
      const Frame& one = **frame;
      if (one.status == FrameStatus::kComplete) {
        ++complete;
        require(one.has_begin && one.has_end && one.missing.empty());
        require(one.size_bytes == packed_bytes(one.begin.pixel_format, one.pixel_count()));
        require(protocol::crc32c(one.bytes()) == one.end.frame_crc);
      }
      std::uint32_t at = 0;
      for (const ByteRange& gap : one.missing) {
        require(gap.begin >= at && gap.end > gap.begin);
        at = gap.end;
      }
    }
    require(cursor->summary().ledger.delivered == complete);
  }
  require(reader->verify().corrupted_records >= reader->integrity().corrupted_records ||
          !reader->integrity().perfect());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span<const std::byte> input(reinterpret_cast<const std::byte*>(data), size);
  read(input);
  read(forge(input));
  return 0;
}
