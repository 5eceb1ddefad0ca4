// BRDF on a grid about the specular direction: what optics software (Zemax) exchanges.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_lookup.h"

namespace scatter::reflectance {

/// Grid in (radial, azimuth) about the mirror direction (BRDF) or the straight one (BTDF).
///
/// radial 0 is that direction; azimuth 0 points from it towards the normal and grows
/// counter-clockwise. With the light at (sin a, 0, cos a) the offset (x, y, z) = (sin r cos p,
/// sin r sin p, cos r) is the direction (x cos a - z sin a, y, x sin a + z cos a).
/// Memory  besides the planes, values are kept as evaluation reads them, as in GridBrdf.
/// Source  formats.md 1.
class SpecularGridBrdf final : public Brdf {
 public:
  struct Content {
    ScatterType type = ScatterType::kBrdf;
    bool plane_symmetric = false;       ///< Azimuths cover 0..pi and are mirrored.
    std::vector<float> wavelengths_nm;  ///< One per channel; empty = unknown.
    /// All four ascend strictly [rad].
    std::vector<double> rotation;  ///< 0..2 pi; phi_i of the light on the sample.
    std::vector<double> theta_i;   ///< 0..pi/2, without pi/2.
    std::vector<double> azimuth;   ///< 0..pi or 0..2 pi.
    std::vector<double> radial;    ///< 0..pi.
    /// [channel][((rotation * incidences + incidence) * azimuths + azimuth) * radials + radial].
    std::vector<std::vector<float>> f_per_sr;
    /// Total standard uncertainty, as f_per_sr; empty when unknown.
    std::vector<std::vector<float>> sigma_per_sr;
    /// One per node, as one channel of f_per_sr; empty: measured above the horizon.
    std::vector<Origin> origin;
    /// Total scatter that the file states, [channel][rotation * incidences + incidence], 0..1;
    /// advisory, may be empty.
    std::vector<std::vector<double>> stated_total;
    std::map<std::string, std::string> metadata;
  };

  /// Errors  kInvalidArgument naming the axis or the size that is wrong.
  [[nodiscard]] static Result<SpecularGridBrdf> make(Content content);

  [[nodiscard]] const Content& content() const noexcept { return content_; }

  /// Integral of f cos(theta_o) over the grid's directions above the horizon.
  /// hold_last: the last radial value goes on to the horizon, instead of nothing.
  /// weigh_by_cosine false: integral of f alone, which tells cosine-weighted data from BRDF.
  [[nodiscard]] double integral(std::size_t channel, std::size_t rotation, std::size_t incidence,
                                bool hold_last = false, bool weigh_by_cosine = true) const;

  [[nodiscard]] ScatterType type() const noexcept override { return content_.type; }
  [[nodiscard]] std::size_t channels() const noexcept override { return content_.f_per_sr.size(); }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return content_.wavelengths_nm;
  }
  /// [rotation * incidences + incidence]
  [[nodiscard]] std::vector<Direction> own_incidences() const override;
  /// Bilinear in (radial, azimuth), kMeasured; linear between incidences (and rotations at most
  /// 90 deg apart) at the same radial and azimuth, kInterpolated; worse where a node in use is.
  /// kExtrapolated: nearest incidence or rotation outside, nearest radial outside, or a node in use lies
  /// below the horizon, where files hold invented numbers. kInvalid: omega_o on the wrong side. One rotation:
  /// the sample is taken as isotropic.
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  /// As GridBrdf's, in accuracy too.
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept override;
  void eval_pairs(std::span<const Direction> omega_i, std::span<const Direction> omega_o,
                  std::span<double> f_per_sr, std::span<Origin> origin) const noexcept override;
  /// All of sigma as systematic: a total does not average away.
  [[nodiscard]] bool uncertainty(const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept override;

 private:
  /// Neighbours on an axis and the share of the upper one.
  struct Bracket {
    std::size_t below = 0;
    std::size_t above = 0;
    double share = 0;
    bool outside = false;
  };
  explicit SpecularGridBrdf(Content content);
  [[nodiscard]] static Bracket bracket(std::span<const double> axis, double value, double same) noexcept;
  [[nodiscard]] static Bracket periodic(std::span<const double> axis, double value, double widest) noexcept;
  void build_lookup();
  [[nodiscard]] IncidenceShares shares_of(const Direction& omega_i) const noexcept;
  /// The slow way to what the lookup does. out stays untouched when the result is kInvalid.
  [[nodiscard]] Origin blend(const std::vector<std::vector<float>>& planes, const Direction& omega_i,
                             const Direction& omega_o, std::span<double> out) const noexcept;
  [[nodiscard]] Origin origin_of(std::size_t incidence, std::size_t azimuth, std::size_t radial,
                                 std::size_t node) const noexcept;
  [[nodiscard]] bool above_horizon(std::size_t incidence, std::size_t azimuth,
                                   std::size_t radial) const noexcept;

  Content content_;
  SpecularLookup lookup_;
  std::vector<double> cos_azimuth_, cos_radial_, sin_radial_, cos_i_, sin_i_;
};

}  // namespace scatter::reflectance
