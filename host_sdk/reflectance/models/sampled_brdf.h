// A scattering function from which directions can be drawn: what renderers and photon tracers need.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// Independent uniform numbers in [0, 1): two for the direction, one for the choice of lobe.
using SampleInput = std::array<double, 3>;

/// One drawn direction.
struct DrawnDirection {
  Direction omega_o;
  /// Density at omega_o [1/sr], of the whole model; for a Dirac component its probability [1].
  double density = 0;
  bool is_dirac = false;
};

/// `Brdf` with an importance sampler. The analytic models implement it.
///
/// Some samplers draw directions on the wrong side of the surface (their tails do not end at the
/// horizon). Such draws have throughput 0: they are lost, not drawn again, so that the mean
/// throughput over draws is the albedo. `pdf` is the density over the whole sphere, lost draws
/// included, and integrates there to 1 minus the probability of the Dirac component.
///
/// Threads   all functions may be called from any number of threads; draws depend on their input only.
class SampledBrdf : public Brdf {
 public:
  /// Draws omega_o for light from omega_i.
  /// Quantity  throughput [1], per channel: f |cos theta_o| / density; for a Dirac component its
  ///           share of the power / density. Its mean over draws is the albedo (with Dirac).
  /// Shape     throughput.size() == channels().
  /// Errors    none: omega_i.z <= 0, or a model that scatters nothing, gives density 0 and throughput 0.
  [[nodiscard]] virtual DrawnDirection sample(const Direction& omega_i, const SampleInput& u,
                                              std::span<double> throughput) const noexcept = 0;

  /// Density with which `sample` draws omega_o [1/sr], any unit vector; Dirac component excluded.
  [[nodiscard]] virtual double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept = 0;

  /// `sample` of many inputs. Shape: drawn.size() == u.size(), throughput[k * channels() + c].
  virtual void sample_batch(const Direction& omega_i, std::span<const SampleInput> u,
                            std::span<DrawnDirection> drawn, std::span<double> throughput) const noexcept;

  /// `pdf` of many directions. Shape: density.size() == omega_o.size().
  virtual void pdf_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                         std::span<double> density) const noexcept;
};

}  // namespace scatter::reflectance
