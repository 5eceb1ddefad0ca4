#include "host_sdk/measurement/pixel_geometry.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace scatter::measurement {

using reflectance::Direction;

SampleFrame sample_frame(double tilt_x_rad, double tilt_y_rad, double rotation_rad) noexcept {
  const double tilt = std::hypot(tilt_x_rad, tilt_y_rad);
  const double c = std::cos(tilt);
  const double s = std::sin(tilt);
  const double ux = tilt > 0 ? tilt_x_rad / tilt : 1.0;
  const double uy = tilt > 0 ? tilt_y_rad / tilt : 0.0;
  // Columns of the tilt rotation: images of the instrument's axes, z -> (s ux, s uy, c).
  const Direction ex{1 - ux * ux * (1 - c), -ux * uy * (1 - c), -s * ux};
  const Direction ey{-ux * uy * (1 - c), 1 - uy * uy * (1 - c), -s * uy};
  const Direction ez{s * ux, s * uy, c};
  const double cr = std::cos(rotation_rad);
  const double sr = std::sin(rotation_rad);
  SampleFrame frame;
  frame.row_x = {cr * ex.x + sr * ey.x, cr * ex.y + sr * ey.y, cr * ex.z + sr * ey.z};
  frame.row_y = {-sr * ex.x + cr * ey.x, -sr * ex.y + cr * ey.y, -sr * ex.z + cr * ey.z};
  frame.row_z = ez;
  return frame;
}

double image_radius_px(const protocol::Optics& o, double theta) noexcept {
  const double t2 = theta * theta;
  return static_cast<double>(o.radius_px) * theta *
         (static_cast<double>(o.a1) + t2 * (static_cast<double>(o.a3) + t2 * static_cast<double>(o.a5)));
}

std::optional<double> theta_at_radius(const protocol::Optics& o, double radius_px) noexcept {
  const double limit = static_cast<double>(o.image_theta_max_rad);
  if (radius_px > image_radius_px(o, limit)) {
    return std::nullopt;
  }
  const double target = radius_px / static_cast<double>(o.radius_px);
  double theta = std::min(target / static_cast<double>(o.a1), limit);
  for (int i = 0; i < 12; ++i) {
    const double t2 = theta * theta;
    const double value = theta * (static_cast<double>(o.a1) +
                                  t2 * (static_cast<double>(o.a3) + t2 * static_cast<double>(o.a5)));
    const double slope =
        static_cast<double>(o.a1) + t2 * (3 * static_cast<double>(o.a3) + t2 * 5 * static_cast<double>(o.a5));
    const double step = (value - target) / slope;
    theta = std::clamp(theta - step, 0.0, limit);
    if (std::abs(step) < 1e-10) {
      break;
    }
  }
  return theta;
}

SensorPoint project(const protocol::Optics& o, const Direction& w) noexcept {
  const double rho = std::hypot(w.x, w.y);
  const double r = image_radius_px(o, std::atan2(rho, w.z));
  if (rho == 0) {
    return {static_cast<double>(o.center_x_px), static_cast<double>(o.center_y_px)};
  }
  const double c = std::cos(static_cast<double>(o.rotation_rad));
  const double s = std::sin(static_cast<double>(o.rotation_rad));
  return {static_cast<double>(o.center_x_px) + r * (w.x * c - w.y * s) / rho,
          static_cast<double>(o.center_y_px) + r * (w.y * c + w.x * s) / rho};
}

PixelGeometry pixel_geometry(const protocol::Descriptor& d, const std::vector<std::uint32_t>& hot_pixels) {
  PixelGeometry g;
  g.width = d.sensor.width_px;
  g.height = d.sensor.height_px;
  const std::size_t count = std::size_t{g.width} * g.height;
  g.x.assign(count, 0.0F);
  g.y.assign(count, 0.0F);
  g.z.assign(count, 0.0F);
  g.usable.assign(count, 0);

  struct Disc {
    Direction axis;
    double cos_radius;
  };
  std::vector<Disc> blind;
  for (const protocol::BlindSpot& spot : d.blind_spots) {
    blind.push_back(
        {reflectance::from_spherical(static_cast<double>(spot.theta_rad), static_cast<double>(spot.phi_rad)),
         std::cos(static_cast<double>(spot.radius_rad))});
  }

  const double cos_turn = std::cos(static_cast<double>(d.optics.rotation_rad));
  const double sin_turn = std::sin(static_cast<double>(d.optics.rotation_rad));
  oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, g.height), [&](const auto& rows) {
    for (std::size_t j = rows.begin(); j != rows.end(); ++j) {
      for (std::size_t i = 0; i < g.width; ++i) {
        const double px = static_cast<double>(i) + 0.5 - static_cast<double>(d.optics.center_x_px);
        const double py = static_cast<double>(j) + 0.5 - static_cast<double>(d.optics.center_y_px);
        const double r = std::hypot(px, py);
        const auto theta = theta_at_radius(d.optics, r);
        if (!theta) {
          continue;
        }
        // (px, py) / r is the image's azimuth; turned back by the rotation it is the direction's.
        const double s = r > 0 ? std::sin(*theta) / r : 0.0;
        const Direction w{s * (px * cos_turn + py * sin_turn), s * (py * cos_turn - px * sin_turn),
                          std::cos(*theta)};
        const std::size_t p = j * g.width + i;
        g.x[p] = static_cast<float>(w.x);
        g.y[p] = static_cast<float>(w.y);
        g.z[p] = static_cast<float>(w.z);
        g.usable[p] = std::ranges::none_of(
                          blind, [&](const Disc& disc) { return dot(disc.axis, w) >= disc.cos_radius; })
                          ? 1
                          : 0;
      }
    }
  });
  for (const std::uint32_t p : hot_pixels) {
    if (p < count) {
      g.usable[p] = 0;
    }
  }
  return g;
}

}  // namespace scatter::measurement
