// Where each pixel looks: the factory geometry of the descriptor, turned by the sample's tilt when asked.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "host_sdk/reflectance/direction.h"
#include "protocol/descriptor.h"

namespace scatter::measurement {

/// Rotation from the instrument's frame into the frame of a tilted and turned sample.
struct SampleFrame {
  /// Rows of the rotation matrix: sample = rows * instrument.
  reflectance::Direction row_x{1, 0, 0};
  reflectance::Direction row_y{0, 1, 0};
  reflectance::Direction row_z{0, 0, 1};

  [[nodiscard]] reflectance::Direction to_sample(const reflectance::Direction& w) const noexcept {
    return {dot(row_x, w), dot(row_y, w), dot(row_z, w)};
  }
  [[nodiscard]] reflectance::Direction to_instrument(const reflectance::Direction& w) const noexcept {
    return {row_x.x * w.x + row_y.x * w.y + row_z.x * w.z, row_x.y * w.x + row_y.y * w.y + row_z.y * w.z,
            row_x.z * w.x + row_y.z * w.y + row_z.z * w.z};
  }
};

/// Frame of a sample whose normal leans by (x, y) [rad] towards the instrument's x and y axes (the
/// smallest rotation that does so), then turned about its normal by `rotation_rad`.
[[nodiscard]] SampleFrame sample_frame(double tilt_x_rad, double tilt_y_rad, double rotation_rad) noexcept;

/// Radius on the sensor [px] of a direction at theta [rad].
[[nodiscard]] double image_radius_px(const protocol::Optics& optics, double theta) noexcept;

/// Inverse of image_radius_px; nullopt beyond the image.
[[nodiscard]] std::optional<double> theta_at_radius(const protocol::Optics& optics,
                                                    double radius_px) noexcept;

/// Position on the sensor [px] of a direction in the instrument's frame (upper hemisphere).
struct SensorPoint {
  double x = 0;
  double y = 0;
};
[[nodiscard]] SensorPoint project(const protocol::Optics& optics, const reflectance::Direction& w) noexcept;

/// Directions of all pixel centres, instrument frame.
///
/// Pixels that see nothing (outside the image, hidden by a source head, known hot) are not usable.
struct PixelGeometry {
  std::uint16_t width = 0;
  std::uint16_t height = 0;
  std::vector<float> x;  ///< Components of the unit direction.
  std::vector<float> y;
  std::vector<float> z;
  std::vector<std::uint8_t> usable;  ///< 1: counts in resampling.
};

/// Cost  about 20 ms for 480 x 480 on one core; parallel.
[[nodiscard]] PixelGeometry pixel_geometry(const protocol::Descriptor& descriptor,
                                           const std::vector<std::uint32_t>& hot_pixels);

}  // namespace scatter::measurement
