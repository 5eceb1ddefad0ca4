// Every golden vector of the wire on the ARM build of protocol/.
#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include <golden_table.h>
#include "firmware/boards/mps2_an500/startup.h"
#include "protocol/crc.h"
#include "protocol/message_traits.h"
#include "protocol/serial.h"
#include "protocol/session.h"
#include "tests/firmware_arm/semihosting.h"

namespace scatter::firmware::golden {
namespace {

using semihosting::check;
using Bytes = std::span<const std::byte>;

constinit std::array<std::byte, protocol::kMaxFrameBytes> buffer{};

[[nodiscard]] Bytes bytes_of(Piece piece) noexcept {
  return std::as_bytes(std::span(kBytes)).subspan(piece.at, piece.size);
}

/// Calls use.operator()<M>() for the message with this number; false: there is none.
template <typename Use>
bool with_message(std::uint16_t number, Use&& use) noexcept {
  bool found = false;
  protocol::for_each_message([&]<typename M>() {
    if (static_cast<std::uint16_t>(M::kId) == number) {
      use.template operator()<M>();
      found = true;
    }
  });
  return found;
}

void check_frame(const FrameVector& vector) noexcept {
  const protocol::ParseResult parsed = protocol::parse_frame(bytes_of(vector.frame));
  check(parsed.frame.has_value(), vector.name);
  check(parsed.consumed == vector.frame.size, vector.name);
  check(parsed.header.message == vector.message, vector.name);
  const bool known = with_message(vector.message, [&]<typename M>() {
    const auto message = parsed.frame->as<M>();
    check(message.has_value(), vector.name);
    const std::size_t size = protocol::write_message(buffer, parsed.header, *message);
    check(std::ranges::equal(std::span(buffer).first(size), bytes_of(vector.frame)), vector.name);
  });
  check(known, vector.name);
}

void check_payload(const PayloadVector& vector, bool taken) noexcept {
  const bool known = with_message(vector.message, [&]<typename M>() {
    const auto message = protocol::decode<M>(bytes_of(vector.payload));
    check(message.has_value() == taken, vector.rule);
    if (message) {
      const auto size = protocol::encode(*message, buffer);
      check(size && std::ranges::equal(std::span(buffer).first(*size), bytes_of(vector.canonical)),
            vector.rule);
    }
  });
  check(known, vector.rule);
}

void check_serial(const SerialVector& vector) noexcept {
  const std::size_t size = protocol::write_serial(buffer, bytes_of(vector.frame), false);
  check(std::ranges::equal(std::span(buffer).first(size), bytes_of(vector.line)), vector.rule);
}

void check_rejected_serial(const SerialVector& vector) noexcept {
  protocol::SerialDecoder decoder(buffer);
  const auto deliver = [&](const protocol::Frame&) { check(false, vector.rule); };
  decoder.push(bytes_of(vector.line), deliver);
  check(decoder.counters().bad_header + decoder.counters().bad_length == 1, vector.rule);
}

void check_refusal() noexcept {
  const protocol::ParseResult parsed = protocol::parse_frame(bytes_of(kRefusedHello));
  check(parsed.frame.has_value(), "the refused HELLO");
  const auto hello = parsed.frame->as<protocol::Hello>();
  check(hello.has_value(), "the refused HELLO's payload");
  const protocol::Negotiation answer = protocol::negotiate(*hello, {}, 0);
  const auto header =
      protocol::header_for<protocol::StatusReply>(parsed.header.session, 0, parsed.header.correlation);
  const std::size_t size = protocol::write_message(buffer, header, answer.refusal);
  check(std::ranges::equal(std::span(buffer).first(size), bytes_of(kRefusal)), "the refusal of a HELLO");
}

}  // namespace
}  // namespace scatter::firmware::golden

void run_image() noexcept {
  using namespace scatter::firmware::golden;
  namespace semihosting = scatter::firmware::semihosting;
  for (const CrcVector& vector : kCrcs) {
    check(scatter::protocol::crc32c(bytes_of(vector.bytes)) == vector.crc, "CRC-32C");
  }
  std::ranges::for_each(kFrames, check_frame);
  for (const RejectedVector& vector : kRejectedFrames) {
    check(scatter::protocol::parse_frame(bytes_of(vector.bytes)).status == vector.status, vector.rule);
  }
  std::ranges::for_each(kRejectedPayloads, [](const PayloadVector& v) { check_payload(v, false); });
  std::ranges::for_each(kToleratedPayloads, [](const PayloadVector& v) { check_payload(v, true); });
  std::ranges::for_each(kSerial, check_serial);
  std::ranges::for_each(kRejectedSerial, check_rejected_serial);
  check_refusal();
  semihosting::print(static_cast<std::uint32_t>(std::size(kFrames)));
  semihosting::print(" frames\n");
  semihosting::exit(0);
}
