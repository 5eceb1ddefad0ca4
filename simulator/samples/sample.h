// What lies under the simulated instrument: a surface and what is wrong with it.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::simulator {

/// The part of the sample that one source head lights: an ellipse, longer by 1/cos(theta_i) in the
/// plane of incidence.
struct Footprint {
  double diameter_mm = 3.0;        ///< Across the plane of incidence.
  reflectance::Direction omega_i;  ///< Towards the source, sample's frame, z > 0 on the lit side.
};

/// A place on a surface as shares of its extent: u to the right from the left edge, v down from the top.
struct Place {
  double u = 0.5;
  double v = 0.5;
};

/// A surface whose scattering may depend on which part of it is lit.
/// Threads   const functions may be called from any number of threads.
class Surface {
 public:
  virtual ~Surface() = default;
  /// Scattering averaged over the footprint. Never null, 1..kMaxChannels channels. For kBtdf the light comes
  /// from below.
  [[nodiscard]] virtual std::shared_ptr<const reflectance::Brdf> lit(const Footprint& footprint) const = 0;
  /// The same as summands, when narrow lobes stand on broad ones: averaging over source and pixel is then
  /// quicker one by one.
  struct Summand {
    std::shared_ptr<const reflectance::Brdf> brdf;
    bool broad = false;  ///< Changes little within a few degrees.
  };
  [[nodiscard]] virtual std::vector<Summand> lit_apart(const Footprint& footprint) const {
    return {{lit(footprint)}};
  }
  [[nodiscard]] virtual reflectance::ScatterType type() const noexcept = 0;
  /// Where the middle of the light is; nothing for what is the same everywhere.
  [[nodiscard]] virtual std::optional<Place> place() const noexcept { return std::nullopt; }
  /// The same surface lit at another place; null for what is the same everywhere. Cost: next to nothing.
  [[nodiscard]] virtual std::shared_ptr<const Surface> moved(const Place& place) const {
    (void)place;
    return nullptr;
  }
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
  /// spec: the text that would make this sample's surface; empty when there is none.
  Sample(std::shared_ptr<const Surface> surface, Defects defects, std::string spec = {})
      : surface_(std::move(surface)), defects_(defects), spec_(std::move(spec)) {}

  /// Sample from text: a model ("ggx:alpha=0.2,f0=0.04,albedo=0.3", see reflectance/models/model_spec.h)
  /// or "file:PATH" (any readable BRDF) or corroded metal ("corroded:age=25,...", "patina:...", see
  /// textured_spec.h), then any of
  ///   +tilt=DEG@AZIMUTH_DEG  +translucent=SHARE  +uneven=DEG  +soft=SHARE
  /// The '+' inside a path is part of the path unless one of these names and '=' follow it.
  /// Errors    kInvalidArgument names the key and its range; those of formats::open_brdf.
  [[nodiscard]] static Result<std::shared_ptr<const Sample>> make(std::string_view spec);

  [[nodiscard]] const Surface& surface() const noexcept { return *surface_; }
  [[nodiscard]] const std::shared_ptr<const Surface>& shared_surface() const noexcept { return surface_; }
  /// Text of the surface without defects; a place in it is this sample's.
  [[nodiscard]] const std::string& surface_spec() const noexcept { return spec_; }
  /// The same sample with another place under the instrument, rounded to 1e-6 so that its text says exactly
  /// where; null for surfaces that are the same everywhere.
  [[nodiscard]] std::shared_ptr<const Sample> moved(const Place& place) const;
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
  std::string spec_;
};

}  // namespace scatter::simulator
