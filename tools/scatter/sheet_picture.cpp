#include "tools/scatter/sheet_picture.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "tools/scatter/picture_light.h"

namespace scatter::cli {
namespace {

using corrosion::Appearance;
using corrosion::Regime;
using corrosion::Rgb;
using corrosion::Sheet;
using images::Image;

constexpr int kLongestShadow = 64;  // cells
constexpr float kHoleLight = 0.012F;

/// The row or column `offset` away: on the other side of a toroidal sheet, else at the border.
std::size_t away(std::size_t at, int offset, const Sheet& sheet) noexcept {
  const auto side = static_cast<std::ptrdiff_t>(sheet.side);
  std::ptrdiff_t to = static_cast<std::ptrdiff_t>(at) + offset;
  if (sheet.toroidal) {
    to = (to % side + side) % side;
  }
  return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(to, 0, side - 1));
}

/// Means over a square of 2 radius + 1 cells, by running sums along rows, then along columns.
std::vector<float> box_mean(std::span<const float> values, int radius, const Sheet& sheet) {
  const std::size_t side = sheet.side;
  std::vector<float> rows(values.size());
  std::vector<float> both(values.size());
  const double count = 2.0 * radius + 1;
  tbb::parallel_for(std::size_t{0}, side, [&](std::size_t y) {
    double sum = 0;
    for (int k = -radius; k <= radius; ++k) {
      sum += static_cast<double>(values[y * side + away(0, k, sheet)]);
    }
    for (std::size_t x = 0; x < side; ++x) {
      rows[y * side + x] = static_cast<float>(sum / count);
      sum += static_cast<double>(values[y * side + away(x, radius + 1, sheet)]) -
             static_cast<double>(values[y * side + away(x, -radius, sheet)]);
    }
  });
  tbb::parallel_for(std::size_t{0}, side, [&](std::size_t x) {
    double sum = 0;
    for (int k = -radius; k <= radius; ++k) {
      sum += static_cast<double>(rows[away(0, k, sheet) * side + x]);
    }
    for (std::size_t y = 0; y < side; ++y) {
      both[y * side + x] = static_cast<float>(sum / count);
      sum += static_cast<double>(rows[away(y, radius + 1, sheet) * side + x]) -
             static_cast<double>(rows[away(y, -radius, sheet) * side + x]);
    }
  });
  return both;
}

/// 1 in the sun, 0 in shadow; soft by how far the ray passes below what stands in its way.
float sunlit(const Sheet& sheet, std::size_t x, std::size_t y) {
  const float most = std::max(std::abs(kSun[0]), std::abs(kSun[1]));
  const auto cell_mm = static_cast<float>(sheet.cell_mm());
  const auto thickness = static_cast<float>(sheet.thickness_mm);
  const float rise = kSun[2] / most * cell_mm;
  const float start = sheet.height[y * sheet.side + x] * thickness;
  float light = 1;
  for (int k = 1; k <= kLongestShadow; ++k) {
    const float ray = start + rise * static_cast<float>(k);
    if (ray >= thickness) {
      break;
    }
    const auto offset = [k, most](float direction) {
      return static_cast<int>(std::lround(static_cast<float>(k) * direction / most));
    };
    const std::size_t there = away(y, -offset(kSun[1]), sheet) * sheet.side + away(x, offset(kSun[0]), sheet);
    const float above = sheet.height[there] * thickness - ray;
    light = std::min(light, 1 - above / (0.3F * rise * static_cast<float>(k)));
  }
  return std::clamp(light, 0.0F, 1.0F);
}

float dot(const std::array<float, 3>& a, const std::array<float, 3>& b) noexcept {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// The grain of brushed metal, for the eye only: brightness along rows, the same for every sheet of that
/// side, without a seam. Mean 1.
float brushed(std::size_t x, std::size_t y, std::size_t side) noexcept {
  constexpr std::uint32_t kKnots = 16;  // along a row
  constexpr float kContrast = 0.10F;
  const auto random = [y](std::uint32_t knot) {
    // Murmur3's finisher over row and knot: any hash that mixes well.
    std::uint32_t h = static_cast<std::uint32_t>(y) * 0x9E3779B1U + (knot % kKnots) * 0x85EBCA77U;
    h = (h ^ h >> 16U) * 0x85EBCA6BU;
    h = (h ^ h >> 13U) * 0xC2B2AE35U;
    return static_cast<float>((h ^ h >> 16U) >> 8U) * 0x1p-24F - 0.5F;
  };
  const float at = static_cast<float>(x) * static_cast<float>(kKnots) / static_cast<float>(side);
  const auto knot = static_cast<std::uint32_t>(at);
  const float share = at - static_cast<float>(knot);
  return 1 + kContrast * (random(knot) * (1 - share) + random(knot + 1) * share);
}

/// Light that metal mirrors upwards: the sky, darker towards the horizon, and the sun's blurred image.
float mirrored(const std::array<float, 3>& normal, float alpha, float sun, float sky) noexcept {
  const float up = 2 * normal[2] * normal[2] - 1;  // z of the mirrored direction
  const float horizon = std::clamp(0.5F + 0.5F * up, 0.0F, 1.0F);
  const std::array<float, 3> sum{kSun[0], kSun[1], kSun[2] + 1};
  const float length = std::sqrt(dot(sum, sum));
  const float cosine = dot(sum, normal) / length;
  const float spread = cosine * cosine * (alpha * alpha - 1) + 1;
  const float lobe = cosine > 0 ? alpha * alpha / (3.14159F * spread * spread) : 0;
  return kMirroredSky * sky * horizon * horizon + std::min(0.4F * lobe * sun, 0.25F);
}

Rgb lit(const Sheet& sheet, const Appearance& look, std::size_t x, std::size_t y, float sky) {
  const std::size_t n = y * sheet.side + x;
  if (look.regime[n] == Regime::kHole) {
    return {kHoleLight, kHoleLight, kHoleLight};
  }
  const auto& normal = look.normal[n];
  const float sun = sunlit(sheet, x, y);
  float light = 0;
  if (look.regime[n] == Regime::kMetal) {
    light = mirrored(normal, look.roughness[n], sun, sky) * brushed(x, y, sheet.side);
  } else {
    light = kSunLight * sun * std::max(0.0F, dot(normal, kSun)) + kSkyLight * sky * (0.5F + 0.5F * normal[2]);
  }
  Rgb out = look.albedo[n];
  for (float& channel : out) {
    channel *= light;
  }
  return out;
}

}  // namespace

Image sky_share(const Sheet& sheet) {
  Image share{.width = sheet.side, .height = sheet.side, .channels = 1, .values = {}};
  share.values.assign(sheet.cells(), 1.0F);
  const auto thickness = static_cast<float>(sheet.thickness_mm);
  const auto cell_mm = static_cast<float>(sheet.cell_mm());
  for (const float distance_mm : {0.4F * thickness, 1.6F * thickness}) {
    const int most = std::max(1, static_cast<int>(sheet.side / 4));
    const int radius = std::clamp(static_cast<int>(std::lround(distance_mm / cell_mm)), 1, most);
    const std::vector<float> mean = box_mean(sheet.height, radius, sheet);
    const float scale = thickness / (static_cast<float>(radius) * cell_mm);
    for (std::size_t n = 0; n < mean.size(); ++n) {
      // A hollow of this slope all round sees the cosine squared of it.
      const float slope = std::max(0.0F, mean[n] - sheet.height[n]) * scale;
      share.values[n] *= 1 / (1 + slope * slope);
    }
  }
  return share;
}

Image lit_picture(const Sheet& sheet, const Appearance& look) {
  const Image sky = sky_share(sheet);
  Image picture{.width = sheet.side, .height = sheet.side, .channels = 3, .values = {}};
  picture.values.resize(sheet.cells() * 3);
  tbb::parallel_for(std::size_t{0}, sheet.side, [&](std::size_t y) {
    for (std::size_t x = 0; x < sheet.side; ++x) {
      const std::size_t n = y * sheet.side + x;
      std::ranges::copy(lit(sheet, look, x, y, sky.values[n]),
                        picture.values.begin() + static_cast<long>(3 * n));
    }
  });
  return picture;
}

Image regime_picture(const Appearance& look) {
  constexpr std::array<std::array<float, 3>, 3> kColours{{{176, 184, 192}, {200, 90, 20}, {0, 0, 0}}};
  Image picture{.width = look.side, .height = look.side, .channels = 3, .values = {}};
  picture.values.reserve(look.regime.size() * 3);
  for (const Regime regime : look.regime) {
    for (const float channel : kColours[static_cast<std::size_t>(regime)]) {
      picture.values.push_back(channel / 255);
    }
  }
  return picture;
}

Image scaled_down(const Image& image, std::size_t longest_side) {
  const std::size_t longest = std::max(image.width, image.height);
  if (longest <= longest_side) {
    return image;
  }
  const auto size = [&](std::size_t side) { return std::max<std::size_t>(1, side * longest_side / longest); };
  Image small{
      .width = size(image.width), .height = size(image.height), .channels = image.channels, .values = {}};
  small.values.resize(small.pixels() * small.channels);
  // Weights of the old pixels that a new one covers: whole ones, and parts at both ends.
  const auto overlap = [](std::size_t old_at, double from, double to) {
    return std::min(to, static_cast<double>(old_at) + 1) - std::max(from, static_cast<double>(old_at));
  };
  tbb::parallel_for(std::size_t{0}, small.height, [&](std::size_t y) {
    const double step_y = static_cast<double>(image.height) / static_cast<double>(small.height);
    const double step_x = static_cast<double>(image.width) / static_cast<double>(small.width);
    const double top = static_cast<double>(y) * step_y;
    for (std::size_t x = 0; x < small.width; ++x) {
      const double left = static_cast<double>(x) * step_x;
      std::array<double, 4> sum{};
      for (auto v = static_cast<std::size_t>(top); v < image.height && static_cast<double>(v) < top + step_y;
           ++v) {
        const double rows = overlap(v, top, top + step_y);
        for (auto u = static_cast<std::size_t>(left);
             u < image.width && static_cast<double>(u) < left + step_x; ++u) {
          const double weight = rows * overlap(u, left, left + step_x);
          for (std::size_t c = 0; c < image.channels; ++c) {
            sum[c] += weight * static_cast<double>(image.values[(v * image.width + u) * image.channels + c]);
          }
        }
      }
      for (std::size_t c = 0; c < small.channels; ++c) {
        small.values[(y * small.width + x) * small.channels + c] =
            static_cast<float>(sum[c] / (step_x * step_y));
      }
    }
  });
  return small;
}

}  // namespace scatter::cli
