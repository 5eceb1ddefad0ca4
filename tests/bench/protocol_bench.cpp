// The wire's inner loops. Their peer is memcpy of the same bytes: what the memory allows.
#include <array>
#include <cstring>
#include <random>
#include <vector>

#include "protocol/cobs.h"
#include "protocol/codec.h"
#include "protocol/crc.h"
#include "protocol/frame.h"
#include "protocol/link_decoder.h"
#include "tests/bench/bench.h"

namespace scatter::bench {

namespace {

constexpr double kBytesPerMegabyte = 1e6;

std::vector<std::byte> random_bytes(std::size_t size) {
  std::mt19937 engine(1);
  std::vector<std::byte> bytes(size);
  for (std::byte& byte : bytes) {
    byte = static_cast<std::byte>(engine());
  }
  return bytes;
}

// A frame chunk's payload as it is on the wire, and a buffer past the caches as recordings are.
std::vector<Figure> crc_throughput() {
  std::vector<Figure> figures;
  for (const auto& [name, size] : {std::pair{"crc.throughput.16KiB", std::size_t{16} << 10},
                                   std::pair{"crc.throughput.64MiB", std::size_t{64} << 20}}) {
    const std::vector<std::byte> bytes = random_bytes(size);
    std::vector<std::byte> copy(size);
    figures.push_back(run_contest(name, {.unit = "MB/s",
                                         .work = static_cast<double>(size) / kBytesPerMegabyte,
                                         .ours = [&] { keep(protocol::crc32c(bytes)); },
                                         .peer = "memcpy",
                                         .theirs =
                                             [&] {
                                               std::memcpy(copy.data(), bytes.data(), size);
                                               keep(copy.data());
                                             }}));
  }
  return figures;
}

std::vector<Figure> codec_throughput() {
  protocol::FrameBegin message;
  message.run_id = 7;
  message.frame_id = 123456;
  message.width = 1440;
  message.height = 1080;
  std::array<std::byte, protocol::max_encoded_size<protocol::FrameBegin>()> bytes{};
  protocol::FrameBegin copy;
  const auto copy_struct = [&] {
    keep(&message);
    std::memcpy(&copy, &message, sizeof copy);
    keep(&copy);
  };
  std::vector<Figure> figures;
  figures.push_back(run_contest("codec.encode.frame_begin", {.unit = "messages/s",
                                                             .work = 1.0,
                                                             .ours =
                                                                 [&] {
                                                                   keep(&message);
                                                                   keep(protocol::encode(message, bytes));
                                                                 },
                                                             .peer = "memcpy of the struct",
                                                             .theirs = copy_struct}));
  figures.push_back(run_contest("codec.decode.frame_begin",
                                {.unit = "messages/s",
                                 .work = 1.0,
                                 .ours =
                                     [&] {
                                       keep(bytes.data());
                                       const auto back = protocol::decode<protocol::FrameBegin>(bytes);
                                       keep(&back);
                                     },
                                 .peer = "memcpy of the struct",
                                 .theirs = copy_struct}));
  return figures;
}

// Random bytes: a zero about every 256 bytes, as in real frames.
std::vector<Figure> cobs_throughput() {
  const std::vector<std::byte> bytes = random_bytes(protocol::kMaxPayload);
  std::vector<std::byte> encoded(protocol::cobs_max_size(bytes.size()) + 1);
  const std::size_t size = protocol::cobs_encode(bytes, encoded);
  encoded[size] = std::byte{0};
  std::vector<std::byte> out(encoded.size());
  std::vector<std::byte> buffer(bytes.size());
  const auto copy = [&] {
    std::memcpy(out.data(), bytes.data(), bytes.size());
    keep(out.data());
  };
  const double megabytes = static_cast<double>(bytes.size()) / kBytesPerMegabyte;
  return {run_contest("cobs.encode", {.unit = "MB/s",
                                      .work = megabytes,
                                      .ours = [&] { keep(protocol::cobs_encode(bytes, out)); },
                                      .peer = "memcpy",
                                      .theirs = copy}),
          run_contest("cobs.decode", {.unit = "MB/s",
                                      .work = megabytes,
                                      .ours =
                                          [&] {
                                            protocol::CobsDecoder decoder(buffer);
                                            auto rest = std::span<const std::byte>(encoded).first(size + 1);
                                            keep(decoder.next(rest));
                                          },
                                      .peer = "memcpy",
                                      .theirs = copy})};
}

// Whole wire frames with full payloads, pushed in pieces as a socket would give them.
std::vector<Figure> decoder_throughput() {
  constexpr std::size_t kFrames = 512;
  constexpr std::size_t kPiece = std::size_t{256} << 10;
  const std::vector<std::byte> payload = random_bytes(protocol::kMaxPayload);
  std::vector<std::byte> wire;
  std::vector<std::byte> frame(protocol::kMaxFrameBytes);
  for (std::size_t i = 0; i < kFrames; ++i) {
    protocol::FrameHeader header;
    header.channel = protocol::Channel::kStream;
    header.sequence = static_cast<std::uint32_t>(i);
    const std::size_t size = protocol::write_frame(frame, header, payload);
    wire.insert(wire.end(), frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size));
  }
  std::vector<std::byte> copy(wire.size());
  std::vector<std::byte> buffer(protocol::kMaxFrameBytes);
  return {run_contest("decoder.throughput", {.unit = "MB/s",
                                             .work = static_cast<double>(wire.size()) / kBytesPerMegabyte,
                                             .ours =
                                                 [&] {
                                                   protocol::LinkDecoder decoder(buffer);
                                                   std::size_t delivered = 0;
                                                   for (std::size_t at = 0; at < wire.size(); at += kPiece) {
                                                     const auto piece = std::span(wire).subspan(
                                                         at, std::min(kPiece, wire.size() - at));
                                                     decoder.push(piece, [&](const protocol::Frame& whole) {
                                                       delivered += whole.payload().size();
                                                     });
                                                   }
                                                   keep(delivered);
                                                 },
                                             .peer = "memcpy",
                                             .theirs =
                                                 [&] {
                                                   std::memcpy(copy.data(), wire.data(), wire.size());
                                                   keep(copy.data());
                                                 }})};
}

const Benchmark kCrc{"crc.throughput", crc_throughput};
const Benchmark kCobs{"cobs", cobs_throughput};
const Benchmark kCodec{"codec", codec_throughput};
const Benchmark kDecoder{"decoder.throughput", decoder_throughput};

}  // namespace

}  // namespace scatter::bench
