// Predicts values at one incidence from those at others, in several ways at once.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/reflectance/estimators/guided_candidate.h"
#include "host_sdk/reflectance/estimators/guided_data.h"

namespace scatter::reflectance {

/// A model whose ratio to the measurement is interpolated.
struct Guide {
  std::string name;
  std::shared_ptr<const Brdf> model;  ///< nullptr: the constant 1.
};

/// ln f by each candidate, from the incidences named.
///
/// Quantity  natural logarithm of f in 1/sr; never below the floor of the data, so exp is positive.
/// Threads   all const functions from any thread.
class GuidedPredictor {
 public:
  /// data must outlive this. use: indices of incidences, ascending, at least two (one when the data
  /// are isotropic and it is not 0 deg).
  GuidedPredictor(const GuidedData& data, std::vector<std::size_t> use, std::vector<Guide> guides,
                  std::vector<GuidedCandidate> candidates);

  [[nodiscard]] const std::vector<GuidedCandidate>& candidates() const noexcept { return candidates_; }
  [[nodiscard]] const std::vector<Guide>& guides() const noexcept { return guides_; }

  /// Stored incidences next to an asked one.
  struct Neighbors {
    std::size_t below = 0;
    std::size_t above = 0;
    double share = 0;  ///< Of `above`.
  };
  [[nodiscard]] Neighbors neighbors(double theta_i) const noexcept;

  /// Shape  local_o in the light's frame (guided_data.h), all with z > 0;
  ///        log_f[(candidate * local_o.size() + k) * channels + c].
  /// Range  theta_i between the smallest (0 when isotropic) and largest incidence in use.
  void predict(double theta_i, std::span<const Direction> local_o, std::span<float> log_f) const noexcept;

 private:
  /// One incidence on the axis; theta < 0: that of the other side, turned.
  struct Knot {
    double theta = 0;
    std::size_t incidence = 0;
  };
  struct Tap {
    Knot knot;
    float linear = 0;  ///< Weight of linear interpolation.
    float cubic = 0;   ///< Weight of Lagrange interpolation.
  };
  struct Taps {
    std::array<Tap, 4> tap;
    std::size_t count = 0;
  };
  [[nodiscard]] Taps taps_at(double theta_i) const noexcept;
  [[nodiscard]] std::size_t first_above(double theta_i) const noexcept;

  const GuidedData* data_;
  std::vector<Guide> guides_;
  std::vector<GuidedCandidate> candidates_;
  std::vector<Knot> axis_;
  /// ln(f / model), [guide][incidence][node * channels + channel]; of incidences in use.
  std::vector<std::vector<std::vector<float>>> log_ratio_;
};

/// ln of the model at many directions of one incidence, not below what a double can divide by.
/// Shape  out[k * channels + c]; the guide's channels, or any number when it has no model.
void log_model(const Guide& guide, double theta_i, std::span<const Direction> local_o,
               std::span<float> out) noexcept;

}  // namespace scatter::reflectance
