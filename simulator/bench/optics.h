// Where on the sensor a direction images, and back, for the true lens.
#pragma once

#include <vector>

#include "host_sdk/reflectance/direction.h"

namespace scatter::simulator {

/// True parameters, in the form of protocol::Optics.
struct LensParameters {
  double center_x_px = 0;
  double center_y_px = 0;
  double radius_px = 0;
  double a1 = 0, a3 = 0, a5 = 0;
  double rotation_rad = 0;
  double theta_max_rad = 0;  ///< The image's edge, below 90 deg; r must rise up to 10 % beyond it.
};

class Lens {
 public:
  explicit Lens(const LensParameters& parameters);

  [[nodiscard]] const LensParameters& parameters() const noexcept { return parameters_; }

  /// Unit vector that images at (x, y) [px]; right to 1e-8. Beyond 1.1 times the image's radius
  /// it stays at the edge of the table.
  [[nodiscard]] reflectance::Direction direction(double x_px, double y_px) const noexcept;

  struct Point {
    double x_px = 0;
    double y_px = 0;
  };
  /// Image of a direction with z > 0.
  [[nodiscard]] Point image(const reflectance::Direction& direction) const noexcept;
  /// Distance from the centre [px] of an image at theta.
  [[nodiscard]] double radius_px(double theta) const noexcept;
  /// d radius / d theta [px/rad].
  [[nodiscard]] double radial_scale(double theta) const noexcept;

 private:
  /// Both are smooth in the squared radius, so that linear interpolation in it is enough.
  struct Entry {
    double sine_over_radius;
    double cosine;
  };
  LensParameters parameters_;
  double cosine_ = 1;
  double sine_ = 0;
  double per_step_ = 1;
  std::vector<Entry> table_;
};

}  // namespace scatter::simulator
