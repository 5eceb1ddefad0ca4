// The wire against vectors that an independent Python program made (tests/golden/make_vectors.py).
#include <catch2/catch.hpp>
#include <fstream>
#include <set>

#include "protocol/cobs.h"
#include "protocol/crc.h"
#include "protocol/descriptor.h"
#include "protocol/link_decoder.h"
#include "protocol/serial.h"
#include "protocol/session.h"
#include "tests/unit/protocol/json_fields.h"

namespace scatter::protocol::test {
namespace {

const nlohmann::json& vectors() {
  static const nlohmann::json document = [] {
    std::ifstream file("tests/golden/protocol_vectors.json");
    REQUIRE(file);
    return nlohmann::json::parse(file);
  }();
  return document;
}

/// Calls visit.operator()<M>() for the message named; fails when there is none.
template <typename Visit>
void with_message(const std::string& name, Visit&& visit) {
  bool found = false;
  for_each_message([&]<typename M>() {
    if (M::kName == name) {
      found = true;
      visit.template operator()<M>();
    }
  });
  INFO(name);
  REQUIRE(found);
}

template <typename M>
Bytes encoded(const M& message) {
  Bytes bytes(encoded_size(message));
  REQUIRE(encode(message, bytes) == bytes.size());
  return bytes;
}

ParseStatus status_named(const std::string& name) {
  const std::map<std::string, ParseStatus> kNames{
      {"need_more", ParseStatus::kNeedMore},         {"no_magic", ParseStatus::kNoMagic},
      {"bad_header", ParseStatus::kBadHeader},       {"bad_length", ParseStatus::kBadLength},
      {"bad_payload", ParseStatus::kBadPayload},     {"bad_version", ParseStatus::kBadVersion},
      {"unknown_flags", ParseStatus::kUnknownFlags}, {"unknown_channel", ParseStatus::kUnknownChannel}};
  return kNames.at(name);
}

// PROVES: SPEC 1.8
TEST_CASE("CRC-32C gives the check values of RFC 3720 and of the golden vectors") {
  for (const auto& vector : vectors()["crc32c"]) {
    const Bytes bytes = from_hex(vector["bytes"].get<std::string>());
    CHECK(crc32c(bytes) == vector["crc"].get<std::uint32_t>());
    CHECK(crc32c_table(bytes) == vector["crc"].get<std::uint32_t>());
    CHECK(crc32c_bitwise(bytes) == vector["crc"].get<std::uint32_t>());
  }
}

// PROVES: SPEC 1.1, 4.1
TEST_CASE("Every golden message encodes to its bytes and decodes to its fields") {
  std::map<std::string, int> seen;
  for (const auto& vector : vectors()["frames"]) {
    const auto name = vector["message"].get<std::string>();
    INFO(vector["name"]);
    ++seen[name];
    with_message(name, [&]<typename M>() {
      REQUIRE(static_cast<std::uint16_t>(M::kId) == vector["id"].get<std::uint16_t>());
      const Bytes payload = from_hex(vector["payload"].get<std::string>());
      const Bytes frame = from_hex(vector["frame"].get<std::string>());
      const auto& header = vector["header"];

      M message;
      Bytes tail;
      from_json(vector["fields"], message, tail);
      CHECK(encoded(message) == payload);

      FrameHeader mine =
          header_for<M>(header["session"].get<std::uint16_t>(), header["sequence"].get<std::uint32_t>(),
                        header["correlation"].get<std::uint16_t>());
      CHECK(static_cast<int>(mine.channel) == header["channel"].get<int>());
      mine.compatible_flags = header["compatible"].get<std::uint8_t>();
      Bytes built(kMaxFrameBytes);
      built.resize(write_message(built, mine, message));
      CHECK(built == frame);

      const ParseResult parsed = parse_frame(frame);
      REQUIRE(parsed.status == ParseStatus::kFrame);
      CHECK(parsed.consumed == frame.size());
      mine.payload_length = static_cast<std::uint32_t>(payload.size());
      CHECK(parsed.frame->header() == mine);
      const auto decoded = parsed.frame->template as<M>();
      REQUIRE(decoded);
      CHECK(to_json(*decoded) == vector["fields"]);
      CHECK(encoded(*decoded) == payload);
    });
  }
  CHECK(seen.size() == std::tuple_size_v<AllMessages>);
  for (const auto& [name, count] : seen) {
    INFO(name);
    CHECK(count >= 3);
  }
}

// PROVES: SPEC 10.1
TEST_CASE("The golden descriptors encode to their bytes and decode to their fields") {
  for (const auto& vector : vectors()["objects"]) {
    INFO(vector["name"]);
    const Bytes bytes = from_hex(vector["bytes"].get<std::string>());
    Descriptor descriptor;
    Bytes unused;
    from_json(vector["fields"], descriptor, unused);
    CHECK(encoded(descriptor) == bytes);
    const auto decoded = decode<Descriptor>(bytes);
    REQUIRE(decoded);
    CHECK(*decoded == descriptor);
    CHECK(to_json(*decoded) == vector["fields"]);
  }
}

// PROVES: SPEC 1.2, 1.4, 1.5, 1.7
TEST_CASE("Every rejected golden frame is rejected for its own reason and never delivered") {
  std::set<std::string> reasons;
  for (const auto& vector : vectors()["rejected_frames"]) {
    INFO(vector["rule"]);
    const Bytes bytes = from_hex(vector["bytes"].get<std::string>());
    const ParseResult parsed = parse_frame(bytes);
    CHECK(parsed.status == status_named(vector["status"].get<std::string>()));
    CHECK_FALSE(parsed.frame);
    reasons.insert(vector["status"].get<std::string>());
    Bytes buffer(kMaxFrameBytes);
    LinkDecoder decoder(buffer);
    decoder.push(bytes, [](const Frame&) { FAIL("delivered"); });
    decoder.give_up([](const Frame&) { FAIL("delivered"); });
    CHECK(decoder.counters().good == 0);
  }
  CHECK(reasons.size() == 8);
}

// PROVES: SPEC 4.2, 4.4, 4.7
TEST_CASE("Every rejected golden payload is rejected") {
  for (const auto& vector : vectors()["rejected_payloads"]) {
    INFO(vector["rule"]);
    with_message(vector["message"].get<std::string>(), [&]<typename M>() {
      CHECK_FALSE(decode<M>(from_hex(vector["payload"].get<std::string>())));
    });
  }
}

// PROVES: SPEC 4.3, 4.5, 4.6
TEST_CASE("Payloads of older and newer senders decode as the golden vectors say") {
  for (const auto& vector : vectors()["tolerated_payloads"]) {
    INFO(vector["rule"]);
    with_message(vector["message"].get<std::string>(), [&]<typename M>() {
      const Bytes payload = from_hex(vector["payload"].get<std::string>());
      const auto decoded = decode<M>(payload);
      REQUIRE(decoded);
      CHECK(to_json(*decoded) == vector["fields"]);
      CHECK(encoded(*decoded) == from_hex(vector["canonical"].get<std::string>()));
    });
  }
}

// PROVES: SPEC 3.1
TEST_CASE("Serial lines carry the golden frames as the golden bytes") {
  for (const auto& vector : vectors()["serial"]) {
    INFO(vector["rule"]);
    const Bytes frame = from_hex(vector["frame"].get<std::string>());
    const Bytes line = from_hex(vector["line"].get<std::string>());
    Bytes written(serial_max_size(frame.size()));
    written.resize(write_serial(written, frame, false));
    CHECK(written == line);
    Bytes buffer(kMaxFrameBytes);
    SerialDecoder decoder(buffer);
    Bytes got;
    decoder.push(line, [&](const Frame& one) { append(got, one.bytes()); });
    CHECK(got == frame);
  }
}

// PROVES: SPEC 3.3
TEST_CASE("Serial blocks that are not exactly one frame are dropped") {
  for (const auto& vector : vectors()["rejected_serial"]) {
    INFO(vector["rule"]);
    Bytes buffer(kMaxFrameBytes);
    SerialDecoder decoder(buffer);
    decoder.push(from_hex(vector["line"].get<std::string>()), [](const Frame&) { FAIL("delivered"); });
    CHECK(decoder.counters().bad_header + decoder.counters().bad_length == 1);
  }
}

// PROVES: SPEC 6.4
TEST_CASE("A HELLO without a common wire major gets the frozen refusal, byte for byte") {
  const auto& vector = vectors()["version_mismatch"];
  const Bytes request = from_hex(vector["hello"].get<std::string>());
  const ParseResult parsed = parse_frame(request);
  REQUIRE(parsed.status == ParseStatus::kFrame);
  const auto hello = parsed.frame->as<Hello>();
  REQUIRE(hello);
  const Negotiation answer = negotiate(*hello, {}, 0);
  CHECK(answer.status == StatusCode::kVersionMismatch);
  Bytes reply(kMaxFrameBytes);
  reply.resize(write_message(
      reply, header_for<StatusReply>(parsed.header.session, 0, parsed.header.correlation), answer.refusal));
  CHECK(reply == from_hex(vector["reply"].get<std::string>()));
}

}  // namespace
}  // namespace scatter::protocol::test
