#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/merl.h"
#include "host_sdk/formats/merl_layout.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::Direction;
using reflectance::HalfDifferenceBrdf;
using reflectance::Origin;
using reflectance::ScatterType;

constexpr double kNoValue = -1;
constexpr std::array<float, 3> kPrimaries_nm{630, 525, 465};

/// Which channel goes into red, green and blue.
std::optional<std::array<std::size_t, 3>> rgb_channels(const Brdf& brdf) {
  if (brdf.channels() == 1) {
    return std::array<std::size_t, 3>{0, 0, 0};
  }
  if (brdf.channels() == 3) {
    return std::array<std::size_t, 3>{0, 1, 2};
  }
  const auto wavelengths = brdf.wavelengths_nm();
  if (brdf.channels() < 3 || wavelengths.size() != brdf.channels()) {
    return std::nullopt;
  }
  std::array<std::size_t, 3> out{};
  for (std::size_t k = 0; k < out.size(); ++k) {
    for (std::size_t c = 1; c < wavelengths.size(); ++c) {
      if (std::abs(wavelengths[c] - kPrimaries_nm[k]) < std::abs(wavelengths[out[k]] - kPrimaries_nm[k])) {
        out[k] = c;
      }
    }
  }
  return out;
}

/// File image, written cell by cell from any thread.
class Image {
 public:
  explicit Image(const HalfDifferenceBrdf::Content& layout) : cells_(layout.cells()) {
    bytes_.resize(kMerlHeader + kMerlScale.size() * cells_ * sizeof(double));
    const std::array<std::int32_t, 3> counts{static_cast<std::int32_t>(layout.theta_h_count),
                                             static_cast<std::int32_t>(layout.theta_d_count),
                                             static_cast<std::int32_t>(layout.phi_d_count)};
    std::memcpy(bytes_.data(), counts.data(), kMerlHeader);
  }
  void set(std::size_t channel, std::size_t cell, double f_per_sr) {
    const double value = f_per_sr < 0 || !std::isfinite(f_per_sr) ? kNoValue : f_per_sr / kMerlScale[channel];
    std::memcpy(bytes_.data() + kMerlHeader + (channel * cells_ + cell) * sizeof(double), &value,
                sizeof value);
  }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  std::size_t cells_;
  std::string bytes_;
};

/// One row of phi_d: geometries above the horizon are asked for together.
void fill_row(const Brdf& brdf, const std::array<std::size_t, 3>& rgb,
              const HalfDifferenceBrdf::Content& layout, std::size_t theta_h, std::size_t theta_d,
              Image& image) {
  std::vector<Direction> omega_i;
  std::vector<Direction> omega_o;
  std::vector<std::size_t> cells;
  for (std::size_t k = 0; k < layout.phi_d_count; ++k) {
    const std::size_t cell = (theta_h * layout.theta_d_count + theta_d) * layout.phi_d_count + k;
    const auto pair = reflectance::directions_of(layout.centre(theta_h, theta_d, k));
    if (pair.omega_i.z > 0 && pair.omega_o.z > 0) {
      // The light at azimuth 0, where data of one rotation have it.
      const double level = std::hypot(pair.omega_i.x, pair.omega_i.y);
      const double c = level > 0 ? pair.omega_i.x / level : 1;
      const double s = level > 0 ? pair.omega_i.y / level : 0;
      omega_i.push_back({level, 0, pair.omega_i.z});
      omega_o.push_back(
          {c * pair.omega_o.x + s * pair.omega_o.y, c * pair.omega_o.y - s * pair.omega_o.x, pair.omega_o.z});
      cells.push_back(cell);
    } else {
      for (std::size_t c = 0; c < rgb.size(); ++c) {
        image.set(c, cell, kNoValue);
      }
    }
  }
  const std::size_t channels = brdf.channels();
  std::vector<double> f(cells.size() * channels);
  std::vector<Origin> origin(cells.size());
  brdf.eval_pairs(omega_i, omega_o, f, origin);
  for (std::size_t k = 0; k < cells.size(); ++k) {
    for (std::size_t c = 0; c < rgb.size(); ++c) {
      // A negative number would read as no value at all.
      const double value = std::max(0.0, f[k * channels + rgb[c]]);
      image.set(c, cells[k], origin[k] == Origin::kInvalid ? kNoValue : value);
    }
  }
}

std::string encode_table(const HalfDifferenceBrdf& brdf, const std::array<std::size_t, 3>& rgb) {
  const auto& content = brdf.content();
  Image image(content);
  for (std::size_t c = 0; c < rgb.size(); ++c) {
    for (std::size_t cell = 0; cell < content.cells(); ++cell) {
      image.set(c, cell, static_cast<double>(content.f_per_sr[rgb[c] * content.cells() + cell]));
    }
  }
  return image.take();
}

}  // namespace

Result<std::string> encode_merl(const Brdf& brdf, const MerlOptions& options) {
  if (brdf.type() != ScatterType::kBrdf) {
    return fail(ErrorCode::kInvalidArgument, "MERL: the data are a BTDF, expected a BRDF",
                "write a format that knows transmission");
  }
  const auto rgb = rgb_channels(brdf);
  if (!rgb) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("MERL: {} channels with {} wavelengths, expected red, green and blue",
                            brdf.channels(), brdf.wavelengths_nm().size()),
                "choose one channel to write");
  }
  if (const auto* table = dynamic_cast<const HalfDifferenceBrdf*>(&brdf)) {
    return encode_table(*table, *rgb);
  }
  HalfDifferenceBrdf::Content layout;
  layout.theta_h_count = kMerlTheta;
  layout.theta_d_count = kMerlTheta;
  layout.phi_d_count = options.reciprocal ? kMerlPhi : 2 * kMerlPhi;
  layout.reciprocal = options.reciprocal;
  Image image(layout);
  tbb::parallel_for(std::size_t{0}, kMerlTheta * kMerlTheta, [&](std::size_t row) {
    fill_row(brdf, *rgb, layout, row / kMerlTheta, row % kMerlTheta, image);
  });
  return image.take();
}

Status write_merl(const Brdf& brdf, const std::filesystem::path& path, const MerlOptions& options) {
  const auto bytes = encode_merl(brdf, options);
  return bytes ? write_file(path, *bytes) : std::unexpected(bytes.error());
}

}  // namespace scatter::formats
