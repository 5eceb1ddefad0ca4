#include "protocol/codec.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "protocol/descriptor.h"
#include "protocol/schema_description.h"
#include "tests/unit/protocol/test_bytes.h"

namespace scatter::protocol::test {
namespace {

template <Message M>
Bytes encoded(const M& message) {
  Bytes bytes(encoded_size(message));
  REQUIRE(encode(message, bytes) == bytes.size());
  return bytes;
}

Recipe some_recipe() {
  Recipe recipe;
  for (std::uint8_t i = 0; i < 12; ++i) {
    recipe.illuminations.push_back(i);
  }
  recipe.exposures_us.push_back(2500);
  recipe.exposures_us.push_back(125000);
  recipe.repeats = 2;
  recipe.target = Target::kWhiteReference;
  return recipe;
}

// PROVES: SPEC 4.3, 4.4
TEST_CASE("A message cut at any byte is rejected or is the message with its last fields at default") {
  const SetConfiguration message{.recipe = some_recipe()};
  const Bytes bytes = encoded(message);
  std::size_t whole = 0;
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    const auto decoded = decode<SetConfiguration>(std::span(bytes).first(cut));
    if (!decoded) {
      continue;
    }
    ++whole;
    // What the cut left out is default, what it kept is as sent: encoding gives the kept bytes back.
    const Bytes again = encoded(*decoded);
    REQUIRE(std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(cut), again.begin()));
    SetConfiguration expected;
    REQUIRE(decode_into(std::span(bytes).first(cut), expected));
    REQUIRE(expected.recipe == decoded->recipe);
  }
  // Once before each of the 16 fields and once at the end.
  CHECK(whole == 17);
}

// PROVES: SPEC 4.3
TEST_CASE("An empty payload is every message with its defaults") {
  for_each_message([]<typename M>() {
    const auto decoded = decode<M>({});
    REQUIRE(decoded);
    REQUIRE(encoded(*decoded) == encoded(M{}));
  });
}

// PROVES: SPEC 4.5
TEST_CASE("Extra trailing bytes are ignored by every message that has no tail") {
  for_each_message([]<typename M>() {
    if constexpr (!has_tail<M>()) {
      Bytes bytes = encoded(M{});
      const Bytes exact = bytes;
      append(bytes, Bytes(5, std::byte{0xEE}));
      const auto decoded = decode<M>(bytes);
      REQUIRE(decoded);
      REQUIRE(encoded(*decoded) == exact);
    }
  });
}

// PROVES: SPEC 4.2
TEST_CASE("A count over its bound is rejected and the bound itself is accepted") {
  Bytes bytes(2 + 32);
  store_le(bytes.data(), std::uint16_t{32});
  CHECK(decode<KeyValueGet>(bytes));
  bytes.push_back({});
  store_le(bytes.data(), std::uint16_t{33});
  CHECK_FALSE(decode<KeyValueGet>(bytes));
  store_le(bytes.data(), std::uint16_t{0xFFFF});
  CHECK_FALSE(decode<KeyValueGet>(bytes));
}

// PROVES: SPEC 4.1
TEST_CASE("Decoding what was encoded gives every float back bit for bit, NaN and infinity included") {
  for (const float value :
       {0.0F, -0.0F, 1.5F, std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::infinity(),
        std::numeric_limits<float>::quiet_NaN()}) {
    CalibrationCommit commit;
    commit.manifest.scalars.push_back(value);
    const auto decoded = decode<CalibrationCommit>(encoded(commit));
    REQUIRE(decoded);
    CHECK(std::bit_cast<std::uint32_t>(decoded->manifest.scalars[0]) == std::bit_cast<std::uint32_t>(value));
  }
}

TEST_CASE("Encoding into too little room writes nothing") {
  const SetConfiguration message{.recipe = some_recipe()};
  const std::size_t size = encoded_size(message);
  for (std::size_t room = 0; room < size; ++room) {
    Bytes out(room, std::byte{0x77});
    REQUIRE_FALSE(encode(message, out));
    REQUIRE(out == Bytes(room, std::byte{0x77}));
  }
}

// PROVES: SPEC 4.8
TEST_CASE("A tail is a view of the payload and takes all of its rest") {
  const Bytes pixels(321, std::byte{0x42});
  const FrameData message{.run_id = 1, .frame_id = 2, .offset = 3, .total = 4, .data = pixels};
  const Bytes bytes = encoded(message);
  const auto decoded = decode<FrameData>(bytes);
  REQUIRE(decoded);
  CHECK(decoded->data.data() == bytes.data() + min_encoded_size<FrameData>());
  CHECK(decoded->data.size() == pixels.size());
}

TEST_CASE("Tail bytes produced in place are framed without a copy and give the same frame") {
  std::mt19937 random(5);
  const Bytes pixels = random_bytes(random, 2000);
  const FrameData elsewhere{.run_id = 1, .frame_id = 2, .offset = 3, .total = 4, .data = pixels};
  const Bytes expected = make_frame(elsewhere, 6);
  // At its own place, and at places from which the bytes must move over themselves.
  for (const std::size_t place : {kHeaderBytes + min_encoded_size<FrameData>(), std::size_t{0},
                                  std::size_t{30}, std::size_t{45}, std::size_t{1000}}) {
    Bytes out(kMaxFrameBytes);
    std::copy(pixels.begin(), pixels.end(), out.begin() + static_cast<std::ptrdiff_t>(place));
    FrameData message = elsewhere;
    message.data = std::span(out).subspan(place, pixels.size());
    out.resize(write_message(out, header_for<FrameData>(0x1234, 6, 7), message));
    REQUIRE(out == expected);
  }
}

// PROVES: SPEC 4.9
TEST_CASE("The stated bounds hold: no message is shorter than its minimum or longer than its maximum") {
  for_each_message([]<typename M>() {
    CHECK(encoded_size(M{}) == min_encoded_size<M>());
    CHECK(max_encoded_size<M>() >= min_encoded_size<M>());
    CHECK(max_encoded_size<M>() <= kMaxSerialPayload);
  });
  CalibrationListed full;
  full.manifests.resize(8);
  for (auto& manifest : full.manifests) {
    manifest.certificate_id.resize(48);
    manifest.scalars.resize(6);
  }
  CHECK(encoded_size(full) == max_encoded_size<CalibrationListed>());
}

TEST_CASE("Messages can be encoded and decoded while compiling") {
  constexpr auto kRoundTrip = [] {
    std::array<std::byte, 16> bytes{};
    const auto size = encode(Credit{.run_id = 7, .may_send_until = 0x01020304}, bytes);
    const auto decoded = decode<Credit>(std::span<const std::byte>(bytes).first(*size));
    return decoded->run_id == 7 && decoded->may_send_until == 0x01020304 && bytes[4] == std::byte{4};
  };
  STATIC_REQUIRE(kRoundTrip());
}

// PROVES: SPEC 4.6
TEST_CASE("No two messages share an id or a name") {
  std::vector<std::uint16_t> ids;
  std::vector<std::string_view> names;
  for_each_message([&]<typename M>() {
    ids.push_back(static_cast<std::uint16_t>(M::kId));
    names.push_back(M::kName);
  });
  std::ranges::sort(ids);
  std::ranges::sort(names);
  CHECK(std::ranges::adjacent_find(ids) == ids.end());
  CHECK(std::ranges::adjacent_find(names) == names.end());
}

}  // namespace
}  // namespace scatter::protocol::test
