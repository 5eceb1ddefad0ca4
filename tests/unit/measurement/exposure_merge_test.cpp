// PROVES: instrument.md section 4, steps 1, 3 and 5.
#include "host_sdk/measurement/exposure_merge.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

using namespace scatter;
using namespace scatter::measurement;

namespace {

protocol::SensorInfo hs1() {
  protocol::SensorInfo s;
  s.width_px = 64;
  s.height_px = 64;
  s.bits = 10;
  s.gain_e_per_dn = 10;
  s.full_well_e = 10000;
  s.read_noise_e = 25;
  s.black_level_dn = 16;
  s.dark_current_e_per_s = 50;
  s.dark_doubling_K = 7;
  s.reference_temperature_mK = 298150;
  s.linearity = -0.01F;
  return s;
}

DarkModel level_dark(std::size_t pixels, float rate = 0) {
  return {std::vector<float>(pixels, 16.0F), std::vector<float>(pixels, rate), 0, 0, 298150};
}

/// Counts of a mean of `e` electrons by the sensor's formula (descriptor.h), without noise.
double counts(const protocol::SensorInfo& s, double e) {
  const auto well = static_cast<double>(s.full_well_e);
  const double clipped = std::min(e, well);
  return static_cast<double>(s.black_level_dn) + clipped *
                                                     (1 + static_cast<double>(s.linearity) * clipped / well) /
                                                     static_cast<double>(s.gain_e_per_dn);
}

std::vector<std::uint16_t> noise_free(const protocol::SensorInfo& s, std::size_t pixels, double e) {
  return std::vector<std::uint16_t>(pixels,
                                    static_cast<std::uint16_t>(std::lround(std::min(counts(s, e), 1023.0))));
}

}  // namespace

TEST_CASE("Two exposures of a steady light give its rate to the quantisation of the counts") {
  const protocol::SensorInfo s = hs1();
  constexpr std::size_t kPixels = 100;
  constexpr double kRate = 400'000;  // e-/s per volt
  const auto brief = noise_free(s, kPixels, kRate * 0.5 * 0.005);
  const auto longer = noise_free(s, kPixels, kRate * 0.5 * 0.04);
  const std::vector<Exposure> frames{{brief, 0.005, 0.5, 298150}, {longer, 0.04, 0.5, 298150}};
  std::vector<float> rate(kPixels), variance(kPixels), weight(kPixels);
  merge_exposures(frames, level_dark(kPixels), s, 0, {rate, variance, weight});
  // Half a count of the long exposure: 5 e- of 8000.
  CHECK(static_cast<double>(rate[50]) == Approx(kRate).epsilon(5.0 / 8000));
  // Shot noise of 9000 e- and read noise twice: the variance of the best linear combination.
  CHECK(std::sqrt(static_cast<double>(variance[50])) / kRate ==
        Approx(std::sqrt(9000.0 + 700) / 9000).epsilon(0.15));
}

TEST_CASE("A pixel saturated in every exposure has no value and says so") {
  const protocol::SensorInfo s = hs1();
  const auto full = noise_free(s, 64, 20000);
  const std::vector<Exposure> frames{{full, 0.001, 1, 298150}, {full, 0.01, 1, 298150}};
  std::vector<float> rate(64), variance(64), weight(64);
  merge_exposures(frames, level_dark(64), s, 0, {rate, variance, weight});
  CHECK(rate[10] == 0.0F);
  CHECK(std::isinf(variance[10]));
}

TEST_CASE("Saturated exposures do not touch the value of the unsaturated one") {
  const protocol::SensorInfo s = hs1();
  const auto good = noise_free(s, 64, 5000);
  const auto full = noise_free(s, 64, 40000);
  std::vector<float> alone(64), both(64), variance(64), weight(64);
  const std::vector<Exposure> one{{good, 0.001, 1, 298150}};
  const std::vector<Exposure> two{{good, 0.001, 1, 298150}, {full, 0.008, 1, 298150}};
  merge_exposures(one, level_dark(64), s, 0, {alone, variance, weight});
  merge_exposures(two, level_dark(64), s, 0, {both, variance, weight});
  CHECK(both == alone);
}

TEST_CASE("The choice of exposures does not bias the mean of pixels at the edge of saturation") {
  // A pixel that judged by its own noisy short exposure would keep the ones that came out high.
  const protocol::SensorInfo s = hs1();
  constexpr std::size_t kPixels = 40'000;
  const double edge_e = 0.9 * 9900;  // The long exposure sits where it is just still used.
  constexpr double kRatio = 8;
  std::mt19937 engine(7);
  std::normal_distribution<double> read(0, 25);
  const auto noisy = [&](double mean) {
    std::poisson_distribution<int> shot(mean);
    std::vector<std::uint16_t> dn(kPixels);
    for (auto& d : dn) {
      const double c = counts(s, shot(engine)) + read(engine) / 10;
      d = static_cast<std::uint16_t>(std::clamp(std::lround(c), 0L, 1023L));
    }
    return dn;
  };
  const auto brief = noisy(edge_e / kRatio);
  const auto longer = noisy(edge_e);
  const std::vector<Exposure> frames{{brief, 0.001, 1, 298150}, {longer, 0.008, 1, 298150}};
  std::vector<float> rate(kPixels), variance(kPixels), weight(kPixels);
  merge_exposures(frames, level_dark(kPixels), s, 0, {rate, variance, weight});
  double sum = 0;
  double sum_variance = 0;
  for (std::size_t p = 0; p < kPixels; ++p) {
    sum += static_cast<double>(rate[p]);
    sum_variance += static_cast<double>(variance[p]);
  }
  const double mean = sum / kPixels;
  const double standard_error = std::sqrt(sum_variance) / kPixels;
  CHECK(std::abs(mean - edge_e / 0.008) < 4 * standard_error);
}

TEST_CASE("Dark current and its growth with temperature are taken off") {
  const protocol::SensorInfo s = hs1();
  constexpr std::size_t kPixels = 32;
  // 7 K warmer than the dark model: 1000 e-/s have become 2000.
  const double t = 0.1;
  const auto frame = noise_free(s, kPixels, (30'000 + 2000) * t);
  std::vector<float> rate(kPixels), variance(kPixels), weight(kPixels);
  const std::vector<Exposure> frames{{frame, t, 1, 298150 + 7000}};
  merge_exposures(frames, level_dark(kPixels, 1000), s, 0, {rate, variance, weight});
  CHECK(static_cast<double>(rate[5]) == Approx(30'000).epsilon(5.0 / 3200));
}
