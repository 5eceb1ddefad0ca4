#include "simulator/corrosion/patina/rolling_ball.h"

#include <algorithm>
#include <cmath>

namespace scatter::corrosion {
namespace {

/// A place of the ball's lower half: cells aside and height above its lowest point.
struct BallPoint {
  std::size_t dx;
  std::size_t dy;
  float rise_um;
};

/// Cells aside are taken modulo the side; parts higher than the relief never touch and are left out.
std::vector<BallPoint> ball_of(double radius_um, double cell_um, double relief_um, std::size_t side) {
  const double lowest_touch = std::max(0.0, radius_um - relief_um);
  const double reach_um = std::sqrt(radius_um * radius_um - lowest_touch * lowest_touch);
  const auto k = static_cast<long>(reach_um / cell_um);
  const auto n = static_cast<long>(side);
  std::vector<BallPoint> ball;
  for (long dy = -k; dy <= k; ++dy) {
    for (long dx = -k; dx <= k; ++dx) {
      const double aside = std::hypot(static_cast<double>(dx), static_cast<double>(dy)) * cell_um;
      if (aside > reach_um) {
        continue;
      }
      const double rise = radius_um - std::sqrt(radius_um * radius_um - aside * aside);
      ball.push_back({static_cast<std::size_t>((dx % n + n) % n), static_cast<std::size_t>((dy % n + n) % n),
                      static_cast<float>(rise)});
    }
  }
  return ball;
}

/// out[x] = best over the ball of in[x + aside] + sign rise.
template <typename Best>
void sweep(std::span<const float> in, std::span<float> out, std::size_t side, std::span<const BallPoint> ball,
           float sign, Best best) {
  std::ranges::copy(in, out.begin());
  for (const BallPoint& point : ball) {
    const float rise = sign * point.rise_um;
    for (std::size_t y = 0; y < side; ++y) {
      const std::size_t source_row = y + point.dy < side ? y + point.dy : y + point.dy - side;
      const float* source = in.data() + source_row * side;
      float* target = out.data() + y * side;
      const std::size_t straight = side - point.dx;
      for (std::size_t x = 0; x < straight; ++x) {
        target[x] = best(target[x], source[x + point.dx] + rise);
      }
      for (std::size_t x = straight; x < side; ++x) {
        target[x] = best(target[x], source[x - straight] + rise);
      }
    }
  }
}

}  // namespace

std::vector<float> closed_by_ball(std::span<const float> height_um, std::size_t side, double cell_um,
                                  double radius_um) {
  std::vector<float> closed(height_um.begin(), height_um.end());
  const auto [lowest, highest] = std::ranges::minmax(height_um);
  const std::vector<BallPoint> ball =
      ball_of(radius_um, cell_um, static_cast<double>(highest) - static_cast<double>(lowest), side);
  if (ball.size() <= 1) {
    return closed;
  }
  // Where the ball's lowest point is when it rests on the profile; then how far down it reaches from there.
  std::vector<float> resting(height_um.size());
  sweep(height_um, resting, side, ball, -1.0F, [](float a, float b) { return std::max(a, b); });
  sweep(resting, closed, side, ball, +1.0F, [](float a, float b) { return std::min(a, b); });
  for (std::size_t i = 0; i < closed.size(); ++i) {
    closed[i] = std::max(closed[i], height_um[i]);
  }
  return closed;
}

}  // namespace scatter::corrosion
