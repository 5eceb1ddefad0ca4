#include "host_sdk/formats/decimal.h"

#include <bit>
#include <catch2/catch.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include <fmt/format.h>

using scatter::formats::parse_decimal;

namespace {

/// The float that the standard library reads; what is out of range goes to the nearest end.
float expected_of(const std::string& text) {
  float value = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec == std::errc{}) {
    return value;
  }
  double wide = 0;
  const auto again = std::from_chars(text.data(), text.data() + text.size(), wide);
  if (again.ec == std::errc{}) {
    return static_cast<float>(wide);
  }
  const bool up = text.find("e-") == std::string::npos && text.find("E-") == std::string::npos;
  const float limit = up ? HUGE_VALF : 0.0F;
  return text[0] == '-' ? -limit : limit;
}

void require_same(const std::string& text) {
  float value = 7;
  const char* const end = text.data() + text.size();
  const char* const stop = parse_decimal(text.data(), end, value);
  if (stop != end || std::bit_cast<std::uint32_t>(value) != std::bit_cast<std::uint32_t>(expected_of(text))) {
    CAPTURE(text, value, expected_of(text));
    FAIL("differs from std::from_chars");
  }
}

}  // namespace

TEST_CASE("Random decimals round as the standard library rounds them, bit by bit") {
  std::mt19937_64 random(1);
  for (int k = 0; k < 300'000; ++k) {
    const auto bits = static_cast<std::uint32_t>(random());
    const float f = std::bit_cast<float>(bits);
    require_same(fmt::format("{:.3E}", std::exp(static_cast<double>(random() % 20000) / 100 - 100)));
    if (std::isfinite(f)) {
      require_same(fmt::format("{:.{}e}", f, random() % 12));
    }
    const std::uint64_t wide = random() >> (random() % 64);
    require_same(fmt::format("{}.{}", wide, random() >> (random() % 64)));
    require_same(fmt::format("-0.{:0{}}", wide, random() % 30));
    require_same(fmt::format("{}e{}", wide, static_cast<int>(random() % 80) - 50));
  }
}

TEST_CASE("Decimals half-way between two floats go to the even one, and a digit beyond decides") {
  std::mt19937_64 random(2);
  for (int k = 0; k < 200'000; ++k) {
    const float low = std::bit_cast<float>(static_cast<std::uint32_t>(random()) & 0x7fffffffU);
    const float high = std::nextafter(low, HUGE_VALF);
    if (!std::isfinite(high)) {
      continue;
    }
    const double middle = (static_cast<double>(low) + static_cast<double>(high)) / 2;
    require_same(fmt::format("{:.{}e}", middle, 14 + random() % 120));
    require_same(fmt::format("{:.150e}", middle) + "");
  }
  // 1 + 2^-24 is the middle of 1 and the next float; the digit far out breaks the tie.
  require_same("1.000000059604644775390625");
  require_same("1.0000000596046447753906250000000000000000001");
  require_same("1.0000000596046447753906249999999999999999999");
}

TEST_CASE("Decimals too small are zero and too large infinite, with their sign") {
  for (const char* text : {"1e-46", "-1e-46", "7.0e-46", "7.1e-46", "1e-400", "1e39", "-3.5e38",
                           "3.4028235e38", "3.4028236e38", "1e400", "0e999999999999", "0.0e-5", "-0",
                           "1e-99999999999", "00000000000000000000000000000000000000000000000000001e-30"}) {
    require_same(text);
  }
}

TEST_CASE("A decimal ends where it stops being one") {
  const auto length = [](const std::string& text) {
    float value = 0;
    const char* stop = parse_decimal(text.data(), text.data() + text.size(), value);
    return stop == nullptr ? -1 : static_cast<int>(stop - text.data());
  };
  REQUIRE(length("1.5E-02\t7") == 7);
  REQUIRE(length("+2") == 2);
  REQUIRE(length("3.") == 2);
  REQUIRE(length(".5x") == 2);
  REQUIRE(length("1e") == 1);
  REQUIRE(length("1e+") == 1);
  REQUIRE(length("1,5") == 1);
  for (const char* text : {"", "-", ".", "e5", "nan", "inf", "0x10x", "--1", "+-1"}) {
    CAPTURE(text);
    REQUIRE(length(text) == (std::string(text) == "0x10x" ? 1 : -1));
  }
}
