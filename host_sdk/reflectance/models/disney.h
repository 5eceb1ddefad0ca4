// Burley's principled BRDF (Disney 2012).
#pragma once

#include "host_sdk/reflectance/models/lobe_model.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance {

/// All parameters of the 2012 course notes, 0..1; base_color is linear red, green, blue.
/// Implements `SampledBrdf`; reciprocal. Not bounded by 1: its lobes are tuned to look right, and
/// rough metals and sheen at grazing angles reflect more than comes in.
/// Source  Burley 2012, "Physically-based shading at Disney", and its reference code.
class Disney final : public LobeModel {
 public:
  struct Parameters {
    ChannelValues base_color{0.5, 0.5, 0.5};
    double metallic = 0;
    double subsurface = 0;
    double specular = 0.5;  ///< 0.5 is F0 = 0.04.
    double roughness = 0.5;
    double specular_tint = 0;
    double anisotropic = 0;  ///< Highlights stretched along x.
    double sheen = 0;
    double sheen_tint = 0.5;
    double clearcoat = 0;
    double clearcoat_gloss = 1;
  };
  /// Ranges are checked by make_model, not here.
  explicit Disney(const Parameters& parameters);

  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

 private:
  Parameters parameters_;
};

/// base_color at unit luminance (0.3 R + 0.6 G + 0.1 B, the reference code's weights); white for black.
[[nodiscard]] ChannelValues disney_tint(const ChannelValues& base_color) noexcept;

/// F0 of the primary lobe: dielectric, tinted or not, blended with base_color by metallic.
[[nodiscard]] ChannelValues disney_f0(const Disney::Parameters& parameters) noexcept;

}  // namespace scatter::reflectance
