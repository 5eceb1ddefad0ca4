#include "simulator/corrosion/random_field.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <span>

#include <unsupported/Eigen/FFT>

#include "simulator/corrosion/draws.h"

namespace scatter::corrosion {
namespace {

using Complex = std::complex<float>;
/// Smallest 2^a, 3 * 2^a or 5 * 2^a that is not below `least`: sizes whose transforms are quick.
std::size_t transform_size(std::size_t least) {
  std::size_t best = 4;
  while (best < least) {
    best *= 2;
  }
  for (const std::size_t factor : {3U, 5U}) {
    std::size_t size = factor * 2;
    while (size < least) {
      size *= 2;
    }
    best = std::min(best, size);
  }
  return best;
}

/// Power of each mode of one field, by the square of its number.
class ModePower {
 public:
  ModePower(const FieldSpectrum& spectrum, double extent_mm)
      : exponent_(1 + spectrum.roughness),
        step_(std::pow(2 * std::numbers::pi * spectrum.length_mm / extent_mm, 2)) {
    // Integral of S over the plane up to the cut, with C = 1, and the area that each mode stands for.
    const double cut = std::pow(spectrum.length_mm / spectrum.finest_mm, 2);
    const double integral = (1 - std::pow(1 + cut, -spectrum.roughness)) / spectrum.roughness;
    scale_ = step_ / (std::numbers::pi * integral);
  }
  [[nodiscard]] double operator()(double squared_number) const {
    return scale_ * std::pow(1 + step_ * squared_number, -exponent_);
  }

 private:
  double exponent_;
  double step_;  ///< (2 pi length / extent)^2
  double scale_ = 0;
};

/// Two independent standard normal numbers from two words (Box and Muller).
std::complex<double> normal_pair(std::uint32_t first, std::uint32_t second) {
  const double radius = std::sqrt(-2 * std::log((first + 0.5) * 0x1p-32));
  return std::polar(radius, 2 * std::numbers::pi * ((second + 0.5) * 0x1p-32));
}

/// What a cubic spline whose knots are `size` to the period leaves of mode `number`: (sin x / x)^4.
double spline_gain(double number, double size) {
  const double x = std::numbers::pi * number / size;
  return x == 0 ? 1 : std::pow(std::sin(x) / x, 4);
}

/// Weights of the four knots around a place `t` behind the second one.
std::array<float, 4> spline_weights(float t) {
  const float s = 1 - t;
  return {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6,
          t * t * t / 6};
}

struct Tap {
  std::array<std::size_t, 4> knots{};
  std::array<float, 4> weights{};
};

/// Where each cell's middle lies among `size` knots to the period.
std::vector<Tap> taps(std::size_t side, std::size_t size) {
  std::vector<Tap> all(side);
  for (std::size_t i = 0; i < side; ++i) {
    const double place =
        (static_cast<double>(i) + 0.5) * static_cast<double>(size) / static_cast<double>(side);
    const auto knot = static_cast<std::size_t>(place);
    all[i].weights = spline_weights(static_cast<float>(place - static_cast<double>(knot)));
    for (std::size_t k = 0; k < 4; ++k) {
      all[i].knots[k] = (knot + size - 1 + k) % size;
    }
  }
  return all;
}

/// Modes up to `highest` in each direction, summed at `size` knots each way: the first field is the real
/// part.
class Knots {
 public:
  Knots(std::size_t highest, std::size_t size) : highest_(highest), size_(size) {
    columns_.resize((2 * highest + 1) * size);
  }

  /// Draws all modes inside the circle; returns the expected variances.
  std::array<double, 2> draw(std::uint64_t seed, double circle, const std::array<ModePower, 2>& powers) {
    const simulator::RandomKey key = key_of(seed, Draw::kField, 0);
    const auto limit = static_cast<std::int32_t>(highest_);
    std::vector<double> inverse_gain;
    for (std::size_t n = 0; n <= highest_; ++n) {
      inverse_gain.push_back(1 / spline_gain(static_cast<double>(n), static_cast<double>(size_)));
    }
    std::array<double, 2> variance{};
    for (std::int32_t ny = 0; ny <= limit; ++ny) {
      for (std::int32_t nx = ny == 0 ? 1 : -limit; nx <= limit; ++nx) {
        const double squared = static_cast<double>(nx) * nx + static_cast<double>(ny) * ny;
        if (squared >= circle * circle) {
          continue;
        }
        // One block per mode of half the plane; the other half is its conjugate, since fields are real.
        const auto words =
            key.block((static_cast<std::uint32_t>(nx + 0x8000) << 16U) | static_cast<std::uint32_t>(ny));
        const double gain = inverse_gain[static_cast<std::size_t>(std::abs(nx))] *
                            inverse_gain[static_cast<std::size_t>(ny)] * std::numbers::sqrt2 / 2;
        const std::array<double, 2> power{powers[0](squared), powers[1](squared)};
        const auto first = normal_pair(words[0], words[1]) * (gain * std::sqrt(power[0]));
        const auto second = normal_pair(words[2], words[3]) * (gain * std::sqrt(power[1]));
        const std::complex<double> i{0, 1};
        at(nx, ny) = Complex(first + i * second);
        at(-nx, -ny) = Complex(std::conj(first) + i * std::conj(second));
        variance[0] += 2 * power[0];
        variance[1] += 2 * power[1];
      }
    }
    return variance;
  }

  /// rows[y * size + x]: both fields at the knots.
  std::vector<Complex> transform() {
    Eigen::FFT<float> fft;
    fft.SetFlag(Eigen::FFT<float>::Unscaled);
    std::vector<Complex> scratch(size_);
    const auto n = static_cast<Eigen::Index>(size_);
    for (std::size_t column = 0; column <= 2 * highest_; ++column) {
      Complex* const values = columns_.data() + column * size_;
      fft.inv(scratch.data(), values, n);
      std::copy(scratch.begin(), scratch.end(), values);
    }
    std::vector<Complex> rows(size_ * size_);
    // Sixteen rows at a time, so that each line of memory of a column is read once.
    constexpr std::size_t kBand = 16;
    std::vector<Complex> band(kBand * size_);
    for (std::size_t y0 = 0; y0 < size_; y0 += kBand) {
      const std::size_t count = std::min(kBand, size_ - y0);
      for (std::size_t column = 0; column <= 2 * highest_; ++column) {
        // Column c holds mode c - highest.
        const std::size_t x = (column + size_ - highest_) % size_;
        for (std::size_t k = 0; k < count; ++k) {
          band[k * size_ + x] = columns_[column * size_ + y0 + k];
        }
      }
      for (std::size_t k = 0; k < count; ++k) {
        fft.inv(rows.data() + (y0 + k) * size_, band.data() + k * size_, n);
      }
    }
    return rows;
  }

 private:
  Complex& at(std::int32_t nx, std::int32_t ny) {
    const std::ptrdiff_t column = nx + static_cast<std::ptrdiff_t>(highest_);
    const std::ptrdiff_t row = ny < 0 ? ny + static_cast<std::ptrdiff_t>(size_) : ny;
    return columns_[static_cast<std::size_t>(column) * size_ + static_cast<std::size_t>(row)];
  }

  std::size_t highest_;
  std::size_t size_;
  std::vector<Complex> columns_;
};

}  // namespace

FieldPair random_fields(std::uint64_t seed, std::size_t side, double extent_mm,
                        const std::array<FieldSpectrum, 2>& spectra) {
  FieldPair fields;
  for (auto& values : fields.values) {
    values.assign(side * side, 0.0F);
  }
  const double physical = extent_mm / (2 * std::numbers::pi * spectra[0].finest_mm);
  const double circle = std::min(physical, static_cast<double>(side) / 2);
  const auto highest = static_cast<std::size_t>(std::ceil(circle)) - 1;
  if (circle <= 1) {
    return fields;  // the sheet is smaller than the finest wave
  }
  const std::size_t size = transform_size(3 * highest + 1);
  Knots knots(highest, size);
  fields.variance =
      knots.draw(seed, circle, {ModePower(spectra[0], extent_mm), ModePower(spectra[1], extent_mm)});
  const std::vector<Complex> rows = knots.transform();

  const std::vector<Tap> places = taps(side, size);
  std::vector<Complex> line(size);
  for (std::size_t y = 0; y < side; ++y) {
    const Tap& down = places[y];
    const std::array<const Complex*, 4> above{
        rows.data() + down.knots[0] * size, rows.data() + down.knots[1] * size,
        rows.data() + down.knots[2] * size, rows.data() + down.knots[3] * size};
    for (std::size_t x = 0; x < size; ++x) {
      line[x] = down.weights[0] * above[0][x] + down.weights[1] * above[1][x] +
                down.weights[2] * above[2][x] + down.weights[3] * above[3][x];
    }
    float* const first = fields.values[0].data() + y * side;
    float* const second = fields.values[1].data() + y * side;
    for (std::size_t x = 0; x < side; ++x) {
      const Tap& across = places[x];
      Complex sum = across.weights[0] * line[across.knots[0]];
      for (std::size_t k = 1; k < 4; ++k) {
        sum += across.weights[k] * line[across.knots[k]];
      }
      first[x] = sum.real();
      second[x] = sum.imag();
    }
  }
  return fields;
}

}  // namespace scatter::corrosion
