#include "tests/bench/knn_sets.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <utility>

#include "tests/bench/knn_peers.h"

namespace scatter::bench {

namespace {

using reflectance::from_spherical;
using reflectance::radians;

std::vector<search::Point> goniometric(int last_deg, int step_deg) {
  std::vector<search::Point> points;
  for (int theta_i = 0; theta_i <= last_deg; theta_i += step_deg) {
    const reflectance::Direction omega_i = from_spherical(radians(theta_i), 0);
    for (int theta_o = 0; theta_o <= 75; ++theta_o) {
      for (int phi_o = 0; phi_o < 360; ++phi_o) {
        points.push_back(search::point_of(omega_i, from_spherical(radians(theta_o), radians(phi_o))));
      }
    }
  }
  return points;
}

// Every fourth bit of a number below 2^16.
std::uint64_t fourth_bits(std::uint64_t x) {
  std::uint64_t spread = 0;
  for (unsigned bit = 0; bit < 16; ++bit) {
    spread |= (x >> bit & 1) << (4 * bit);
  }
  return spread;
}

}  // namespace

std::vector<search::Point> random_in_cone(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> cosine(std::cos(radians(75)), 1.0);
  std::uniform_real_distribution<double> azimuth(0.0, 2 * reflectance::kPi);
  const auto direction = [&] {
    const double theta = std::acos(cosine(random));
    return from_spherical(theta, azimuth(random));
  };
  std::vector<search::Point> points(count);
  for (search::Point& p : points) {
    const reflectance::Direction omega_i = direction();
    p = search::point_of(omega_i, direction());
  }
  return points;
}

std::vector<search::Point> knn_points(std::string_view set) {
  if (set == "gonio") {
    return goniometric(60, 20);
  }
  if (set == "dense") {
    return goniometric(62, 1);
  }
  const std::array<std::pair<std::string_view, std::size_t>, 3> random{
      {{"random1e4", 10000}, {"random1e5", 100000}, {"random1e6", 1000000}}};
  for (const auto& [name, count] : random) {
    if (set == name) {
      return random_in_cone(count, 1);
    }
  }
  std::abort();
}

void sort_along_curve(std::vector<search::Point>& points) {
  const auto place = [](float x) { return fourth_bits(static_cast<std::uint64_t>((x + 1) * 32767.0F)); };
  std::vector<std::pair<std::uint64_t, search::Point>> order(points.size());
  std::transform(points.begin(), points.end(), order.begin(), [&](const search::Point& p) {
    return std::pair{place(p.x_i) << 3 | place(p.y_i) << 2 | place(p.x_o) << 1 | place(p.y_o), p};
  });
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::transform(order.begin(), order.end(), points.begin(), [](const auto& entry) { return entry.second; });
}

void check_agreement(const search::NeighborIndex& ours, KnnPeer& peer,
                     const std::vector<search::Point>& queries, std::size_t k) {
  std::vector<search::Neighbor> found(k);
  for (std::size_t q = 0; q < std::min<std::size_t>(queries.size(), 500); ++q) {
    const std::size_t count = ours.nearest(queries[q], found);
    const std::vector<double> theirs = peer.distances(queries[q], k);
    for (std::size_t n = 0; n < k; ++n) {
      if (count != k || std::abs(found[n].distance_squared - theirs[n]) > 1e-6 * theirs[n] + 1e-12) {
        fmt::print(stderr, "knn: neighbour {} of query {} is {} away, the peer says {}\n", n, q,
                   found[n].distance_squared, theirs[n]);
        std::abort();
      }
    }
  }
}

}  // namespace scatter::bench
