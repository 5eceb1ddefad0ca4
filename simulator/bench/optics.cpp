#include "simulator/bench/optics.h"

#include <algorithm>
#include <cmath>

namespace scatter::simulator {
namespace {

constexpr std::size_t kSteps = 8192;

}  // namespace

double Lens::radius_px(double theta) const noexcept {
  const double t2 = theta * theta;
  return parameters_.radius_px * theta * (parameters_.a1 + t2 * (parameters_.a3 + t2 * parameters_.a5));
}

double Lens::radial_scale(double theta) const noexcept {
  const double t2 = theta * theta;
  return parameters_.radius_px * (parameters_.a1 + t2 * (3 * parameters_.a3 + t2 * 5 * parameters_.a5));
}

Lens::Lens(const LensParameters& parameters)
    : parameters_(parameters),
      cosine_(std::cos(parameters.rotation_rad)),
      sine_(std::sin(parameters.rotation_rad)) {
  const double edge = 1.1 * radius_px(parameters.theta_max_rad);
  per_step_ = static_cast<double>(kSteps) / (edge * edge);
  table_.reserve(kSteps + 1);
  double theta = 0;
  for (std::size_t k = 0; k <= kSteps; ++k) {
    const double radius = std::sqrt(static_cast<double>(k) / per_step_);
    for (int iteration = 0; iteration < 30; ++iteration) {
      const double step = (radius - radius_px(theta)) / radial_scale(theta);
      theta += step;
      if (std::abs(step) < 1e-14) {
        break;
      }
    }
    table_.push_back({k == 0 ? 1.0 / radial_scale(0) : std::sin(theta) / radius, std::cos(theta)});
  }
}

reflectance::Direction Lens::direction(double x_px, double y_px) const noexcept {
  const double dx = x_px - parameters_.center_x_px;
  const double dy = y_px - parameters_.center_y_px;
  const double position = std::min((dx * dx + dy * dy) * per_step_, static_cast<double>(kSteps) - 1e-6);
  const auto k = static_cast<std::size_t>(position);
  const double t = position - static_cast<double>(k);
  const double s =
      table_[k].sine_over_radius + t * (table_[k + 1].sine_over_radius - table_[k].sine_over_radius);
  const double z = table_[k].cosine + t * (table_[k + 1].cosine - table_[k].cosine);
  return {s * (dx * cosine_ + dy * sine_), s * (dy * cosine_ - dx * sine_), z};
}

Lens::Point Lens::image(const reflectance::Direction& direction) const noexcept {
  const double across = std::hypot(direction.x, direction.y);
  const double scale = across > 0 ? radius_px(reflectance::theta_of(direction)) / across : 0.0;
  const double x = scale * direction.x;
  const double y = scale * direction.y;
  return {parameters_.center_x_px + x * cosine_ - y * sine_,
          parameters_.center_y_px + x * sine_ + y * cosine_};
}

}  // namespace scatter::simulator
