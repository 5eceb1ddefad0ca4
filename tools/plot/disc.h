// One disc of the hemisphere: its data, its pixels, its marks.
#pragma once

#include <cstddef>
#include <optional>

#include "host_sdk/reflectance/grid_brdf.h"
#include "tools/plot/canvas.h"
#include "tools/plot/ticks.h"

namespace scatter::plot {

inline constexpr Colour kInvalidColour{0.27, 0.28, 0.30, 1};

struct Place {
  double x = 0;
  double y = 0;
};

/// One disc's data: a plane of values or the mean of all planes.
class Plane {
 public:
  Plane(const reflectance::GridBrdf::Content& content, const reflectance::GridPart& part,
        std::optional<std::size_t> channel)
      : content_(content), part_(part), channel_(channel) {}

  [[nodiscard]] double node(std::size_t index) const {
    if (channel_) {
      return part_.f_per_sr[*channel_][index];
    }
    double sum = 0;
    for (const auto& plane : part_.f_per_sr) {
      sum += plane[index];
    }
    return sum / double(part_.f_per_sr.size());
  }
  [[nodiscard]] reflectance::Origin origin(std::size_t index) const { return part_.origin[index]; }
  [[nodiscard]] std::size_t size() const { return part_.origin.size(); }
  [[nodiscard]] double theta_max() const { return double(content_.theta_count - 1) * content_.theta_step; }

  struct Sample {
    double value = 0;
    reflectance::Origin origin = reflectance::Origin::kInvalid;
  };
  /// Bilinear; next to an invalid node, and on a ring without a neighbour, the nearest node.
  [[nodiscard]] Sample at(double theta, double phi) const;

 private:
  const reflectance::GridBrdf::Content& content_;
  const reflectance::GridPart& part_;
  std::optional<std::size_t> channel_;
};

void mark_light(const Canvas& canvas, Place p, double size);
void mark_mirror(const Canvas& canvas, Place p, double size);

/// The data, hatched where nothing was measured, to the horizon; circles, spokes and both marks.
void draw_disc(const Canvas& canvas, const Plane& plane, const reflectance::GridPart& part, const Axis& axis,
               Place centre, double radius, Theme theme, double pixel_ratio);

/// "30°", "60°", "75°" beside the circles.
void draw_ring_names(const Canvas& canvas, Place centre, double radius);

}  // namespace scatter::plot
