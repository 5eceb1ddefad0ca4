// The edge of the measured region, and what lies on it.
#pragma once

#include <optional>
#include <span>

#include "host_sdk/reflectance/estimators/estimator.h"

namespace scatter::reflectance {

/// One straight edge of the rectangle of polar angles that is known.
struct Edge {
  enum class Axis : std::uint8_t { kThetaI, kThetaO };
  Axis axis = Axis::kThetaO;
  double at = radians(75);  ///< Last known angle [rad], itself still inside; 0 < at < pi/2.
  bool upper = true;        ///< Unknown beyond `at`; false: unknown below it.
  /// Azimuth that light along the normal is taken to have [rad]; matters to a lower edge of theta_i only.
  double azimuth = 0;
};

/// What lies beyond the edge, the edge itself left out.
[[nodiscard]] AngularRegion region_beyond(const Edge& edge) noexcept;

/// Angle from the edge [rad], 0 inside.
[[nodiscard]] double beyond(const Edge& edge, ScatterType type, const Direction& omega_i,
                            const Direction& omega_o) noexcept;

/// Takes geometries beyond an edge to the nearest ones on it.
///
/// kThetaO: the same azimuth, the same light. kThetaI: the same azimuth of the light; the outgoing direction
/// keeps its angles to the mirror direction, so that a lobe stays on its feet, and is lifted to the horizon
/// when it falls below.
class EdgeMap {
 public:
  EdgeMap(const Edge& edge, ScatterType type, const Direction& omega_i) noexcept;

  /// Light on the edge (kThetaI), or the light as it was.
  [[nodiscard]] const Direction& omega_i() const noexcept { return on_edge_; }
  [[nodiscard]] Direction operator()(const Direction& omega_o) const noexcept;

 private:
  Edge::Axis axis_;
  double side_;
  double cos_at_;
  double sin_at_;
  Direction on_edge_;
  double cos_i_ = 1;  ///< Azimuth of the light.
  double sin_i_ = 0;
  double cos_turn_ = 1;
  double sin_turn_ = 0;
};

}  // namespace scatter::reflectance
