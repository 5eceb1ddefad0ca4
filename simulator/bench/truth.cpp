#include "simulator/bench/truth.h"

#include <algorithm>
#include <cmath>

#include "simulator/bench/profile.h"
#include "simulator/random/noise.h"
#include "simulator/random/stream.h"

namespace scatter::simulator {
namespace {

using reflectance::radians;
using Vector = reflectance::Direction;

// Of a pixel that is not binned.
constexpr double kPixelGainRms = 0.01;
constexpr double kPixelOffsetRms_dn = 0.5;
constexpr double kHotShare = 5e-4;
constexpr double kStrayShare = 0.002;
/// Smaller than the certified blind radius, so that its disc hides every pixel that is touched.
constexpr double kHeadRadiusRad = 2.1 * reflectance::kPi / 180.0;

/// Pixels that a pixel of the frame sums.
double area(const BenchOptions& options) noexcept {
  return static_cast<double>(binning(options.profile)) * binning(options.profile);
}

/// What a draw is worth: nothing when the certificates are exact.
class Draws {
 public:
  explicit Draws(const BenchOptions& options)
      : stream_({options.seed, Purpose::kCalibrationDraws}),
        scale_(options.references == References::kDrawn ? 1.0 : 0.0) {}
  double normal(double deviation) noexcept { return scale_ * deviation * stream_.normal(); }

 private:
  RandomStream stream_;
  double scale_;
};

/// Head moved by angles along increasing theta and along increasing phi (y at the poles).
Vector moved(double theta, double phi, double along_theta, double along_phi) noexcept {
  const Vector d = reflectance::from_spherical(theta, phi);
  const Vector e_theta{std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi), -std::sin(theta)};
  const Vector e_phi{-std::sin(phi), std::cos(phi), 0};
  return reflectance::normalized({d.x + along_theta * e_theta.x + along_phi * e_phi.x,
                                  d.y + along_theta * e_theta.y + along_phi * e_phi.y,
                                  d.z + along_theta * e_theta.z + along_phi * e_phi.z});
}

void draw_geometry(const protocol::Descriptor& d, const BenchOptions& options, Draws& draws, Truth& truth) {
  const double u = radians(0.03);
  LensParameters& lens = truth.lens;
  lens = {.center_x_px = d.optics.center_x_px,
          .center_y_px = d.optics.center_y_px,
          .radius_px = d.optics.radius_px,
          .a1 = d.optics.a1,
          .a3 = d.optics.a3,
          .a5 = d.optics.a5,
          .rotation_rad = d.optics.rotation_rad,
          .theta_max_rad = d.optics.image_theta_max_rad};
  const Lens certified(lens);
  const double limit = d.optics.theta_max_rad;
  lens.center_x_px += draws.normal(u) * certified.radial_scale(0) + options.faults.decentred_px;
  lens.center_y_px += draws.normal(u) * certified.radial_scale(0);
  // A change of scale that moves the image of the range's edge by the drawn angle.
  lens.radius_px *= 1.0 + draws.normal(u) * certified.radial_scale(limit) / certified.radius_px(limit);
  lens.rotation_rad += draws.normal(u);
  for (const protocol::Illumination& led : d.illuminations) {
    if (led.head == truth.heads.size()) {
      const double knocked =
          led.head == options.faults.misaligned_head ? options.faults.misalignment_rad : 0.0;
      const double along_theta = draws.normal(u) + knocked;
      const double along_phi = draws.normal(u);
      truth.heads.push_back(
          {moved(led.theta_rad, led.phi_rad, along_theta, along_phi), double{led.angular_radius_rad}});
    }
    // K_s makes every reference equally bright, whatever cos(theta_i).
    const bool below = led.theta_rad > reflectance::kPi / 2;
    truth.gain.push_back(area(options) * kReferenceRate_e_per_s /
                         (below ? kTranslucent_per_sr : kWhite_per_sr) /
                         std::abs(std::cos(double{led.theta_rad})));
  }
}

/// Specks of dust: each dims a soft disc.
class Dirt {
 public:
  Dirt(const BenchOptions& options, double width_px) : depth_(options.faults.dirt) {
    RandomStream random({options.seed, Purpose::kFaults, 1});
    for (auto& speck : specks_) {
      speck = {random.uniform() * width_px, random.uniform() * width_px,
               width_px * (0.004 + 0.012 * random.uniform())};
    }
  }
  [[nodiscard]] double pass(double x, double y) const noexcept {
    double most = 0;
    for (const auto& [cx, cy, radius] : specks_) {
      const double r2 = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / (radius * radius);
      most = std::max(most, r2 < 25 ? std::exp(-0.5 * r2) : 0.0);
    }
    return 1.0 - depth_ * most;
  }
  [[nodiscard]] bool any() const noexcept { return depth_ > 0; }

 private:
  struct Speck {
    double x, y, radius;
  };
  double depth_;
  std::array<Speck, 24> specks_;
};

/// Vignetting and lens falloff: 1 in the middle, 0.3 at 75 deg, a little lopsided.
double falloff(const Vector& w) noexcept {
  const double edge = std::sin(radians(75));
  const double sine2 = (w.x * w.x + w.y * w.y) / (edge * edge);
  return (1.0 - 0.7 * sine2) * (1.0 + 0.02 * (0.6 * w.x + 0.8 * w.y));
}

bool hidden_by_head(const Truth& truth, const Vector& w) noexcept {
  const double limit = std::cos(kHeadRadiusRad);
  return std::ranges::any_of(truth.heads, [&](const Head& head) { return dot(head.towards, w) > limit; });
}

std::vector<float> normals(const RandomKey& key, std::size_t count) {
  const std::vector<float> nothing(count, 0.0F);
  std::vector<float> zeros(count);
  std::vector<float> values(count);
  draw_shot_and_read_noise(key, 0, nothing, zeros, values);
  return values;
}

void draw_sensor(const protocol::Descriptor& d, const BenchOptions& options, Truth& truth) {
  const std::size_t width = d.sensor.width_px;
  const std::size_t count = width * d.sensor.height_px;
  truth.gain_map.resize(count);
  truth.offset_dn.resize(count);
  truth.sensitivity.resize(count);
  truth.stray_e_per_s.resize(count);
  truth.leak_e_per_s.resize(count);
  truth.dark_e_per_s.assign(count, d.sensor.dark_current_e_per_s);
  const Lens lens(truth.lens);
  const double edge = std::cos(truth.lens.theta_max_rad);
  const double half = static_cast<double>(width) / 2;
  const double drawn = options.references == References::kDrawn ? 0.001 : 0.0;
  const Dirt dirt(options, static_cast<double>(width));
  // Means over a block scatter less: by the block's side, and so do offsets in units of its larger gain.
  const double per_side = 1.0 / binning(options.profile);
  const double rate_e_per_s = area(options) * kReferenceRate_e_per_s;
  const std::vector<float> gains = normals({options.seed, Purpose::kPixelGain}, count);
  const std::vector<float> gain_draws = normals({options.seed, Purpose::kPixelGainDraws}, count);
  const std::vector<float> offsets = normals({options.seed, Purpose::kPixelOffset}, count);
  for (std::size_t p = 0; p < count; ++p) {
    const double x = static_cast<double>(p % width) + 0.5;
    const double y = static_cast<double>(p / width) + 0.5;
    const auto steps =
        std::clamp(std::lround(1000 * kPixelGainRms * per_side * double{gains[p]}), -127L, 127L);
    truth.gain_map[p] = static_cast<std::byte>(static_cast<std::int8_t>(steps));
    const double gain = 1.0 + 1e-3 * static_cast<double>(steps) + drawn * double{gain_draws[p]};
    truth.offset_dn[p] =
        static_cast<float>(d.sensor.black_level_dn + kPixelOffsetRms_dn * per_side * double{offsets[p]});
    truth.stray_e_per_s[p] = static_cast<float>(gain * kStrayShare * rate_e_per_s *
                                                (1.0 + 0.3 * (x - half) / half - 0.2 * (y - half) / half));
    const Vector w = lens.direction(x, y);
    if (w.z >= edge) {
      const double pass = falloff(w) * (dirt.any() ? dirt.pass(x, y) : 1.0) * gain;
      truth.leak_e_per_s[p] =
          static_cast<float>(pass * rate_e_per_s / 0.99 * (1.0 + 0.3 * (0.8 * w.x - 0.6 * w.y)));
      truth.sensitivity[p] = hidden_by_head(truth, w) ? 0.0F : static_cast<float>(pass);
    }
  }
}

void draw_hot_pixels(const BenchOptions& options, Truth& truth) {
  const auto count = static_cast<std::uint32_t>(truth.dark_e_per_s.size());
  const auto known = static_cast<std::uint32_t>(std::lround(kHotShare * area(options) * count));
  RandomStream random({options.seed, Purpose::kHotPixels});
  const auto heat = [&](std::uint32_t pixel, RandomStream& from) {
    truth.dark_e_per_s[pixel] += static_cast<float>(5000.0 * std::pow(100.0, from.uniform()));
  };
  std::vector<std::uint32_t> places;
  for (std::uint32_t k = 0; k < known; ++k) {
    places.push_back(random.below(count));
    heat(places.back(), random);
  }
  std::ranges::sort(places);
  places.erase(std::ranges::unique(places).begin(), places.end());
  for (const std::uint32_t place : places) {
    for (unsigned shift = 0; shift < 32; shift += 8) {
      truth.hot_pixels.push_back(static_cast<std::byte>(place >> shift));
    }
  }
  RandomStream later({options.seed, Purpose::kFaults, 0});
  for (std::uint32_t k = 0; k < options.faults.extra_hot_pixels; ++k) {
    heat(later.below(count), later);
  }
}

}  // namespace

Truth draw_truth(const protocol::Descriptor& d, const BenchOptions& options) {
  Truth truth;
  Draws draws(options);
  const auto reference = [&](double f, double relative) {
    ColourValues values{};
    for (double& value : values) {
      value = f * (1.0 + draws.normal(relative));
    }
    return values;
  };
  truth.white_per_sr = reference(kWhite_per_sr, 0.003);
  truth.black_per_sr = reference(kBlack_per_sr, 0.05);
  truth.translucent_per_sr = reference(kTranslucent_per_sr, 0.003);
  truth.linearity = double{d.sensor.linearity} + draws.normal(0.001);
  draw_geometry(d, options, draws, truth);
  truth.drift_phase = 2 * reflectance::kPi * RandomStream({options.seed, Purpose::kDrift}).uniform();
  draw_sensor(d, options, truth);
  draw_hot_pixels(options, truth);
  return truth;
}

}  // namespace scatter::simulator
