// Which ways of interpolating suit a material: chosen by predicting incidences from the others.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/guided_data.h"
#include "host_sdk/reflectance/estimators/guided_predictor.h"

namespace scatter::reflectance {

/// Regions of outgoing directions with weights of their own: rings about the mirror direction, each
/// in an upper and a grazing half. Values between the centres of regions are blended.
class GuidedRegions {
 public:
  static constexpr std::size_t kRings = 6;
  static constexpr std::size_t kCount = 2 * kRings;

  /// Share of every region at a direction (light's frame); at most four are not 0, sum 1.
  struct Shares {
    std::array<std::size_t, 4> region{};
    std::array<float, 4> share{};
  };
  explicit GuidedRegions(double theta_i) noexcept;
  [[nodiscard]] Shares at(const Direction& local_o) const noexcept;
  /// The one with the largest share.
  [[nodiscard]] std::size_t nearest(const Direction& local_o) const noexcept;

 private:
  double sin_i_;
  double cos_i_;
};

/// One way in the mixture.
struct GuidedMember {
  std::string name;   ///< "oren-nayar+ggx half-vector log-linear"; without a model "specular linear".
  double weight = 0;  ///< Mean share over the directions that were predicted.
  /// Mean error of the held-back incidences (see GuidedMixture::error); nothing without cross-validation.
  std::optional<double> error;
};

/// Result of the selection: predictor and weights for all stored incidences, with its report.
struct GuidedMixture {
  std::vector<GuidedMember> members;  ///< As predictor's candidates.
  std::vector<Guide> guides;
  std::vector<GuidedCandidate> candidates;
  /// [region * candidates.size() + candidate], sum 1 over candidates.
  std::vector<float> weight;
  /// Incidences that were held back [rad], and what the mixture made of them: the mean of half the
  /// relative error and half the absolute log error, each value's at most 1; by solid angle.
  std::vector<double> held_back;
  std::vector<double> held_back_error;
  std::optional<double> error;           ///< Mean over the incidences held back.
  std::optional<double> specular_error;  ///< The same of plain specular-linear interpolation.
  std::array<double, GuidedRegions::kCount> region_rms{};  ///< Root mean square of the log error.
};

/// Fits the model families to the data, predicts each inner incidence from the others by every
/// candidate, and mixes the best by their errors, region by region.
///
/// Deterministic. Without an incidence that can be held back, the models' own fit decides.
/// Errors  kFailedPrecondition: fewer than two incidences.
/// Cost    about 1 s for 4 x 76 x 360 x 3 values; most of it are fits, run on all cores.
[[nodiscard]] Result<GuidedMixture> select_guided(const GuidedData& data);

/// exp of the weighted mean of ln f.
/// Shape   log_f as GuidedPredictor::predict gives it; f_per_sr[k * channels + c].
void mix(const GuidedMixture& mixture, double theta_i, std::span<const Direction> local_o,
         std::span<const float> log_f, std::size_t channels, std::span<double> f_per_sr) noexcept;

}  // namespace scatter::reflectance
