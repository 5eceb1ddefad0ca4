// The one interface behind which analytic models, gridded and scattered measurements stand.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/reflectance/direction.h"

namespace scatter::reflectance {

/// Where a value comes from. Numbers are those of the EXR `origin` channel and are frozen.
enum class Origin : std::uint8_t { kInvalid = 0, kMeasured = 1, kInterpolated = 2, kExtrapolated = 3 };

/// Origin of a value made from two: the less trustworthy one.
[[nodiscard]] constexpr Origin combined(Origin a, Origin b) noexcept {
  if (a == Origin::kInvalid || b == Origin::kInvalid) {
    return Origin::kInvalid;
  }
  return a > b ? a : b;
}

/// Which side scattered light is on. For BTDF the outgoing direction has z < 0.
enum class ScatterType : std::uint8_t { kBrdf = 0, kBtdf = 1 };

/// Scattering distribution f(omega_i, omega_o) of a surface.
///
/// Quantity  f = dL_o / dE_i [1/sr]; the cosine is NOT included.
/// Frame     direction.h; omega_i towards the light (z > 0), omega_o towards the detector
///           (z > 0 for BRDF, z < 0 for BTDF).
/// Threads   every const function may be called from any number of threads.
class Brdf {
 public:
  virtual ~Brdf() = default;

  [[nodiscard]] virtual ScatterType type() const noexcept = 0;
  /// Number of values per geometry (1 monochrome, 3 red green blue, or one per wavelength).
  [[nodiscard]] virtual std::size_t channels() const noexcept = 0;
  /// One per channel [nm]; empty when the data do not say.
  [[nodiscard]] virtual std::span<const float> wavelengths_nm() const noexcept = 0;

  /// Light at which the data have values of their own.
  /// Shape     unit vectors with z > 0, one per incidence and sample rotation, in the data's order;
  ///           empty for what knows all incidences alike (models).
  [[nodiscard]] virtual std::vector<Direction> own_incidences() const { return {}; }

  /// Values at one geometry.
  /// Shape     f_per_sr.size() == channels().
  /// Range     any pair of unit vectors; directions on the wrong side give 0 and kInvalid.
  /// Errors    none: kInvalid says that there is no value (f_per_sr is then 0).
  [[nodiscard]] virtual Origin eval(const Direction& omega_i, const Direction& omega_o,
                                    std::span<double> f_per_sr) const noexcept = 0;

  /// Standard uncertainties at one geometry [1/sr]; false (spans untouched) when none are known.
  [[nodiscard]] virtual bool uncertainty(const Direction& omega_i, const Direction& omega_o,
                                         std::span<double> random_per_sr,
                                         std::span<double> systematic_per_sr) const noexcept {
    (void)omega_i, (void)omega_o, (void)random_per_sr, (void)systematic_per_sr;
    return false;
  }

  /// Dirac component, which `eval` never contains: what leaves in exactly one direction,
  /// mirrored(omega_i) for BRDF and -omega_i for BTDF.
  /// Quantity  share of the incident power per channel [1], 0..1.
  /// Shape     weight.size() == channels().
  /// Returns   false (span untouched) when there is none.
  [[nodiscard]] virtual bool dirac(const Direction& omega_i, std::span<double> weight) const noexcept {
    (void)omega_i, (void)weight;
    return false;
  }

  /// `eval` of many outgoing directions at one incidence; models override it with a tight loop.
  /// Shape     f_per_sr[k * channels() + c]; f_per_sr.size() == omega_o.size() * channels();
  ///           origin.size() == omega_o.size() or 0 (not wanted).
  virtual void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                          std::span<double> f_per_sr, std::span<Origin> origin) const noexcept;

  /// `eval` of many geometries, each with its own incidence.
  /// Shape     omega_i.size() == omega_o.size(); f_per_sr and origin as for eval_batch.
  virtual void eval_pairs(std::span<const Direction> omega_i, std::span<const Direction> omega_o,
                          std::span<double> f_per_sr, std::span<Origin> origin) const noexcept;
};

}  // namespace scatter::reflectance
