// What NeighborIndex promises, done by comparing with every point; and the point sets to try it on.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "host_sdk/reflectance/direction.h"
#include "host_sdk/reflectance/search/neighbor_index.h"

namespace scatter::search {

inline bool nearer(const Neighbor& a, const Neighbor& b) {
  return a.distance_squared != b.distance_squared ? a.distance_squared < b.distance_squared : a.id < b.id;
}

/// Points with ids in a list.
class BruteForce {
 public:
  BruteForce() = default;
  explicit BruteForce(std::span<const Point> points) {
    for (const Point& p : points) {
      add(p, static_cast<std::uint32_t>(points_.size()));
    }
  }
  void add(const Point& p, std::uint32_t id) {
    points_.push_back(p);
    ids_.push_back(id);
  }
  bool remove(const Point& p, std::uint32_t id) {
    for (std::size_t k = 0; k < points_.size(); ++k) {
      if (ids_[k] == id && points_[k] == p) {
        points_[k] = points_.back();
        points_.pop_back();
        ids_[k] = ids_.back();
        ids_.pop_back();
        return true;
      }
    }
    return false;
  }
  [[nodiscard]] std::vector<Neighbor> nearest(const Point& q, std::size_t k) const {
    std::vector<Neighbor> all = within(q, std::numeric_limits<float>::infinity());
    all.resize(std::min(k, all.size()));
    return all;
  }
  [[nodiscard]] std::vector<Neighbor> within(const Point& q, float radius_squared) const {
    std::vector<Neighbor> found;
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const float d = distance(q, points_[k]);
      if (d <= radius_squared) {
        found.push_back({d, ids_[k]});
      }
    }
    std::sort(found.begin(), found.end(), nearer);
    return found;
  }
  [[nodiscard]] std::vector<std::uint32_t> find(const Point& q) const {
    std::vector<std::uint32_t> found;
    for (std::size_t k = 0; k < points_.size(); ++k) {
      if (points_[k] == q) {
        found.push_back(ids_[k]);
      }
    }
    std::sort(found.begin(), found.end());
    return found;
  }
  [[nodiscard]] std::size_t size() const { return points_.size(); }
  [[nodiscard]] const Point& point(std::size_t k) const { return points_[k]; }
  [[nodiscard]] std::uint32_t id(std::size_t k) const { return ids_[k]; }

 private:
  // volatile: every operation rounds to float, whatever the compiler would like to fuse.
  static float distance(const Point& a, const Point& b) {
    const auto square = [](float x) {
      const volatile float s = x * x;
      return static_cast<float>(s);
    };
    const volatile float incident = square(a.x_i - b.x_i) + square(a.y_i - b.y_i);
    const volatile float outgoing = square(a.x_o - b.x_o) + square(a.y_o - b.y_o);
    return incident + outgoing;
  }

  std::vector<Point> points_;
  std::vector<std::uint32_t> ids_;
};

inline Point geometry(double theta_i_deg, double phi_i_deg, double theta_o_deg, double phi_o_deg) {
  using reflectance::from_spherical;
  using reflectance::radians;
  return point_of(from_spherical(radians(theta_i_deg), radians(phi_i_deg)),
                  from_spherical(radians(theta_o_deg), radians(phi_o_deg)));
}

/// As the instrument measures: incidences 0, 20, 40, 60; theta_o 0..75, one coincident point per
/// azimuth at theta_o = 0.
inline std::vector<Point> goniometric(double step_deg) {
  std::vector<Point> points;
  for (double theta_i = 0; theta_i <= 60; theta_i += 20) {
    for (double theta_o = 0; theta_o <= 75; theta_o += step_deg) {
      for (double phi_o = 0; phi_o < 360; phi_o += step_deg) {
        points.push_back(geometry(theta_i, 0, theta_o, phi_o));
      }
    }
  }
  return points;
}

inline Point random_point(std::mt19937& random) {
  std::uniform_real_distribution<double> cosine(std::cos(reflectance::radians(75.0)), 1.0);
  std::uniform_real_distribution<double> turn(0.0, 360.0);
  const auto theta_deg = [&] { return reflectance::degrees(std::acos(cosine(random))); };
  const double theta_i_deg = theta_deg();
  const double phi_i_deg = turn(random);
  const double theta_o_deg = theta_deg();
  return geometry(theta_i_deg, phi_i_deg, theta_o_deg, turn(random));
}

inline std::vector<Point> random_points(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<Point> points(count);
  for (Point& p : points) {
    p = random_point(random);
  }
  return points;
}

/// Corners of a lattice of halves: many duplicates, and every point on the border of some box.
inline Point lattice_point(std::mt19937& random) {
  const auto half = [&] { return static_cast<float>(static_cast<int>(random() % 5) - 2) * 0.5F; };
  const float x_i = half();
  const float y_i = half();
  const float x_o = half();
  return {x_i, y_i, x_o, half()};
}

inline std::vector<Neighbor> nearest(const NeighborIndex& index, const Point& q, std::size_t k) {
  std::vector<Neighbor> found(k, {-1.0F, 12345});
  found.resize(index.nearest(q, found));
  return found;
}

}  // namespace scatter::search
