#include "protocol/serial.h"

namespace scatter::protocol {

std::size_t write_serial(std::span<std::byte> out, std::span<const std::byte> frame,
                         bool after_idle) noexcept {
  const std::size_t lead = after_idle ? 1 : 0;
  if (out.size() < lead + 1) {
    return 0;
  }
  const std::size_t encoded = cobs_encode(frame, out.subspan(lead, out.size() - lead - 1));
  if (encoded == 0) {
    return 0;
  }
  if (after_idle) {
    out[0] = std::byte{0};
  }
  out[lead + encoded] = std::byte{0};
  return lead + encoded + 1;
}

ParseResult SerialDecoder::next(std::span<const std::byte>& bytes) noexcept {
  for (;;) {
    const CobsDecoder::Event event = cobs_.next(bytes);
    if (event == CobsDecoder::Event::kNeedMore) {
      return {};
    }
    ParseResult result;
    result.status = ParseStatus::kBadHeader;
    if (event == CobsDecoder::Event::kBlock) {
      const std::span<const std::byte> block = cobs_.block();
      result = parse_frame(block, max_payload_);
      const bool whole = result.status == ParseStatus::kFrame || is_refused(result.status);
      if (result.status == ParseStatus::kNeedMore || (whole && result.consumed != block.size())) {
        result.frame.reset();
        result.status = block.size() < kHeaderBytes ? ParseStatus::kBadHeader : ParseStatus::kBadLength;
      } else if (result.status == ParseStatus::kNoMagic) {
        result.status = ParseStatus::kBadHeader;
      }
    } else if (event == CobsDecoder::Event::kTooLong) {
      result.status = ParseStatus::kBadLength;
    }
    result.consumed = cobs_.encoded_size();
    counters_.count(result);
    if (result.status == ParseStatus::kFrame || is_refused(result.status)) {
      return result;
    }
  }
}

}  // namespace scatter::protocol
