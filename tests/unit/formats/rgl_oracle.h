// The published formula of the adaptive parameterization (Dupuy and Jakob 2018), written plainly and
// apart from the code under test: own parsing, own arithmetic, whole tables summed up in double.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/reflectance/direction.h"

namespace scatter::formats::test {

class RglOracle {
 public:
  explicit RglOracle(std::string_view bytes) {
    std::size_t at = 14;
    const auto number = [&](std::size_t size) {
      std::uint64_t value = 0;
      std::memcpy(&value, bytes.data() + at, size);
      at += size;
      return value;
    };
    const std::uint64_t fields = number(4);
    for (std::uint64_t k = 0; k < fields; ++k) {
      const std::uint64_t length = number(2);
      const std::string name(bytes.substr(at, length));
      at += length;
      Array array;
      array.shape.resize(number(2));
      const std::uint64_t type = number(1);
      const std::uint64_t offset = number(8);
      std::uint64_t count = 1;
      for (std::uint64_t& size : array.shape) {
        size = number(8);
        count *= size;
      }
      if (type == 10) {
        std::vector<float> floats(count);
        std::memcpy(floats.data(), bytes.data() + offset, 4 * count);
        array.values.assign(floats.begin(), floats.end());
        arrays_[name] = array;
      }
    }
  }

  /// Fixes the incidence: mixes the normalised slices at (theta_i, phi_i) into one table.
  void set_incidence(double theta, double phi) {
    theta_ = theta;
    phi_ = phi;
    isotropic_ = arrays_.at("phi_i").values.size() <= 2;
    const auto [t, t_share] = bracket(arrays_.at("theta_i").values, theta);
    const auto [p, p_share] = bracket(arrays_.at("phi_i").values, phi);
    const auto& vndf = arrays_.at("vndf");
    height_ = vndf.shape[2];
    width_ = vndf.shape[3];
    density_.assign(height_ * width_, 0);
    slices_.clear();
    for (const std::size_t dp : {0U, 1U}) {
      for (const std::size_t dt : {0U, 1U}) {
        const double weight = (dp == 0 ? 1 - p_share : p_share) * (dt == 0 ? 1 - t_share : t_share);
        if (weight == 0) {
          continue;
        }
        const std::size_t slice = (p + dp) * vndf.shape[1] + t + dt;
        slices_.emplace_back(slice, weight);
        const double* q = vndf.values.data() + slice * width_ * height_;
        double total = 0;
        for (std::size_t r = 0; r + 1 < height_; ++r) {
          for (std::size_t c = 0; c + 1 < width_; ++c) {
            const std::size_t n = r * width_ + c;
            total += (q[n] + q[n + 1] + q[n + width_] + q[n + width_ + 1]) / 4;
          }
        }
        for (std::size_t n = 0; n < width_ * height_; ++n) {
          density_[n] += weight * q[n] / total;
        }
      }
    }
    // Integral of each cell, of rows of cells, of all below a row.
    rows_below_.assign(height_, 0);
    for (std::size_t r = 0; r + 1 < height_; ++r) {
      double row = 0;
      for (std::size_t c = 0; c + 1 < width_; ++c) {
        const std::size_t n = r * width_ + c;
        row += (density_[n] + density_[n + 1] + density_[n + width_] + density_[n + width_ + 1]) / 4;
      }
      rows_below_[r + 1] = rows_below_[r] + row;
    }
  }

  /// f without the cosine, three channels (or as many as the file has).
  [[nodiscard]] std::vector<double> eval(const reflectance::Direction& o) const {
    const double pi = 3.14159265358979323846;
    const double s = std::sin(theta_);
    const reflectance::Direction i{s * std::cos(phi_), s * std::sin(phi_), std::cos(theta_)};
    const double length =
        std::sqrt((i.x + o.x) * (i.x + o.x) + (i.y + o.y) * (i.y + o.y) + (i.z + o.z) * (i.z + o.z));
    const double mx = (i.x + o.x) / length;
    const double my = (i.y + o.y) / length;
    const double mz = (i.z + o.z) / length;
    const double theta_m = std::atan2(std::sqrt(mx * mx + my * my), mz);
    double phi_m = std::atan2(my, mx) - (isotropic_ ? phi_ : 0);
    while (phi_m < -pi) {
      phi_m += 2 * pi;
    }
    while (phi_m >= pi) {
      phi_m -= 2 * pi;
    }
    const double x = std::sqrt(theta_m / (pi / 2));
    const double y = (phi_m + pi) / (2 * pi);

    // Marginal of y: rows below, and part of the row of cells that y lies in.
    const double gx = x * static_cast<double>(width_ - 1);
    const double gy = y * static_cast<double>(height_ - 1);
    const std::size_t c0 = std::min(static_cast<std::size_t>(gx), width_ - 2);
    const std::size_t r0 = std::min(static_cast<std::size_t>(gy), height_ - 2);
    const double fx = gx - static_cast<double>(c0);
    const double fy = gy - static_cast<double>(r0);
    // The density along x at a height in the row of cells.
    const auto line = [&](std::size_t c, double height) {
      return (1 - height) * density_[r0 * width_ + c] + height * density_[(r0 + 1) * width_ + c];
    };
    double partial = 0;
    double whole = 0;
    double up_to_x = 0;
    for (std::size_t c = 0; c + 1 < width_; ++c) {
      // Mean height of the density over y in 0..fy of this cell column is its value at fy / 2.
      partial += fy * (line(c, fy / 2) + line(c + 1, fy / 2)) / 2;
      const double a = line(c, fy);
      const double b = line(c + 1, fy);
      whole += (a + b) / 2;
      if (c < c0) {
        up_to_x += (a + b) / 2;
      } else if (c == c0) {
        up_to_x += fx * (a + (a + fx * (b - a))) / 2;
      }
    }
    const double sample_y = (rows_below_[r0] + partial) / rows_below_.back();
    const double sample_x = whole > 0 ? up_to_x / whole : 0;

    const bool spectral = arrays_.contains("spectra");
    const Array& spectra = arrays_.at(spectral ? "spectra" : "rgb");
    const std::size_t channels = spectra.shape[2];
    const double ndf = lookup(arrays_.at("ndf"), 0, x, y);
    double y_i = (phi_ + pi) / (2 * pi);
    y_i -= std::floor(y_i);
    const double sigma = lookup(arrays_.at("sigma"), 0, std::sqrt(theta_ / (pi / 2)), y_i);
    std::vector<double> f(channels);
    for (std::size_t c = 0; c < channels; ++c) {
      for (const auto& [slice, weight] : slices_) {
        f[c] += weight * lookup(spectra, slice * channels + c, sample_x, sample_y);
      }
      f[c] = std::max(0.0, f[c] * ndf / (4 * sigma) / o.z);
    }
    return f;
  }

 private:
  struct Array {
    std::vector<std::uint64_t> shape;
    std::vector<double> values;
  };

  static std::pair<std::size_t, double> bracket(const std::vector<double>& axis, double value) {
    if (axis.size() == 1 || value <= axis.front()) {
      return {0, 0};
    }
    for (std::size_t k = 0; k + 1 < axis.size(); ++k) {
      if (value < axis[k + 1]) {
        return {k, (value - axis[k]) / (axis[k + 1] - axis[k])};
      }
    }
    return {axis.size() - 2, 1};
  }

  /// Bilinear in one table of an array whose last two sizes are those of a table.
  static double lookup(const Array& array, std::size_t table, double x, double y) {
    const std::size_t width = array.shape[array.shape.size() - 1];
    const std::size_t height = array.shape[array.shape.size() - 2];
    const double gx = x * static_cast<double>(width - 1);
    const double gy = y * static_cast<double>(height - 1);
    double sum = 0;
    for (std::size_t r = 0; r < height; ++r) {
      const double wy = 1 - std::abs(gy - static_cast<double>(r));
      if (wy <= 0) {
        continue;
      }
      for (std::size_t c = 0; c < width; ++c) {
        const double wx = 1 - std::abs(gx - static_cast<double>(c));
        if (wx > 0) {
          sum += wx * wy * array.values[(table * height + r) * width + c];
        }
      }
    }
    return sum;
  }

  std::map<std::string, Array> arrays_;
  double theta_ = 0;
  double phi_ = 0;
  bool isotropic_ = true;
  std::size_t width_ = 0;
  std::size_t height_ = 0;
  std::vector<double> density_;
  std::vector<double> rows_below_;
  std::vector<std::pair<std::size_t, double>> slices_;
};

}  // namespace scatter::formats::test
