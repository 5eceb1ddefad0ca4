#include "simulator/random/noise.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>

#include "simulator/random/philox_lanes.h"
#include "simulator/random/stream.h"

// This file is compiled without contraction to fused multiply-add and without errno (CMakeLists.txt),
// so that the loops below vectorise and give the same bits for every instruction set.

namespace scatter::simulator {
namespace {

constexpr std::size_t kLanes = 64;
template <typename T>
using Lanes = std::array<T, kLanes>;

using Bits = std::array<Lanes<std::uint32_t>, 4>;

/// Natural logarithm of x in [2^-31, 1]; relative error below 3e-7, also near 1.
[[gnu::always_inline]] inline float log_unit(float x) noexcept {
  // Split at sqrt(1/2) so that the mantissa's logarithm is small near x = 1.
  const std::uint32_t shifted = std::bit_cast<std::uint32_t>(x) - 0x3F3504F3U;
  const auto exponent = static_cast<float>(static_cast<std::int32_t>(shifted) >> 23);
  const float m = std::bit_cast<float>((shifted & 0x007FFFFFU) + 0x3F3504F3U);
  const float s = (m - 1.0F) / (m + 1.0F);
  const float s2 = s * s;
  const float series = 2.0F + s2 * (2.0F / 3 + s2 * (2.0F / 5 + s2 * (2.0F / 7 + s2 * (2.0F / 9))));
  return exponent * 0.693147181F + s * series;
}

/// Two standard normals from two words.
/// Source  Box and Muller 1958.
[[gnu::always_inline]] inline void box_muller(std::uint32_t a, std::uint32_t b, float& first,
                                              float& second) noexcept {
  const float u = (static_cast<float>(static_cast<std::int32_t>(a >> 1U)) + 1.0F) * 0x1p-31F;
  const float radius = std::sqrt(-2.0F * log_unit(u));
  // The angle is quadrant * 90 deg + r * 90 deg with r in [-1/2, 1/2).
  const std::uint32_t quadrant = (b + 0x20000000U) >> 30U;
  const float r =
      static_cast<float>(static_cast<std::int32_t>(b - (quadrant << 30U))) * (0x1p-30F * 1.57079633F);
  const float r2 = r * r;
  const float sine =
      r * (1.0F + r2 * (-1.0F / 6 + r2 * (1.0F / 120 + r2 * (-1.0F / 5040 + r2 * (1.0F / 362880)))));
  const float cosine = 1.0F + r2 * (-0.5F + r2 * (1.0F / 24 + r2 * (-1.0F / 720 + r2 * (1.0F / 40320))));
  const bool swap = (quadrant & 1U) != 0;
  const float x = swap ? sine : cosine;
  const float y = swap ? cosine : sine;
  first = radius * (((quadrant + 1U) & 2U) != 0 ? -x : x);
  second = radius * ((quadrant & 2U) != 0 ? -y : y);
}

[[gnu::always_inline]] inline void draw_lanes(const RandomKey& key, std::uint32_t first,
                                              const Lanes<float>& wanted_mean, Lanes<float>& electrons,
                                              Lanes<float>& normal) noexcept {
  Bits bits;
  philox_lanes(key, first, bits);
  Lanes<float> mean;
  Lanes<float> w;
  for (std::size_t l = 0; l < kLanes; ++l) {
    const float positive = wanted_mean[l] > 0.0F ? wanted_mean[l] : 0.0F;
    mean[l] = positive < 1e6F ? positive : 1e6F;
    box_muller(bits[0][l], bits[1][l], w[l], normal[l]);
  }
  // Whole numbers, because their minimum and maximum vectorise.
  std::int32_t small_lanes = 0;
  std::int32_t largest_small = 0;
  for (std::size_t l = 0; l < kLanes; ++l) {
    const bool small = mean[l] <= kPoissonInversionLimit;
    const std::int32_t up = small ? static_cast<std::int32_t>(mean[l]) + 1 : 0;
    small_lanes += small ? 1 : 0;
    largest_small = up > largest_small ? up : largest_small;
  }
  for (std::size_t l = 0; l < kLanes; ++l) {
    const float q = poisson_quantile(mean[l], std::sqrt(mean[l] > 1.0F ? mean[l] : 1.0F), w[l]);
    electrons[l] = static_cast<float>(static_cast<std::int32_t>(q > 0.0F ? q : 0.0F));
  }
  if (small_lanes == 0) {
    return;
  }
  // Inversion: the variate is the number of k whose cumulative probability is below u.
  const int last = largest_small + static_cast<int>(6.0F * std::sqrt(static_cast<float>(largest_small))) + 4;
  Lanes<float> u;
  Lanes<float> term;
  Lanes<float> cumulative;
  Lanes<float> count{};
  for (std::size_t l = 0; l < kLanes; ++l) {
    u[l] = (static_cast<float>(static_cast<std::int32_t>(bits[2][l] >> 9U)) + 0.5F) * 0x1p-23F;
    mean[l] = mean[l] <= kPoissonInversionLimit ? mean[l] : 0.0F;
    // exp(-mean) as the 16th power of a short series: mean / 16 is at most 0.625.
    const float x = mean[l] * (-1.0F / 16);
    float e = 1.0F / 720 + x * (1.0F / 5040 + x * (1.0F / 40320 + x * (1.0F / 362880)));
    e = 1.0F + x * (1.0F + x * (0.5F + x * (1.0F / 6 + x * (1.0F / 24 + x * (1.0F / 120 + x * e)))));
    e = e * e;
    e = e * e;
    e = e * e;
    term[l] = e * e;
    cumulative[l] = term[l];
  }
  for (int k = 1; k <= last; ++k) {
    const float inverse = 1.0F / static_cast<float>(k);
    for (std::size_t l = 0; l < kLanes; ++l) {
      count[l] += u[l] > cumulative[l] ? 1.0F : 0.0F;
      term[l] *= mean[l] * inverse;
      cumulative[l] += term[l];
    }
  }
  for (std::size_t l = 0; l < kLanes; ++l) {
    electrons[l] = wanted_mean[l] <= kPoissonInversionLimit ? count[l] : electrons[l];
  }
}

[[gnu::always_inline]] inline void draw_all(const RandomKey& key, std::uint32_t first,
                                            std::span<const float> mean, std::span<float> electrons,
                                            std::span<float> normal) noexcept {
  for (std::size_t start = 0; start < mean.size(); start += kLanes) {
    const std::size_t count = std::min(kLanes, mean.size() - start);
    Lanes<float> lane_mean{};
    Lanes<float> lane_electrons;
    Lanes<float> lane_normal;
    std::copy_n(mean.begin() + static_cast<std::ptrdiff_t>(start), count, lane_mean.begin());
    draw_lanes(key, first + static_cast<std::uint32_t>(start), lane_mean, lane_electrons, lane_normal);
    std::copy_n(lane_electrons.begin(), count, electrons.begin() + static_cast<std::ptrdiff_t>(start));
    std::copy_n(lane_normal.begin(), count, normal.begin() + static_cast<std::ptrdiff_t>(start));
  }
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void draw_all_avx2(const RandomKey& key, std::uint32_t first,
                                           std::span<const float> mean, std::span<float> electrons,
                                           std::span<float> normal) noexcept {
  draw_all(key, first, mean, electrons, normal);
}
#endif

}  // namespace

void draw_shot_and_read_noise(const RandomKey& key, std::uint32_t first, std::span<const float> mean,
                              std::span<float> electrons, std::span<float> normal) noexcept {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) {
    draw_all_avx2(key, first, mean, electrons, normal);
    return;
  }
#endif
  draw_all(key, first, mean, electrons, normal);
}

double RandomStream::normal() noexcept {
  const double u = 1.0 - uniform();
  const double v = uniform();
  return std::sqrt(-2.0 * std::log(u)) * std::cos(6.283185307179586 * v);
}

std::uint32_t RandomStream::poisson(double mean) noexcept {
  // A block of its own, so that the bulk code does the work.
  const RandomKey key{key_.seed ^ 0x9E3779B97F4A7C15U, key_.purpose, (std::uint64_t{bits()} << 32U) | bits()};
  const auto m = static_cast<float>(mean);
  float electrons = 0;
  float normal = 0;
  draw_shot_and_read_noise(key, 0, {&m, 1}, {&electrons, 1}, {&normal, 1});
  return static_cast<std::uint32_t>(electrons);
}

}  // namespace scatter::simulator
