#include "simulator/bench/light.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace scatter::simulator {
namespace {

using Vector = reflectance::Direction;

/// Estimated change by averaging, relative, below which the value at the pixel's middle will do.
constexpr double kSmooth = 1e-4;
/// The same, above which seven source points are too few, and above which only the finest rule will do.
constexpr double kSharp = 0.004;
constexpr double kSharpest = 0.05;

struct SourcePoint {
  Vector towards;
  double weight;
};
struct PixelPoint {
  double x, y;  ///< From the pixel's middle [px].
  double weight;
};
struct Rule {
  std::vector<SourcePoint> source;
  std::vector<PixelPoint> pixel;
};

/// The point of the source's disc at share q of its area from the middle, azimuth a.
Vector on_disc(const Head& head, double q, double a) noexcept {
  const Vector& d = head.towards;
  const Vector u = reflectance::normalized(std::abs(d.y) < 0.9 ? Vector{d.z, 0, -d.x} : Vector{0, d.z, -d.y});
  const Vector v = cross(d, u);
  const double rho = 2 * std::asin(std::sqrt(q) * std::sin(head.angular_radius_rad / 2));
  const double c = std::cos(rho);
  const double su = std::sin(rho) * std::cos(a);
  const double sv = std::sin(rho) * std::sin(a);
  return {c * d.x + su * u.x + sv * v.x, c * d.y + su * u.y + sv * v.y, c * d.z + su * u.z + sv * v.z};
}

/// Degree 5 on the disc (Radon's seven points), degree 3 on the pixel (2 x 2 Gauss).
Rule radon_rule(const Head& head) {
  Rule rule;
  rule.source.push_back({head.towards, 0.25});
  for (int k = 0; k < 6; ++k) {
    rule.source.push_back({on_disc(head, 2.0 / 3.0, k * reflectance::kPi / 3), 0.125});
  }
  const double g = 0.288675134594813;
  rule.pixel = {{-g, -g, 0.25}, {g, -g, 0.25}, {-g, g, 0.25}, {g, g, 0.25}};
  return rule;
}

struct GaussNode {
  double at;  ///< -1/2..1/2.
  double weight;
};
constexpr std::array<GaussNode, 2> kGauss2{{{-0.288675134594813, 0.5}, {0.288675134594813, 0.5}}};
constexpr std::array<GaussNode, 3> kGauss3{{{-0.387298334620742, 0.277777777777778},
                                            {0.0, 0.444444444444444},
                                            {0.387298334620742, 0.277777777777778}}};
constexpr std::array<GaussNode, 4> kGauss4{{{-0.430568155797026, 0.173927422568727},
                                            {-0.169990521792428, 0.326072577431273},
                                            {0.169990521792428, 0.326072577431273},
                                            {0.430568155797026, 0.173927422568727}}};

/// Gauss rings of `around` points on the disc, Gauss points on the pixel.
Rule ring_rule(const Head& head, std::span<const GaussNode> rings, int around,
               std::span<const GaussNode> pixel) {
  Rule rule;
  for (std::size_t j = 0; j < rings.size(); ++j) {
    for (int k = 0; k < around; ++k) {
      const double azimuth = 2 * reflectance::kPi * (k + 0.5 * static_cast<double>(j % 2)) / around;
      rule.source.push_back({on_disc(head, 0.5 + rings[j].at, azimuth), rings[j].weight / around});
    }
  }
  for (const GaussNode& x : pixel) {
    for (const GaussNode& y : pixel) {
      rule.pixel.push_back({x.at, y.at, x.weight * y.weight});
    }
  }
  return rule;
}

struct Rules {
  explicit Rules(const Head& head)
      : curved(radon_rule(head)),
        sharp(ring_rule(head, kGauss3, 8, kGauss2)),
        finest(ring_rule(head, kGauss4, 12, kGauss4)) {}
  Rule curved;
  Rule sharp;
  Rule finest;
};

class Integration {
 public:
  Integration(const Lens& lens, std::size_t width, std::size_t height, const Head& head, const Aspect& aspect)
      : lens_(lens), width_(width), height_(height), head_(head), aspect_(aspect) {
    for (auto& plane : image_) {
      plane.assign(width * height, 0.0F);
    }
    inside_.assign(width * height, 0);
    // Variance of disc and pixel along one axis, halved: what multiplies the second derivatives.
    const double source_px = head.angular_radius_rad * lens.radial_scale(0);
    blur_ = 0.5 * (source_px * source_px / 4 + 1.0 / 12);
  }

  LightImage run(Fineness fineness) {
    rows([&](std::size_t y) { centres(y); });
    const LightImage middles = image_;
    if (aspect_.broad() && fineness == Fineness::kAdaptive) {
      rows([&](std::size_t y) { smear(middles, y); });
    } else {
      const Rules rules(head_);
      rows([&](std::size_t y) { refine(middles, y, rules, fineness); });
    }
    if (Aspect::Regular part; aspect_.regular(part)) {
      add_regular(part);
    }
    return std::move(image_);
  }

 private:
  template <typename Row>
  void rows(const Row& row) const {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, height_, 4), [&](const auto& range) {
      for (std::size_t y = range.begin(); y != range.end(); ++y) {
        row(y);
      }
    });
  }

  /// Values at the pixels' middles for the source's middle.
  void centres(std::size_t y) {
    const double edge = std::cos(lens_.parameters().theta_max_rad);
    std::array<Vector, Aspect::kBatch> to;
    std::array<std::size_t, Aspect::kBatch> at;
    std::array<double, Aspect::kBatch * kColours> out;
    std::size_t count = 0;
    for (std::size_t x = 0; x <= width_; ++x) {
      if (count == to.size() || (x == width_ && count > 0)) {
        aspect_.radiance(head_.towards, std::span(to).first(count), std::span(out).first(count * kColours));
        for (std::size_t k = 0; k < count; ++k) {
          for (std::size_t c = 0; c < kColours; ++c) {
            image_[c][at[k]] = static_cast<float>(out[k * kColours + c]);
          }
        }
        count = 0;
      }
      if (x == width_) {
        break;
      }
      const Vector w = lens_.direction(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      if (w.z >= edge) {
        to[count] = w;
        at[count++] = y * width_ + x;
        inside_[y * width_ + x] = 1;
      }
    }
  }

  [[nodiscard]] bool inside(std::size_t x, std::size_t y) const noexcept {
    return x < width_ && y < height_ && inside_[y * width_ + x] != 0;
  }

  /// Second differences along x and y [per px^2]; 0 across the image's edge.
  [[nodiscard]] std::array<double, 2> bends(const std::vector<float>& plane, std::size_t x,
                                            std::size_t y) const noexcept {
    std::array<double, 2> bend{};
    const std::size_t p = y * width_ + x;
    const double twice = 2.0 * plane[p];
    if (inside(x - 1, y) && inside(x + 1, y)) {
      bend[0] = static_cast<double>(plane[p - 1]) + plane[p + 1] - twice;
    }
    if (inside(x, y - 1) && inside(x, y + 1)) {
      bend[1] = static_cast<double>(plane[p - width_]) + plane[p + width_] - twice;
    }
    return bend;
  }

  /// Largest relative change by averaging that the pixel and its neighbours promise.
  [[nodiscard]] double change(const LightImage& middles, std::size_t x, std::size_t y) const noexcept {
    double most = 0;
    for (std::size_t j = y - 1; j != y + 2; ++j) {
      for (std::size_t i = x - 1; i != x + 2; ++i) {
        if (!inside(i, j)) {
          continue;
        }
        for (const std::vector<float>& plane : middles) {
          const auto [along_x, along_y] = bends(plane, i, j);
          const double bend = std::abs(along_x) + std::abs(along_y);
          if (bend > 0) {
            most = std::max(most, blur_ * bend / std::max<double>(plane[j * width_ + i], 1e-12));
          }
        }
      }
    }
    return most;
  }

  void apply(const Rule& rule, std::size_t x, std::size_t y) {
    std::array<Vector, 16> to;
    std::array<double, 16 * kColours> out;
    const std::size_t count = rule.pixel.size();
    for (std::size_t k = 0; k < count; ++k) {
      to[k] = lens_.direction(static_cast<double>(x) + 0.5 + rule.pixel[k].x,
                              static_cast<double>(y) + 0.5 + rule.pixel[k].y);
    }
    std::array<double, kColours> sum{};
    for (const SourcePoint& source : rule.source) {
      aspect_.radiance(source.towards, std::span(to).first(count), std::span(out).first(count * kColours));
      for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t c = 0; c < kColours; ++c) {
          sum[c] += source.weight * rule.pixel[k].weight * out[k * kColours + c];
        }
      }
    }
    for (std::size_t c = 0; c < kColours; ++c) {
      image_[c][y * width_ + x] = static_cast<float>(sum[c]);
    }
  }

  void refine(const LightImage& middles, std::size_t y, const Rules& rules, Fineness fineness) {
    // A lobe narrower than a pixel may hide between the middles: look closely where it must be.
    const Vector mirror = aspect_.straight();
    const Lens::Point peak = lens_.image(mirror);
    const double near = 3.0 + head_.angular_radius_rad * lens_.radial_scale(0);
    for (std::size_t x = 0; x < width_; ++x) {
      if (!inside(x, y)) {
        continue;
      }
      const double estimate = change(middles, x, y);
      const bool at_peak = mirror.z > 0 && std::hypot(static_cast<double>(x) + 0.5 - peak.x_px,
                                                      static_cast<double>(y) + 0.5 - peak.y_px) < near;
      if (fineness == Fineness::kFinest || estimate > kSharpest || at_peak) {
        apply(rules.finest, x, y);
      } else if (estimate > kSmooth) {
        apply(estimate > kSharp ? rules.sharp : rules.curved, x, y);
      }
    }
  }

  /// Unevenness and broad lobes blur far more than disc and pixel: their share to second order is enough.
  void smear(const LightImage& middles, std::size_t y) {
    for (std::size_t x = 0; x < width_; ++x) {
      for (std::size_t c = 0; inside(x, y) && c < kColours; ++c) {
        const auto [along_x, along_y] = bends(middles[c], x, y);
        image_[c][y * width_ + x] += static_cast<float>(blur_ * (along_x + along_y));
      }
    }
  }

  /// The source's disc itself, seen in a mirror or through a film.
  void add_regular(const Aspect::Regular& part) {
    constexpr int kSub = 32;
    const double cosine = std::cos(head_.angular_radius_rad);
    const double solid_angle_sr = 2 * reflectance::kPi * (1 - cosine);
    if (part.towards.z <= 0) {
      return;
    }
    const Lens::Point middle = lens_.image(part.towards);
    const double reach = 2.0 + 1.5 * head_.angular_radius_rad * lens_.radial_scale(0);
    for (std::size_t p = 0; p < inside_.size(); ++p) {
      const auto x = static_cast<double>(p % width_);
      const auto y = static_cast<double>(p / width_);
      if (inside_[p] == 0 || std::hypot(x + 0.5 - middle.x_px, y + 0.5 - middle.y_px) > reach) {
        continue;
      }
      int hits = 0;
      for (int k = 0; k < kSub * kSub; ++k) {
        const Vector w = lens_.direction(x + (k % kSub + 0.5) / kSub, y + (k / kSub + 0.5) / kSub);
        // Chords instead of cosines: 1 - cos of half a degree has few digits left.
        const Vector chord{w.x - part.towards.x, w.y - part.towards.y, w.z - part.towards.z};
        hits += dot(chord, chord) < 2 * (1 - cosine) ? 1 : 0;
      }
      for (std::size_t c = 0; c < kColours; ++c) {
        image_[c][p] += static_cast<float>(part.weight[c] / solid_angle_sr * hits / (kSub * kSub));
      }
    }
  }

  const Lens& lens_;
  std::size_t width_;
  std::size_t height_;
  const Head& head_;
  const Aspect& aspect_;
  double blur_ = 0;
  LightImage image_;
  std::vector<std::uint8_t> inside_;
};

}  // namespace

LightImage integrate(const Lens& lens, std::size_t width, std::size_t height, const Head& head,
                     const Aspect& aspect, Fineness fineness) {
  return Integration(lens, width, height, head, aspect).run(fineness);
}

double mean_cosine(const Head& head) noexcept {
  return std::abs(head.towards.z) * (1 + std::cos(head.angular_radius_rad)) / 2;
}

}  // namespace scatter::simulator
