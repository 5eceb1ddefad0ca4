// Tilt of the sample from the places of its specular lobes under all source heads.
#pragma once

#include <optional>
#include <vector>

#include "host_sdk/measurement/process.h"
#include "host_sdk/reflectance/direction.h"

namespace scatter::measurement {

/// Values of one head on grid nodes, colours averaged.
struct HeadSamples {
  reflectance::Direction omega_i;               ///< Instrument frame.
  std::vector<reflectance::Direction> omega_o;  ///< Instrument frame.
  std::vector<double> f_per_sr;                 ///< As calibrated for an untilted sample.
  std::vector<double> sigma_per_sr;             ///< Standard uncertainty, random.
};

struct TiltFit {
  Tilt tilt;
  double alpha = 0;  ///< Roughness of the fitted lobe.
  double lobe_residual =
      0;  ///< Weighted rms misfit relative to the model within 15 deg of the mirror directions.
  double reduced_chi_square = 0;
};

/// Joint fit over all heads of one GGX lobe shape (roughness, Fresnel f0) with free diffuse part and
/// free lobe height per head, and two tilt components. The places of the peaks alone would mislead:
/// the raw peak of f lies up to 1.3 deg off the mirror direction on a level sample; the model knows.
/// A tilted sample also receives cos(theta_i') instead of cos(theta_i).
///
/// Result    tilt.told is false when the lobe is not significant or a component's standard error
///           (scaled by the misfit) exceeds 0.05 deg; nullopt when there are too few samples.
/// Source    GGX: Walter 2007 eq. 33-34; linear parts eliminated after Golub and Pereyra 1973.
/// Cost      about 10 ms for 4 x 900 samples.
[[nodiscard]] std::optional<TiltFit> fit_tilt(const std::vector<HeadSamples>& heads);

}  // namespace scatter::measurement
