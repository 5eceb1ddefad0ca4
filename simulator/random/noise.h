// The noise of a whole row of pixels at once.
#pragma once

#include <cstdint>
#include <span>

#include "simulator/random/philox.h"

namespace scatter::simulator {

/// Means above this are drawn by the quantile expansion, smaller ones by inversion.
inline constexpr float kPoissonInversionLimit = 10.0F;

/// Floor of this is a Poisson variate of mean `mean` when w is standard normal.
///
/// Quantity  Q with P(Poisson(mean) >= Q) = P(N(0, 1) >= w), for real-valued Q.
/// Range     mean >= kPoissonInversionLimit, |w| <= 7.
/// Error     the cumulative probability that follows from it is within 5e-5 of Poisson's
///           everywhere (tested for means 10..20,000).
/// Source    Cornish-Fisher expansion of the gamma distribution, as in Giles 2016, "Algorithm 955:
///           approximation of the inverse Poisson cumulative distribution function", section 2.2.
template <typename T>
[[nodiscard]] constexpr T poisson_quantile(T mean, T root_of_mean, T w) noexcept {
  const T w2 = w * w;
  const T inverse_root = T(1) / root_of_mean;
  const T c1 = w * (T(-1.0 / 36.0) - w2 * T(1.0 / 72.0));
  const T c2 = T(-8.0 / 405.0) + w2 * (T(7.0 / 810.0) + w2 * T(1.0 / 270.0));
  return mean + root_of_mean * w + (T(1.0 / 3.0) + w2 * T(1.0 / 6.0)) +
         inverse_root * (c1 + inverse_root * c2);
}

/// Shot and read noise: block `first + i` of the key makes pixel i's two numbers.
///
/// Shape     all spans of one size; electrons may be mean's own memory.
/// Range     0 <= mean <= 1e6 (larger means are taken as 1e6, negative ones as 0).
/// Output    electrons: whole numbers, Poisson; normal: standard normal, |normal| <= 6.6.
/// Error     means up to kPoissonInversionLimit: cumulative probability within 1e-6; above: see
///           poisson_quantile. Same numbers on every processor.
/// Cost      about 10 ns per pixel (AVX2); no allocation; any number of threads.
void draw_shot_and_read_noise(const RandomKey& key, std::uint32_t first, std::span<const float> mean,
                              std::span<float> electrons, std::span<float> normal) noexcept;

}  // namespace scatter::simulator
