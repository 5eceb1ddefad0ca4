#include "protocol/crc.h"

#include <utility>

#include "protocol/endian.h"

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_acle.h>
#if defined(__linux__)
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif
#endif

namespace scatter::protocol {
namespace {

constexpr std::uint32_t kPolynomial = 0x82F63B78U;  // Reflected.

// Polynomials modulo P in reflected form: bit 31 is x^0.
constexpr std::uint32_t kOne = 0x80000000U;
constexpr std::uint32_t kX8 = 0x00800000U;

constexpr std::uint32_t times_x(std::uint32_t value) noexcept {
  return (value >> 1U) ^ ((value & 1U) != 0 ? kPolynomial : 0U);
}

// Cortex-M has little RAM and flash for tables: one of 1 KiB there, eight elsewhere.
#if defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'
constexpr std::size_t kSlices = 1;
#else
constexpr std::size_t kSlices = 8;
#endif

using Tables = std::array<std::array<std::uint32_t, 256>, kSlices>;

constexpr Tables make_tables() noexcept {
  Tables tables{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) {
      crc = times_x(crc);
    }
    tables[0][i] = crc;
  }
  for (std::size_t slice = 1; slice < kSlices; ++slice) {
    for (std::size_t i = 0; i < 256; ++i) {
      const std::uint32_t before = tables[slice - 1][i];
      tables[slice][i] = (before >> 8U) ^ tables[0][before & 0xFFU];
    }
  }
  return tables;
}

constexpr Tables kTables = make_tables();

constexpr std::uint32_t product(std::uint32_t a, std::uint32_t b) noexcept {
  std::uint32_t sum = 0;
  for (; b != 0; b <<= 1U) {
    sum ^= (b & kOne) != 0 ? a : 0U;
    a = times_x(a);
  }
  return sum;
}

}  // namespace

Crc32cConcat::Crc32cConcat(std::size_t second_bytes) noexcept : second_bytes_(second_bytes) {
  std::uint32_t power = kX8;
  for (; second_bytes != 0; second_bytes >>= 1U) {
    if ((second_bytes & 1U) != 0) {
      factor_ = product(power, factor_);
    }
    power = product(power, power);
  }
}

std::uint32_t Crc32cConcat::operator()(std::uint32_t first, std::uint32_t second) const noexcept {
  return product(factor_, first) ^ second;
}

std::uint32_t TailCrc::append(std::uint32_t crc, std::span<const std::byte> payload,
                              std::uint32_t payload_crc, std::size_t tail_bytes) noexcept {
  auto& [concat, before] = concats_;
  if (concat.second_bytes() != tail_bytes) {
    std::swap(concat, before);
  }
  if (concat.second_bytes() != tail_bytes) {
    concat = Crc32cConcat(tail_bytes);
  }
  const std::uint32_t head = crc32c(payload.first(payload.size() - tail_bytes));
  return concat(crc, concat(head, payload_crc));
}

std::uint32_t crc32c_table(std::span<const std::byte> bytes, std::uint32_t seed) noexcept {
  std::uint32_t crc = ~seed;
  const std::byte* at = bytes.data();
  std::size_t left = bytes.size();
  if constexpr (kSlices == 8) {
    while (left >= 8) {
      const std::uint32_t low = load_le<std::uint32_t>(at) ^ crc;
      const auto high = load_le<std::uint32_t>(at + 4);
      crc = kTables[7][low & 0xFFU] ^ kTables[6][(low >> 8U) & 0xFFU] ^ kTables[5][(low >> 16U) & 0xFFU] ^
            kTables[4][low >> 24U] ^ kTables[3][high & 0xFFU] ^ kTables[2][(high >> 8U) & 0xFFU] ^
            kTables[1][(high >> 16U) & 0xFFU] ^ kTables[0][high >> 24U];
      at += 8;
      left -= 8;
    }
  }
  for (; left > 0; --left, ++at) {
    crc = (crc >> 8U) ^ kTables[0][(crc ^ static_cast<std::uint32_t>(*at)) & 0xFFU];
  }
  return ~crc;
}

#if defined(__x86_64__)

namespace {

constexpr std::uint32_t x_to_the(std::size_t power) noexcept {
  std::uint32_t value = kOne;
  for (std::size_t i = 0; i < power; ++i) {
    value = times_x(value);
  }
  return value;
}

/// Factor that moves a CRC over `bytes` zero bytes: a carry-less product of two reflected 32-bit
/// numbers is one bit short, and the closing crc32 of 64 bits multiplies by x^32; hence 33.
constexpr std::uint32_t shift_factor(std::size_t bytes) noexcept {
  return x_to_the(8 * bytes - 33);
}

__attribute__((target("sse4.2,pclmul"))) inline std::uint64_t shift(std::uint64_t crc,
                                                                    std::uint32_t factor) noexcept {
  const __m128i product = _mm_clmulepi64_si128(_mm_cvtsi64_si128(static_cast<long long>(crc)),
                                               _mm_cvtsi32_si128(static_cast<int>(factor)), 0x00);
  return _mm_crc32_u64(0, static_cast<std::uint64_t>(_mm_cvtsi128_si64(product)));
}

/// Three neighbouring lanes of `Lane` bytes at once: the instruction takes 3 cycles but one can start
/// in each cycle, so three chains keep it busy.
template <std::size_t Lane>
__attribute__((target("sse4.2,pclmul"))) inline std::uint64_t three_lanes(const std::byte*& at,
                                                                          std::size_t& left,
                                                                          std::uint64_t crc) noexcept {
  constexpr std::uint32_t kByTwo = shift_factor(2 * Lane);
  constexpr std::uint32_t kByOne = shift_factor(Lane);
  while (left >= 3 * Lane) {
    std::uint64_t second = 0;
    std::uint64_t third = 0;
    for (std::size_t i = 0; i < Lane; i += 8) {
      crc = _mm_crc32_u64(crc, load_le<std::uint64_t>(at + i));
      second = _mm_crc32_u64(second, load_le<std::uint64_t>(at + Lane + i));
      third = _mm_crc32_u64(third, load_le<std::uint64_t>(at + 2 * Lane + i));
    }
    crc = shift(crc, kByTwo) ^ shift(second, kByOne) ^ third;
    at += 3 * Lane;
    left -= 3 * Lane;
  }
  return crc;
}

}  // namespace

bool crc32c_have_hardware() noexcept {
  return __builtin_cpu_supports("sse4.2") != 0 && __builtin_cpu_supports("pclmul") != 0;
}

__attribute__((target("sse4.2,pclmul"))) static std::uint32_t by_instruction(std::span<const std::byte> bytes,
                                                                             std::uint32_t seed) noexcept {
  std::uint64_t crc = static_cast<std::uint32_t>(~seed);
  const std::byte* at = bytes.data();
  std::size_t left = bytes.size();
  crc = three_lanes<2048>(at, left, crc);
  crc = three_lanes<256>(at, left, crc);
  for (; left >= 8; left -= 8, at += 8) {
    crc = _mm_crc32_u64(crc, load_le<std::uint64_t>(at));
  }
  auto narrow = static_cast<std::uint32_t>(crc);
  for (; left > 0; --left, ++at) {
    narrow = _mm_crc32_u8(narrow, static_cast<std::uint8_t>(*at));
  }
  return ~narrow;
}

std::uint32_t crc32c_hardware(std::span<const std::byte> bytes, std::uint32_t seed) noexcept {
  return crc32c_have_hardware() ? by_instruction(bytes, seed) : crc32c_table(bytes, seed);
}

#elif defined(__aarch64__) && (defined(__ARM_FEATURE_CRC32) || defined(__linux__))

bool crc32c_have_hardware() noexcept {
#if defined(__ARM_FEATURE_CRC32)
  return true;
#else
  return (getauxval(AT_HWCAP) & HWCAP_CRC32) != 0;
#endif
}

__attribute__((target("+crc"))) static std::uint32_t by_instruction(std::span<const std::byte> bytes,
                                                                    std::uint32_t seed) noexcept {
  std::uint32_t crc = ~seed;
  const std::byte* at = bytes.data();
  std::size_t left = bytes.size();
  for (; left >= 8; left -= 8, at += 8) {
    crc = __crc32cd(crc, load_le<std::uint64_t>(at));
  }
  for (; left > 0; --left, ++at) {
    crc = __crc32cb(crc, static_cast<std::uint8_t>(*at));
  }
  return ~crc;
}

std::uint32_t crc32c_hardware(std::span<const std::byte> bytes, std::uint32_t seed) noexcept {
  return crc32c_have_hardware() ? by_instruction(bytes, seed) : crc32c_table(bytes, seed);
}

#else

bool crc32c_have_hardware() noexcept {
  return false;
}

std::uint32_t crc32c_hardware(std::span<const std::byte> bytes, std::uint32_t seed) noexcept {
  return crc32c_table(bytes, seed);
}

#endif

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t seed) noexcept {
  return crc32c_hardware(bytes, seed);
}

}  // namespace scatter::protocol
