#include "host_sdk/formats/decimal.h"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <system_error>

namespace scatter::formats {
namespace {

/// Powers of ten that a double holds exactly.
constexpr std::array<double, 23> kPowers{1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                         1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                         1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
constexpr int kLargestPower = 22;
constexpr std::uint64_t kExactInteger = std::uint64_t{1} << 53;
/// Digits that a 64-bit integer holds whatever they are.
constexpr int kMostDigits = 19;
/// Exponents beyond this decide nothing any more; keeps sums of ints small.
constexpr int kHugeExponent = 100'000'000;

bool is_digit(char c) noexcept {
  return static_cast<unsigned char>(c - '0') < 10;
}

/// Everything that the fast path cannot round. The text is known to be a number;
/// magnitude: |value| < 10^magnitude, or 0.
float rounded_slowly(const char* start, const char* stop, int magnitude) noexcept {
  float value = 0;
  const auto result = std::from_chars(start, stop, value);
  if (result.ec == std::errc{}) {
    return value;
  }
  // Out of range: from_chars leaves the value alone and does not say on which side.
  const float limit = magnitude > 0 ? std::numeric_limits<float>::infinity() : 0.0F;
  return *start == '-' ? -limit : limit;
}

}  // namespace

const char* parse_decimal(const char* at, const char* end, float& value) noexcept {
  const bool negative = at != end && *at == '-';
  if (negative || (at != end && *at == '+')) {
    ++at;
  }
  const char* const digits = at;
  std::uint64_t mantissa = 0;
  int used = 0;      // Digits in the mantissa, from the first that is not 0.
  int exponent = 0;  // Value = mantissa * 10^exponent, digits beyond the 19th left out.
  bool any = false;
  bool cut = false;
  const auto take = [&](int shift) {
    const auto digit = static_cast<std::uint64_t>(*at - '0');
    any = true;
    if (used < kMostDigits) {
      mantissa = mantissa * 10 + digit;
      used += mantissa != 0 ? 1 : 0;
      exponent -= shift;
    } else {
      cut = cut || digit != 0;
      exponent += 1 - shift;
    }
  };
  while (at != end && is_digit(*at)) {
    take(0);
    ++at;
  }
  if (at != end && *at == '.') {
    ++at;
    while (at != end && is_digit(*at)) {
      take(1);
      ++at;
    }
  }
  if (!any) {
    return nullptr;
  }
  if (at != end && (*at == 'e' || *at == 'E')) {
    const char* power = at + 1;
    const bool down = power != end && *power == '-';
    if (power != end && (*power == '-' || *power == '+')) {
      ++power;
    }
    if (power != end && is_digit(*power)) {
      int written = 0;
      for (; power != end && is_digit(*power); ++power) {
        written = written < kHugeExponent ? written * 10 + (*power - '0') : written;
      }
      exponent += down ? -written : written;
      at = power;
    }
  }
  if (mantissa == 0) {
    value = negative ? -0.0F : 0.0F;
    return at;
  }
  if (!cut && mantissa <= kExactInteger && exponent >= -kLargestPower && exponent <= kLargestPower) {
    // Both operands are exact, so the double is the text correctly rounded (Clinger 1990). Rounding
    // it again is right unless it lies exactly between two floats, where the text itself decides.
    // 1e-22 to 1e38: neither below the normal floats nor above the largest.
    const double power = kPowers[static_cast<std::size_t>(exponent < 0 ? -exponent : exponent)];
    const double exact = static_cast<double>(mantissa);
    const double product = exponent < 0 ? exact / power : exact * power;
    constexpr std::uint64_t kLost = (std::uint64_t{1} << 29) - 1;
    constexpr std::uint64_t kHalf = std::uint64_t{1} << 28;
    if ((std::bit_cast<std::uint64_t>(product) & kLost) != kHalf) {
      value = static_cast<float>(negative ? -product : product);
      return at;
    }
  }
  const int magnitude = exponent + used;
  if (magnitude > 39 || magnitude < -45) {
    const float limit = magnitude > 0 ? std::numeric_limits<float>::infinity() : 0.0F;
    value = negative ? -limit : limit;
    return at;
  }
  value = rounded_slowly(negative ? digits - 1 : digits, at, magnitude);
  return at;
}

}  // namespace scatter::formats
