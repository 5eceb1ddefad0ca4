#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "simulator/random/bulk.h"
#include "simulator/random/noise.h"
#include "simulator/random/philox.h"
#include "simulator/random/stream.h"

namespace {

using namespace scatter::simulator;

struct Drawn {
  std::vector<float> electrons;
  std::vector<float> normal;
};

Drawn draw(const RandomKey& key, float mean, std::size_t count) {
  const std::vector<float> means(count, mean);
  Drawn d{std::vector<float>(count), std::vector<float>(count)};
  draw_shot_and_read_noise(key, 0, means, d.electrons, d.normal);
  return d;
}

double log_pmf(double mean, long k) {
  return -mean + static_cast<double>(k) * std::log(mean) - std::lgamma(static_cast<double>(k) + 1.0);
}

double normal_cdf(double x) {
  return 0.5 * std::erfc(-x / std::sqrt(2.0));
}

/// Chi-square of counts against expected shares; bins with fewer than 20 expected are pooled.
struct ChiSquare {
  double value = 0;
  double degrees = -1;
  double pooled_count = 0;
  double pooled_expected = 0;
  void bin(double count, double expected) {
    if (expected < 20) {
      pooled_count += count;
      pooled_expected += expected;
      return;
    }
    value += (count - expected) * (count - expected) / expected;
    degrees += 1;
  }
  /// True within five standard deviations of a chi-square with these degrees of freedom.
  bool good() {
    if (pooled_expected >= 5) {
      value += (pooled_count - pooled_expected) * (pooled_count - pooled_expected) / pooled_expected;
      degrees += 1;
    }
    CAPTURE(value, degrees);
    return std::abs(value - degrees) < 5 * std::sqrt(2 * degrees);
  }
};

}  // namespace

// PROVES: Random123's published known answers (kat_vectors, philox4x32 with 10 rounds).
TEST_CASE("Words drawn in bulk are those of the blocks, one by one") {
  const RandomKey key{0x123456789ABCDEFU, Purpose::kCorrosion, 0xFEDCBA9876543210U};
  BulkWords words;
  for (const std::uint32_t chunk : {0U, 1U, 77777U, 0x3FFFFFFU}) {
    draw_bulk(key, chunk, words);
    for (std::uint32_t b = 0; b < kBulkBlocks; ++b) {
      const auto block = key.block(64 * chunk + b);
      for (std::size_t w = 0; w < 4; ++w) {
        REQUIRE(words[64 * w + b] == block[w]);
      }
    }
  }
}

TEST_CASE("Philox gives the published known answers") {
  using Words = std::array<std::uint32_t, 4>;
  CHECK(philox4x32({0, 0, 0, 0}, {0, 0}) == Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
  const std::uint32_t f = 0xffffffff;
  CHECK(philox4x32({f, f, f, f}, {f, f}) == Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
  CHECK(philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}) ==
        Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
}

TEST_CASE("Bulk noise equals the double-precision formulas applied to Philox words") {
  const RandomKey key{77, Purpose::kFrameNoise, (std::uint64_t{5} << 32U) | 9};
  const std::size_t count = 20000;
  const float mean = 900;
  const Drawn d = draw(key, mean, count);
  std::size_t unequal = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto words = key.block(static_cast<std::uint32_t>(i));
    const double u = ((words[0] >> 1U) + 1.0) / 2147483648.0;
    const double radius = std::sqrt(-2 * std::log(u));
    const double angle = 2 * 3.14159265358979324 * words[1] / 4294967296.0;
    REQUIRE(d.normal[i] == Approx(radius * std::sin(angle)).margin(4e-6));
    const double q = poisson_quantile(double{mean}, std::sqrt(double{mean}), radius * std::cos(angle));
    unequal += std::floor(q) != d.electrons[i] ? 1 : 0;
    REQUIRE(std::abs(q - 0.5 - d.electrons[i]) < 0.501);
  }
  // Only where the quantile lies within float rounding of a whole number.
  CHECK(unequal < count / 1000);
}

TEST_CASE("Noise of a pixel does not depend on how a frame is cut up") {
  const RandomKey key{3, Purpose::kFrameNoise, 12};
  std::vector<float> mean(1000);
  for (std::size_t i = 0; i < mean.size(); ++i) {
    mean[i] = static_cast<float>(i % 25);
  }
  std::vector<float> whole(mean.size());
  std::vector<float> whole_normal(mean.size());
  draw_shot_and_read_noise(key, 0, mean, whole, whole_normal);
  for (const std::size_t piece : {1U, 7U, 64U, 333U}) {
    std::vector<float> part(mean.size());
    std::vector<float> part_normal(mean.size());
    for (std::size_t at = 0; at < mean.size(); at += piece) {
      const std::size_t n = std::min<std::size_t>(piece, mean.size() - at);
      draw_shot_and_read_noise(key, static_cast<std::uint32_t>(at), std::span(mean).subspan(at, n),
                               std::span(part).subspan(at, n), std::span(part_normal).subspan(at, n));
    }
    CHECK(part == whole);
    CHECK(part_normal == whole_normal);
  }
}

// PROVES: noise.h, error bound of poisson_quantile, without drawing anything.
TEST_CASE("Poisson quantile follows the Poisson distribution within 5e-5 for means 10 to 20000") {
  for (const double mean : {10.001, 11.3, 15.0, 27.5, 80.0, 333.3, 2500.0, 10000.0, 20000.0}) {
    const double width = 7 * std::sqrt(mean);
    const long first = std::max(0L, std::lround(mean - width));
    double cumulative = 0;
    for (long k = 0; k < first; ++k) {
      cumulative += std::exp(log_pmf(mean, k));
    }
    double worst = 0;
    for (long k = first; k < std::lround(mean + width); ++k) {
      cumulative += std::exp(log_pmf(mean, k));
      double low = -8;
      double high = 8;
      for (int step = 0; step < 60; ++step) {
        const double w = (low + high) / 2;
        (poisson_quantile(mean, std::sqrt(mean), w) < static_cast<double>(k + 1) ? low : high) = w;
      }
      worst = std::max(worst, std::abs(normal_cdf(low) - cumulative));
    }
    CAPTURE(mean);
    CHECK(worst < 5e-5);
  }
}

TEST_CASE("Bulk Poisson numbers pass the chi-square test from empty to full pixels") {
  const std::size_t count = 1'000'000;
  for (const float mean : {0.02F, 0.125F, 1.0F, 3.7F, 9.99F, 10.01F, 40.0F, 1000.0F, 9000.0F}) {
    const Drawn d = draw({11, Purpose::kFrameNoise, static_cast<std::uint64_t>(mean * 1000)}, mean, count);
    const auto last = static_cast<std::size_t>(mean + 8 * std::sqrt(mean) + 10);
    std::vector<double> histogram(last + 1, 0.0);
    for (const float e : d.electrons) {
      REQUIRE(e >= 0);
      histogram[std::min<std::size_t>(static_cast<std::size_t>(e), last)] += 1;
    }
    ChiSquare test;
    for (std::size_t k = 0; k <= last; ++k) {
      test.bin(histogram[k],
               static_cast<double>(count) * std::exp(log_pmf(double{mean}, static_cast<long>(k))));
    }
    CAPTURE(mean);
    CHECK(test.good());
  }
}

TEST_CASE("Read noise is standard normal and independent of the shot noise") {
  const std::size_t count = 1'000'000;
  for (const float mean : {2.0F, 500.0F}) {
    const Drawn d = draw({12, Purpose::kFrameNoise, 1}, mean, count);
    constexpr int kBins = 120;
    std::vector<double> histogram(kBins, 0.0);
    double product = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double share = normal_cdf(d.normal[i]) * kBins;
      histogram[std::min<std::size_t>(static_cast<std::size_t>(share), kBins - 1)] += 1;
      product += double{d.normal[i]} * (double{d.electrons[i]} - double{mean}) / std::sqrt(double{mean});
    }
    ChiSquare test;
    for (const double bin : histogram) {
      test.bin(bin, static_cast<double>(count) / kBins);
    }
    CHECK(test.good());
    // The mean product of independent unit variables scatters by 1 / sqrt(count).
    CHECK(std::abs(product / static_cast<double>(count)) < 5 / std::sqrt(static_cast<double>(count)));
  }
}

TEST_CASE("Noise takes nonsense means for zero and caps huge ones") {
  const std::vector<float> mean{-5.0F, std::nanf(""), 0.0F, 3e9F};
  std::vector<float> electrons(4);
  std::vector<float> normal(4);
  draw_shot_and_read_noise({1}, 0, mean, electrons, normal);
  CHECK(electrons[0] == 0);
  CHECK(electrons[1] == 0);
  CHECK(electrons[2] == 0);
  CHECK(electrons[3] == Approx(1e6).epsilon(0.01));
}

TEST_CASE("A stream's uniform, bounded, normal and Poisson numbers have their moments") {
  RandomStream stream({5, Purpose::kDrift, 1});
  const int count = 200000;
  double uniform = 0;
  double square = 0;
  double normal = 0;
  double normal_square = 0;
  double poisson = 0;
  std::array<double, 7> faces{};
  for (int i = 0; i < count; ++i) {
    const double u = stream.uniform();
    REQUIRE((u >= 0 && u < 1));
    uniform += u;
    square += u * u;
    const double n = stream.normal();
    normal += n;
    normal_square += n * n;
    poisson += stream.poisson(4.5);
    faces[stream.below(7)] += 1;
  }
  // Five standard errors each.
  CHECK(uniform / count == Approx(0.5).margin(5 * 0.2887 / std::sqrt(count)));
  CHECK(square / count == Approx(1.0 / 3).margin(5 * 0.298 / std::sqrt(count)));
  CHECK(normal / count == Approx(0.0).margin(5 / std::sqrt(count)));
  CHECK(normal_square / count == Approx(1.0).margin(5 * std::sqrt(2.0 / count)));
  CHECK(poisson / count == Approx(4.5).margin(5 * std::sqrt(4.5 / count)));
  for (const double face : faces) {
    CHECK(face == Approx(count / 7.0).margin(5 * std::sqrt(count / 7.0)));
  }
}

TEST_CASE("Streams of other seeds, purposes and indices share no numbers") {
  const RandomKey base{1, Purpose::kDrift, 2};
  for (const RandomKey& other :
       {RandomKey{2, Purpose::kDrift, 2}, RandomKey{1, Purpose::kFaults, 2}, RandomKey{1, Purpose::kDrift, 3},
        RandomKey{1ULL << 33U, Purpose::kDrift, 2}, RandomKey{1, Purpose::kDrift, 2 | (1ULL << 40U)}}) {
    CHECK(base.block(0) != other.block(0));
  }
}
