// BRDF in the adaptive parameterization: half vectors warped by the surface's own distribution of
// visible normals. What the RGL database, Mitsuba 3 and pbrt-v4 call a measured material.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/bilinear_warp.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// f(omega_i, omega_o) cos(theta_o) = spectra(s) ndf(m) / (4 sigma(omega_i)), with m the half vector
/// and s the uniform point that the distribution of normals visible from omega_i warps to m.
///
/// Directions become points of the unit square by x = sqrt(theta / (pi/2)), y = (phi + pi) / (2 pi);
/// an isotropic material counts the azimuth of m from that of omega_i. Between incidences the
/// densities and the spectra are linear in phi_i and theta_i; outside them the nearest counts.
/// Source  Dupuy and Jakob 2018, "An adaptive parameterization for efficient material acquisition
///         and rendering"; that the tables include cos(theta_o) is how Mitsuba 3 and pbrt-v4
///         read them.
class AdaptiveBrdf final : public Brdf {
 public:
  struct Content {
    /// [rad], strictly ascending. At most 2: isotropic. More: they cover 2 pi, or from -pi one half
    /// or one quarter of it, and the rest follows by symmetry (half turn; mirroring in x and y).
    std::vector<float> phi_i;
    std::vector<float> theta_i;         ///< [rad], strictly ascending, 0..pi/2.
    std::vector<float> wavelengths_nm;  ///< One per channel; empty: red, green and blue (BT.709, linear).
    std::size_t channels = 3;
    BilinearTables ndf;        ///< One table: density of normals D [1/sr].
    BilinearTables sigma;      ///< One table: projected area of the microfacets [1], 1 at theta 0.
    BilinearTables vndf;       ///< [phi_i][theta_i]: density of visible normals, any scale.
    BilinearTables luminance;  ///< [phi_i][theta_i]: share of samples, any scale.
    BilinearTables spectra;    ///< [phi_i][theta_i][channel]: sizes as luminance.
    /// False: spectra hold f cos(theta_o) itself, without the factor ndf / (4 sigma).
    bool jacobian = true;
    /// One per node of luminance: 1 measured, 0 made up; empty: all measured.
    std::vector<std::uint8_t> valid;
    std::map<std::string, std::string> metadata;
  };

  /// Errors  kInvalidArgument naming the table or axis that is wrong: sizes, values that are not
  ///         finite, negative densities, azimuths of another symmetry.
  [[nodiscard]] static Result<AdaptiveBrdf> make(Content content);

  [[nodiscard]] const Content& content() const noexcept { return content_; }
  [[nodiscard]] const BilinearTables& vndf() const noexcept { return vndf_.tables(); }
  [[nodiscard]] bool isotropic() const noexcept { return content_.phi_i.size() <= 2; }
  /// 1: azimuths cover all of 2 pi; 2, 4: a half, a quarter of it.
  [[nodiscard]] int azimuth_reduction() const noexcept { return reduction_; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return content_.channels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return content_.wavelengths_nm;
  }
  /// [azimuth * incidences + incidence]; one azimuth where the material is isotropic.
  [[nodiscard]] std::vector<Direction> own_incidences() const override;
  /// kMeasured at an incidence of the tables, kInterpolated between them; kExtrapolated where a
  /// node in use is not valid or theta_i lies outside. Values below 0 (colours outside the
  /// primaries' gamut) give 0. kInvalid below the horizon and within 1e-6 rad of it, where the cosine that
  /// the tables hold leaves nothing of f.
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept override;

  /// Probability per solid angle [1/sr] with which `sample` gives omega_o.
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept;
  /// Direction for a uniform point of the square, distributed as the luminance of f cos(theta_o).
  /// Its z is not positive when the sample is lost below the horizon.
  [[nodiscard]] Direction sample(const Direction& omega_i, const SquarePoint& uniform) const noexcept;

 private:
  /// All that depends on omega_i alone.
  struct Incidence {
    Direction omega_i;
    double mirror_x = 1;  ///< Signs that take omega_i into the azimuths of the tables.
    double mirror_y = 1;
    double phi_i = 0;
    double sigma = 0;
    TableMix mix;
    Origin origin = Origin::kMeasured;
  };
  AdaptiveBrdf(Content content, BilinearWarp vndf, BilinearWarp luminance);
  [[nodiscard]] Incidence incidence(const Direction& omega_i) const noexcept;
  [[nodiscard]] SquarePoint square_point(const Incidence& incidence, const Direction& m) const noexcept;
  [[nodiscard]] Origin eval_at(const Incidence& incidence, const Direction& omega_o,
                               double* f_per_sr) const noexcept;

  Content content_;  ///< Without vndf, which its warp holds.
  BilinearWarp vndf_;
  BilinearWarp luminance_;
  int reduction_ = 1;
};

}  // namespace scatter::reflectance
