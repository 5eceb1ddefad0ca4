// What lies under the simulated instrument: a surface and what is wrong with it.
#pragma once

#include <cstddef>
#include <memory>
#include <string_view>
#include <utility>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::simulator {

/// The part of the sample that one source head lights: an ellipse, longer by 1/cos(theta_i) in the
/// plane of incidence.
struct Footprint {
  double diameter_mm = 3.0;        ///< Across the plane of incidence.
  reflectance::Direction omega_i;  ///< Towards the source, sample's frame, z > 0 on the lit side.
};

/// A surface whose scattering may depend on which part of it is lit.
/// Threads   const functions may be called from any number of threads.
class Surface {
 public:
  virtual ~Surface() = default;
  /// Scattering averaged over the footprint. Never null, 1..kMaxChannels channels. For kBtdf the light comes
  /// from below.
  [[nodiscard]] virtual std::shared_ptr<const reflectance::Brdf> lit(const Footprint& footprint) const = 0;
  [[nodiscard]] virtual reflectance::ScatterType type() const noexcept = 0;
};

/// The same everywhere.
class UniformSurface final : public Surface {
 public:
  explicit UniformSurface(std::shared_ptr<const reflectance::Brdf> brdf) : brdf_(std::move(brdf)) {}
  [[nodiscard]] std::shared_ptr<const reflectance::Brdf> lit(const Footprint& footprint) const override {
    (void)footprint;
    return brdf_;
  }
  [[nodiscard]] reflectance::ScatterType type() const noexcept override { return brdf_->type(); }

 private:
  std::shared_ptr<const reflectance::Brdf> brdf_;
};

/// What makes a measurement go wrong. All zero: a flat, opaque, firm sample, well placed.
struct Defects {
  double tilt_rad = 0;          ///< Of the normal, 0..10 deg.
  double tilt_azimuth_rad = 0;  ///< Towards which azimuth it leans.
  double translucent = 0;       ///< Ambient light let in, as a share of what a perfect white returns, 0..1.
  double uneven_rad = 0;        ///< Standard deviation of the facets' slope along x and along y, 0..10 deg.
  double soft = 0;              ///< Share of the signal lost as the sample sinks, 0..1.
};

/// Most channels that a surface may have.
inline constexpr std::size_t kMaxChannels = 192;

/// Surface and defects.
class Sample {
 public:
  Sample(std::shared_ptr<const Surface> surface, Defects defects)
      : surface_(std::move(surface)), defects_(defects) {}

  /// Sample from text: a model ("ggx:alpha=0.2,f0=0.04,albedo=0.3", see reflectance/models/model_spec.h)
  /// or "file:PATH" (any readable BRDF), then any of
  ///   +tilt=DEG@AZIMUTH_DEG  +translucent=SHARE  +uneven=DEG  +soft=SHARE
  /// The '+' inside a path is part of the path unless one of these names and '=' follow it.
  /// Errors    kInvalidArgument names the key and its range; those of formats::open_brdf.
  [[nodiscard]] static Result<std::shared_ptr<const Sample>> make(std::string_view spec);

  [[nodiscard]] const Surface& surface() const noexcept { return *surface_; }
  [[nodiscard]] const Defects& defects() const noexcept { return defects_; }
  /// Light goes through it: the camera sees it lit from below.
  [[nodiscard]] bool transmits() const noexcept {
    return surface_->type() == reflectance::ScatterType::kBtdf;
  }
  /// Share of the signal left, `seconds` after the sample was placed: 1 - soft (1 - exp(-t / 1 s)).
  [[nodiscard]] double signal_share(double seconds) const noexcept;

 private:
  std::shared_ptr<const Surface> surface_;
  Defects defects_;
};

}  // namespace scatter::simulator
