#include "host_sdk/reflectance/bilinear_warp.h"

#include <hwy/highway.h>
#include <hwy/targets.h>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "host_sdk/reflectance/warp_sums.h"

using namespace scatter;
using namespace scatter::reflectance;

namespace {

std::vector<float> random_values(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<float> values(count);
  for (float& value : values) {
    value = unit(random) < 0.1F ? 0.0F : std::pow(unit(random), 8.0F);
  }
  return values;
}

/// With each of the ways that the processor offers.
template <typename Check>
void on_each_target(const Check& check) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    INFO(hwy::TargetName(target));
    check();
  }
  hwy::SetSupportedTargetsForTest(0);
}

}  // namespace

TEST_CASE("Sums along rows are those of the cells, whatever the width and the processor") {
  // Around the blocks of 16 cells, and around the 4 blocks that are summed together.
  for (const std::size_t width : {2, 3, 15, 16, 17, 18, 33, 63, 64, 65, 66, 80, 81, 127, 128, 129, 200}) {
    constexpr std::size_t kRows = 5;
    const std::vector<float> values = random_values(kRows * width, static_cast<unsigned>(width));
    on_each_target([&] {
      std::vector<double> sums(kRows * warp_blocks(width));
      REQUIRE(sum_rows(values, width, sums.data()));
      for (std::size_t row = 0; row < kRows; ++row) {
        const float* v = values.data() + row * width;
        const double* found = sums.data() + row * warp_blocks(width);
        double sum = 0;
        for (std::size_t cell = 0; cell + 1 < width; ++cell) {
          if (cell % kWarpBlock == 0) {
            REQUIRE(found[cell / kWarpBlock] == Approx(sum).epsilon(1e-13).margin(1e-13));
          }
          sum += 0.5 * (static_cast<double>(v[cell]) + static_cast<double>(v[cell + 1]));
        }
        REQUIRE(found[warp_blocks(width) - 1] == Approx(sum).epsilon(1e-13).margin(1e-13));
      }
    });
  }
}

TEST_CASE("A value that is no density is refused wherever it stands, and a negative zero is one") {
  for (const std::size_t width : {5, 64, 70, 128}) {
    const std::vector<float> good = random_values(2 * width, 7);
    on_each_target([&] {
      std::vector<double> sums(2 * warp_blocks(width));
      for (std::size_t k = 0; k < good.size(); ++k) {
        for (const float wrong : {-1e-30F, std::numeric_limits<float>::quiet_NaN(), HUGE_VALF, -HUGE_VALF}) {
          std::vector<float> values = good;
          values[k] = wrong;
          REQUIRE_FALSE(sum_rows(values, width, sums.data()));
        }
        std::vector<float> values = good;
        values[k] = -0.0F;
        REQUIRE(sum_rows(values, width, sums.data()));
      }
    });
  }
  std::vector<float> values(12, 1.0F);
  values[7] = -3;
  const auto warp = BilinearWarp::make({4, 3, values});
  REQUIRE_FALSE(warp.has_value());
  CHECK(warp.error().code == ErrorCode::kInvalidArgument);
  CHECK(warp.error().what == "value 7 is -3, expected a finite number of at least 0");
}

TEST_CASE("Sampling undoes inversion, and the density is the derivative of both") {
  constexpr std::size_t kWidth = 40;
  constexpr std::size_t kHeight = 21;
  std::vector<float> values = random_values(2 * kWidth * kHeight, 3);
  for (float& value : values) {
    value += 0.01F;  // Where nothing lies, inversion has no answer.
  }
  const BilinearWarp warp = BilinearWarp::make({kWidth, kHeight, std::move(values)}).value();
  const TableMix mix{.table = {0, 1}, .weight = {0.3, 0.7}, .count = 2};
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(0.001, 0.999);
  for (int k = 0; k < 2000; ++k) {
    const SquarePoint at{unit(random), unit(random)};
    const SquarePoint again = warp.sample(warp.invert(at, mix), mix);
    REQUIRE(again.x == Approx(at.x).margin(1e-9));
    REQUIRE(again.y == Approx(at.y).margin(1e-9));
    // In a row, x alone moves the first coordinate, y alone the second.
    constexpr double kStep = 1e-6;
    const SquarePoint left = warp.invert({at.x - kStep, at.y}, mix);
    const SquarePoint right = warp.invert({at.x + kStep, at.y}, mix);
    const SquarePoint low = warp.invert({at.x, at.y - kStep}, mix);
    const SquarePoint high = warp.invert({at.x, at.y + kStep}, mix);
    const double slope = (right.x - left.x) * (high.y - low.y) / (4 * kStep * kStep);
    REQUIRE(slope == Approx(warp.density(at, mix)).epsilon(1e-2));
  }
}
