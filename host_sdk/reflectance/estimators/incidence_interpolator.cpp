#include "host_sdk/reflectance/estimators/incidence_interpolator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "host_sdk/reflectance/estimators/incidence_map.h"
#include "host_sdk/reflectance/estimators/scratch.h"

namespace scatter::reflectance {
namespace {

/// Height of a direction on the horizon: models have no value at 0.
constexpr double kGrazing = 1e-9;

struct Knot {
  double x = 0;
  double y = 0;
};

/// Centripetal Catmull-Rom spline through four points, at x between p[1].x and p[2].x.
class Spline {
 public:
  explicit Spline(const std::array<Knot, 4>& p) noexcept {
    std::array<double, 3> step{};
    for (std::size_t k = 0; k < 3; ++k) {
      // A doubled end point gives a step of 0; the tangent there then vanishes.
      step[k] = std::max(std::sqrt(std::hypot(p[k + 1].x - p[k].x, p[k + 1].y - p[k].y)),
                         std::numeric_limits<double>::epsilon());
    }
    x_ = cubic(p[0].x, p[1].x, p[2].x, p[3].x, step);
    y_ = cubic(p[0].y, p[1].y, p[2].y, p[3].y, step);
  }

  [[nodiscard]] double at(double x) const noexcept {
    // x(t) rises from p[1].x to p[2].x; bisection needs no more than the bits of a double.
    double low = 0;
    double high = 1;
    for (int k = 0; k < 60; ++k) {
      const double middle = (low + high) / 2;
      (value(x_, middle) < x ? low : high) = middle;
    }
    return value(y_, (low + high) / 2);
  }

 private:
  using Cubic = std::array<double, 4>;

  static Cubic cubic(double p0, double p1, double p2, double p3, const std::array<double, 3>& s) noexcept {
    const double slope1 = s[1] * ((p1 - p0) / s[0] - (p2 - p0) / (s[0] + s[1]) + (p2 - p1) / s[1]);
    const double slope2 = s[1] * ((p2 - p1) / s[1] - (p3 - p1) / (s[1] + s[2]) + (p3 - p2) / s[2]);
    return {p1, slope1, 3 * (p2 - p1) - 2 * slope1 - slope2, 2 * (p1 - p2) + slope1 + slope2};
  }
  static double value(const Cubic& c, double t) noexcept { return c[0] + t * (c[1] + t * (c[2] + t * c[3])); }

  Cubic x_{};
  Cubic y_{};
};

}  // namespace

/// The asked incidence among the stored ones.
struct IncidenceInterpolator::Frame {
  double theta_i = 0;
  double cos_i = 1;  ///< Azimuth of the light as asked.
  double sin_i = 0;
  double cos_data = 1;  ///< Azimuth at which the inner link is asked.
  double sin_data = 0;
  std::size_t below = 0;
  std::size_t above = 0;  ///< == below at a stored incidence.
  double share = 0;       ///< Of the upper one.
};

std::string_view name(IncidenceMode mode) noexcept {
  switch (mode) {
    case IncidenceMode::kPlain:
      return "plain";
    case IncidenceMode::kSpecular:
      return "specular";
    case IncidenceMode::kSpecularSpline:
      return "specular-spline";
    case IncidenceMode::kSpecularSplineZero:
      return "specular-spline-zero";
    case IncidenceMode::kDistorted:
      return "distorted";
  }
  return "unknown";
}

Result<std::shared_ptr<const IncidenceInterpolator>> IncidenceInterpolator::make(
    std::shared_ptr<const Brdf> inner, IncidenceMode mode, const Extent& extent) {
  const std::vector<double>& theta_i = extent.theta_i;
  if (theta_i.size() < 2) {
    return fail(
        ErrorCode::kFailedPrecondition,
        fmt::format("{}: the data has {} incidences, expected at least 2", name(mode), theta_i.size()),
        "leave the interpolation between incidences out, or measure more incidences");
  }
  for (std::size_t k = 0; k < theta_i.size(); ++k) {
    if (!(theta_i[k] >= 0 && theta_i[k] < kPi / 2) ||
        (k > 0 && !(theta_i[k] - theta_i[k - 1] > kSameAngle))) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: incidence {} is {} deg, expected ascending angles in 0..90", name(mode), k,
                              degrees(theta_i[k])),
                  "give the incidences in ascending order");
    }
  }
  return std::shared_ptr<const IncidenceInterpolator>(
      new IncidenceInterpolator(std::move(inner), mode, extent));
}

Result<std::shared_ptr<const IncidenceInterpolator>> IncidenceInterpolator::make(
    std::shared_ptr<const Brdf> inner, IncidenceMode mode) {
  const Extent extent = extent_of(*inner);
  return make(std::move(inner), mode, extent);
}

IncidenceInterpolator::IncidenceInterpolator(std::shared_ptr<const Brdf> inner, IncidenceMode mode,
                                             const Extent& extent)
    : Estimator(std::move(inner),
                {.theta_i_from = extent.theta_i.front(), .theta_i_to = extent.theta_i.back()}),
      mode_(mode),
      theta_i_(extent.theta_i),
      azimuth_(extent.azimuth) {}

IncidenceInterpolator::Frame IncidenceInterpolator::frame_of(const Direction& omega_i) const noexcept {
  Frame frame;
  const double sin_theta = std::hypot(omega_i.x, omega_i.y);
  frame.theta_i = std::atan2(sin_theta, omega_i.z);
  if (azimuth_) {
    frame.cos_data = std::cos(*azimuth_);
    frame.sin_data = std::sin(*azimuth_);
  }
  // Light along the normal has no azimuth: the data's own is taken, as the grids do.
  const bool normal = sin_theta < kSameAngle;
  frame.cos_i = normal ? frame.cos_data : omega_i.x / sin_theta;
  frame.sin_i = normal ? frame.sin_data : omega_i.y / sin_theta;
  if (!azimuth_) {
    frame.cos_data = frame.cos_i;
    frame.sin_data = frame.sin_i;
  }
  const auto above = std::ranges::lower_bound(theta_i_, frame.theta_i - kSameAngle);
  frame.above = std::min(static_cast<std::size_t>(above - theta_i_.begin()), theta_i_.size() - 1);
  frame.below = frame.above;
  if (frame.above > 0 && theta_i_[frame.above] > frame.theta_i + kSameAngle) {
    frame.below = frame.above - 1;
    frame.share = (frame.theta_i - theta_i_[frame.below]) / (theta_i_[frame.above] - theta_i_[frame.below]);
  }
  return frame;
}

/// Takes outgoing directions of the asked incidence to those of a stored one.
class IncidenceInterpolator::Counterpart {
 public:
  Counterpart(const IncidenceInterpolator& link, const Frame& frame, double theta) noexcept
      : frame_(frame),
        mode_(link.mode_),
        side_(link.type() == ScatterType::kBrdf ? 1 : -1),
        turn_(frame.theta_i, theta),
        distort_(frame.theta_i, theta),
        incident_{std::sin(theta) * frame.cos_data, std::sin(theta) * frame.sin_data, std::cos(theta)} {}

  [[nodiscard]] const Direction& incident() const noexcept { return incident_; }

  /// beyond: the direction came to lie below the horizon and was lifted onto it.
  [[nodiscard]] Direction operator()(const Direction& o, bool& beyond) const noexcept {
    Direction w{o.x * frame_.cos_i + o.y * frame_.sin_i, o.y * frame_.cos_i - o.x * frame_.sin_i,
                side_ * o.z};
    beyond = false;
    if (mode_ == IncidenceMode::kDistorted) {
      w = distort_(w);
    } else if (mode_ != IncidenceMode::kPlain) {
      w = turn_(w);
      if (w.z < 0) {
        beyond = w.z < -kSameAngle;
        const double level = std::hypot(w.x, w.y);
        w = level > 0 ? Direction{w.x / level, w.y / level, kGrazing} : Direction{-1, 0, kGrazing};
      }
    }
    return {w.x * frame_.cos_data - w.y * frame_.sin_data, w.x * frame_.sin_data + w.y * frame_.cos_data,
            side_ * w.z};
  }

 private:
  const Frame& frame_;
  IncidenceMode mode_;
  double side_;
  SpecularTurn turn_;
  DistortedMap distort_;
  Direction incident_;
};

void IncidenceInterpolator::values_at(const Frame& frame, std::size_t incidence, BelowHorizon below_horizon,
                                      std::span<const Direction> omega_o, std::span<double> f_per_sr,
                                      std::span<Origin> origin) const noexcept {
  Scratch scratch;
  const std::span<Direction> asked = scratch.take<Direction>(omega_o.size());
  const std::span<bool> beyond = scratch.take<bool>(omega_o.size());
  const Counterpart counterpart(*this, frame, theta_i_[incidence]);
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    asked[k] = counterpart(omega_o[k], beyond[k]);
  }
  inner().eval_batch(counterpart.incident(), asked, f_per_sr, origin);
  const std::size_t n = channels();
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    if (!beyond[k]) {
      continue;
    }
    if (below_horizon == BelowHorizon::kHeld) {
      origin[k] = combined(origin[k], Origin::kExtrapolated);
    } else {
      origin[k] = below_horizon == BelowHorizon::kMissing ? Origin::kInvalid : Origin::kExtrapolated;
      std::ranges::fill(f_per_sr.subspan(k * n, n), 0.0);
    }
  }
}

void IncidenceInterpolator::estimate(const Direction& omega_i, std::span<const Direction> omega_o,
                                     std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const Frame frame = frame_of(omega_i);
  if (frame.above == frame.below) {
    // Turned by nothing, so that a stored incidence comes back to the bit.
    Frame stored = frame;
    stored.theta_i = theta_i_[frame.below];
    values_at(stored, frame.below, BelowHorizon::kHeld, omega_o, f_per_sr, origin);
    return;
  }
  if (mode_ == IncidenceMode::kSpecularSpline || mode_ == IncidenceMode::kSpecularSplineZero) {
    join_by_spline(frame, omega_o, f_per_sr, origin);
    return;
  }
  const std::size_t n = channels();
  Scratch scratch;
  const std::span<double> upper = scratch.take<double>(omega_o.size() * n);
  const std::span<Origin> upper_origin = scratch.take<Origin>(omega_o.size());
  values_at(frame, frame.below, BelowHorizon::kHeld, omega_o, f_per_sr, origin);
  values_at(frame, frame.above, BelowHorizon::kHeld, omega_o, upper, upper_origin);
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    origin[k] = combined(Origin::kInterpolated, combined(origin[k], upper_origin[k]));
    const double low = origin[k] == Origin::kInvalid ? 0 : 1 - frame.share;
    const double high = origin[k] == Origin::kInvalid ? 0 : frame.share;
    for (std::size_t c = 0; c < n; ++c) {
      f_per_sr[k * n + c] = low * f_per_sr[k * n + c] + high * upper[k * n + c];
    }
  }
}

void IncidenceInterpolator::join_by_spline(const Frame& frame, std::span<const Direction> omega_o,
                                           std::span<double> f_per_sr,
                                           std::span<Origin> origin) const noexcept {
  const std::size_t n = channels();
  const std::size_t count = omega_o.size();
  const std::array<std::size_t, 4> incidence{frame.below == 0 ? 0 : frame.below - 1, frame.below, frame.above,
                                             std::min(frame.above + 1, theta_i_.size() - 1)};
  const BelowHorizon outer =
      mode_ == IncidenceMode::kSpecularSplineZero ? BelowHorizon::kZero : BelowHorizon::kMissing;
  Scratch scratch;
  std::array<std::span<double>, 4> f;
  std::array<std::span<Origin>, 4> from;
  for (std::size_t p = 0; p < 4; ++p) {
    f[p] = scratch.take<double>(count * n);
    from[p] = scratch.take<Origin>(count);
    values_at(frame, incidence[p], p == 1 || p == 2 ? BelowHorizon::kHeld : outer, omega_o, f[p], from[p]);
  }
  for (std::size_t k = 0; k < count; ++k) {
    origin[k] = combined(Origin::kInterpolated, combined(from[1][k], from[2][k]));
    // An outer incidence without a value counts as the end of the data.
    const std::size_t first = from[0][k] == Origin::kInvalid ? 1 : 0;
    const std::size_t last = from[3][k] == Origin::kInvalid ? 2 : 3;
    for (std::size_t c = 0; c < n; ++c) {
      if (origin[k] == Origin::kInvalid) {
        f_per_sr[k * n + c] = 0;
        continue;
      }
      std::array<Knot, 4> knots{};
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t p = 0; p < 4; ++p) {
        const std::size_t q = std::clamp(p, first, last);
        knots[p] = {theta_i_[incidence[q]], f[q][k * n + c]};
        least = std::min(least, knots[p].y);
      }
      const double y = Spline(knots).at(frame.theta_i);
      f_per_sr[k * n + c] = least >= 0 ? std::max(y, 0.0) : y;
    }
  }
}

bool IncidenceInterpolator::estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                                 std::span<double> random_per_sr,
                                                 std::span<double> systematic_per_sr) const noexcept {
  Frame frame = frame_of(omega_i);
  bool beyond = false;
  if (frame.above == frame.below) {
    frame.theta_i = theta_i_[frame.below];
    const Counterpart stored(*this, frame, frame.theta_i);
    return inner().uncertainty(stored.incident(), stored(omega_o, beyond), random_per_sr, systematic_per_sr);
  }
  const Counterpart below(*this, frame, theta_i_[frame.below]);
  const Counterpart above(*this, frame, theta_i_[frame.above]);
  Scratch scratch;
  const std::span<double> random = scratch.take<double>(2 * channels());
  const std::span<double> systematic = scratch.take<double>(2 * channels());
  const std::size_t n = channels();
  if (!inner().uncertainty(below.incident(), below(omega_o, beyond), random.first(n), systematic.first(n)) ||
      !inner().uncertainty(above.incident(), above(omega_o, beyond), random.last(n), systematic.last(n))) {
    return false;
  }
  const double low = 1 - frame.share;
  const double high = frame.share;
  for (std::size_t c = 0; c < n; ++c) {
    random_per_sr[c] = std::hypot(low * random[c], high * random[n + c]);
    systematic_per_sr[c] = low * systematic[c] + high * systematic[n + c];
  }
  return true;
}

}  // namespace scatter::reflectance
