// A sample as the instrument sees it: tilted, uneven, lit from one place.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "simulator/samples/sample.h"

namespace scatter::simulator {

inline constexpr std::size_t kColours = 3;
/// Peak wavelengths of the instrument's LEDs [nm]: red, green, blue.
inline constexpr std::array<float, kColours> kColourWavelengthsNm{630.0F, 525.0F, 465.0F};

/// Sample under one source head. Directions are in the instrument's frame: z towards the camera,
/// sources above (z > 0) or, for samples that transmit, below it.
///
/// For BTDF the sample's directions are the instrument's with z turned round, so that the light
/// comes from z > 0 and leaves to z < 0 while x, y and azimuths stay what they are.
/// Threads   const functions may be called from any number of threads.
class Aspect {
 public:
  /// `towards_source` is the middle of the head.
  Aspect(const Sample& sample, double spot_diameter_mm, const reflectance::Direction& towards_source);
  /// One per summand of the surface (Surface::lit_apart): their radiances add up to the sample's.
  [[nodiscard]] static std::vector<Aspect> summands(const Sample& sample, double spot_diameter_mm,
                                                    const reflectance::Direction& towards_source);

  /// Changes so slowly with direction, and costs so much, that the share of source disc and pixel need only
  /// be known to second order: uneven samples, and broad summands.
  [[nodiscard]] bool broad() const noexcept { return broad_ || facets_.size() > 1; }
  /// False: nothing reaches the camera from a source on that side.
  [[nodiscard]] bool lit() const noexcept { return lit_; }

  /// Radiance towards the camera for collimated light from `towards_source`.
  /// Quantity  L_o / E_perp = f cos(theta_i) [1/sr], E_perp being the irradiance across the beam;
  ///           averaged over the facets of an uneven sample with their visible areas. No Dirac part.
  /// Shape     out[k * kColours + colour]; out.size() == towards_camera.size() * kColours.
  /// Range     towards_camera.size() <= kBatch.
  void radiance(const reflectance::Direction& towards_source,
                std::span<const reflectance::Direction> towards_camera, std::span<double> out) const noexcept;
  static constexpr std::size_t kBatch = 64;

  /// Where a mirror (or, from below, a clear film) in the sample's place sends the head's middle.
  [[nodiscard]] reflectance::Direction straight() const noexcept;

  /// What goes on in exactly one direction.
  struct Regular {
    reflectance::Direction towards;         ///< Where the light from the head's middle goes.
    std::array<double, kColours> weight{};  ///< Share of the power [1].
  };
  /// False: there is no such part. Unevenness does not spread it.
  [[nodiscard]] bool regular(Regular& part) const noexcept;

 private:
  /// A facet's frame: rows are its x, y and normal in the instrument's frame.
  struct Facet {
    std::array<reflectance::Direction, 3> axes;
    double weight = 1;  ///< Share of the facets, divided by the facet's own foreshortening.
  };
  Aspect(const Sample& sample, const reflectance::Direction& towards_source, Surface::Summand lit);
  /// The footprint of a head on a sample that may be tilted.
  [[nodiscard]] static Footprint footprint(const Sample& sample, double spot_diameter_mm,
                                           const reflectance::Direction& towards_source);

  std::shared_ptr<const reflectance::Brdf> brdf_;
  std::vector<Facet> facets_;
  reflectance::Direction normal_;
  reflectance::Direction source_;
  std::array<std::size_t, kColours> channel_{};
  bool below_ = false;
  bool lit_ = false;
  bool broad_ = false;
};

}  // namespace scatter::simulator
