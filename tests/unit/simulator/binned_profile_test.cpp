// profile=binned: HS-1 whose pixels are summed in blocks of 4 x 4.
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "simulator/bench/bench.h"

using namespace scatter;
using namespace scatter::simulator;

namespace {

constexpr std::size_t kFull = 480;
constexpr std::size_t kSide = 4;
constexpr std::size_t kBinned = kFull / kSide;

std::unique_ptr<Bench> bench(Profile profile) {
  auto sample = Sample::make("lambertian:0.5");
  REQUIRE(sample.has_value());
  auto made = Bench::make({.profile = profile, .sample = *sample});
  REQUIRE(made.has_value());
  return std::move(*made);
}

std::vector<float> electrons(Bench& of, std::uint8_t illumination, std::size_t pixels) {
  std::vector<float> out(pixels);
  of.expected_electrons({.illumination = illumination, .exposure_us = 1000}, out);
  return out;
}

}  // namespace

TEST_CASE("A binned pixel gets the electrons of its sixteen pixels") {
  const auto full = bench(Profile::kHs1);
  const auto binned = bench(Profile::kBinned);
  const std::vector<float> fine = electrons(*full, 0, kFull * kFull);
  const std::vector<float> coarse = electrons(*binned, 0, kBinned * kBinned);
  double fine_sum = 0;
  double coarse_sum = 0;
  std::size_t compared = 0;
  for (std::size_t y = 20; y < 100; ++y) {
    for (std::size_t x = 20; x < 100; ++x) {
      double sum = 0;
      bool shaded = false;
      for (std::size_t k = 0; k < kSide * kSide; ++k) {
        const float one = fine[(kSide * y + k / kSide) * kFull + kSide * x + k % kSide];
        shaded = shaded || one < 100.0F;
        sum += one;
      }
      const double got = coarse[y * kBinned + x];
      if (shaded || got < 16 * 100.0) {
        continue;  // Behind a source head, or at the edge of the image.
      }
      ++compared;
      fine_sum += sum;
      coarse_sum += got;
      // Means of 16 gains of 1 % on one side, 0.25 % on the other: six of both at most; and a hot pixel on
      // either side, of at most 500 e- in 1 ms.
      CHECK(std::abs(got - sum) <= 0.021 * sum + 500.0);
    }
  }
  CHECK(compared > 4000);
  CHECK(coarse_sum == Approx(fine_sum).epsilon(5e-4));
}

TEST_CASE(
    "A binned sensor states the sums of its pixels' wells and dark currents and of their noise squared") {
  const auto full = bench(Profile::kHs1);
  const auto binned = bench(Profile::kBinned);
  const protocol::SensorInfo& one = full->descriptor().sensor;
  const protocol::SensorInfo& sum = binned->descriptor().sensor;
  CHECK(sum.width_px * 4 == one.width_px);
  CHECK(sum.height_px * 4 == one.height_px);
  CHECK(sum.bits == one.bits);
  CHECK(sum.full_well_e == Approx(16 * one.full_well_e));
  CHECK(sum.dark_current_e_per_s == Approx(16 * one.dark_current_e_per_s));
  CHECK(sum.read_noise_e == Approx(std::sqrt(16.0) * one.read_noise_e));
  CHECK(sum.full_well_e / sum.gain_e_per_dn == Approx(one.full_well_e / one.gain_e_per_dn));
  const protocol::Optics& lens = full->descriptor().optics;
  const protocol::Optics& seen = binned->descriptor().optics;
  CHECK(seen.radius_px * 4 == Approx(lens.radius_px));
  CHECK(seen.center_x_px * 4 == Approx(lens.center_x_px));
  CHECK(seen.center_y_px * 4 == Approx(lens.center_y_px));
}
