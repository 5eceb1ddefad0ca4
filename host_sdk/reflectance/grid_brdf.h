// Measured BRDF on a grid about the surface normal: what the instrument gives.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_lookup.h"

namespace scatter::reflectance {

/// One incident direction at one sample rotation.
///
/// Node (j, i) lies at theta_o = j * theta_step, phi_o = i * phi_step from the exit side's normal;
/// index j * phi_count + i. phi does not repeat at 2 pi. For BTDF theta_o counts from the lower
/// normal (omega_o.z = -cos theta_o); regular transmission is then at phi_o = phi_i + pi.
/// Planes are per channel: values[channel][node].
struct GridPart {
  double rotation_rad =
      0;  ///< Sample rotation during the measurement (directions are already in the sample's frame).
  double theta_i = 0;  ///< [rad], 0..pi/2.
  double phi_i = 0;    ///< [rad].
  std::vector<std::vector<float>> f_per_sr;
  std::vector<std::vector<float>> random_per_sr;      ///< Standard uncertainty, empty when unknown.
  std::vector<std::vector<float>> systematic_per_sr;  ///< Likewise.
  std::vector<float> pixels;   ///< Effective number of sensor pixels; empty when unknown.
  std::vector<Origin> origin;  ///< One per node.
};

/// Grid of one material. Values are immutable once built through `make`.
///
/// Memory   besides the planes, values are kept as evaluation reads them: 16 bytes per node for up to
///          three channels (8 for one), node_floats() of CellTable in general.
class GridBrdf final : public Brdf {
 public:
  struct Content {
    ScatterType type = ScatterType::kBrdf;
    std::vector<float> wavelengths_nm;  ///< One per channel; empty = unknown.
    std::size_t channels = 3;
    std::size_t theta_count = 76;
    std::size_t phi_count = 360;
    double theta_step = kPi / 180.0;  ///< [rad]
    double phi_step = kPi / 180.0;    ///< [rad]; phi_count * phi_step = 2 pi.
    std::vector<GridPart> parts;      ///< Sorted by rotation, theta_i, phi_i by `make`.
    /// Provenance: calibration_id, recording_id, software, settings, quality, ... -> text.
    std::map<std::string, std::string> metadata;
  };

  /// Checks shapes and ranges. Errors: kInvalidArgument naming the part and the expected size;
  /// kResourceExhausted above 2^31 nodes.
  [[nodiscard]] static Result<GridBrdf> make(Content content);

  [[nodiscard]] const Content& content() const noexcept { return content_; }
  [[nodiscard]] Direction omega_i(std::size_t part) const noexcept;
  /// Direction of a node; z < 0 for BTDF.
  [[nodiscard]] Direction omega_o(std::size_t node) const noexcept;
  /// Solid angle that a node stands for [sr]: cells end half-way to their neighbours.
  [[nodiscard]] double solid_angle_sr(std::size_t node) const noexcept;

  [[nodiscard]] ScatterType type() const noexcept override { return content_.type; }
  [[nodiscard]] std::size_t channels() const noexcept override { return content_.channels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return content_.wavelengths_nm;
  }
  /// One per part.
  [[nodiscard]] std::vector<Direction> own_incidences() const override;
  /// Bilinear between nodes (the pole is one point: the mean of its row); linear in angles about
  /// the mirror direction between incidences (origin kInterpolated there); the nearest incidence
  /// and the last theta_o outside (kExtrapolated). An invalid node in use makes the result
  /// kInvalid. Parts of one rotation only: the sample is taken as isotropic and is turned until
  /// phi_i fits; several rotations: linear between them in phi_i where they lie at most 90 deg
  /// apart, the nearest (kExtrapolated) elsewhere.
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  /// By SIMD, several directions at once. Relative to the largest node in use, values of eval_batch
  /// differ from those of `eval` by less than 1e-9. eval_pairs calculates in float: its values and
  /// origins are those of directions at most 1e-6 rad off.
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept override;
  void eval_pairs(std::span<const Direction> omega_i, std::span<const Direction> omega_o,
                  std::span<double> f_per_sr, std::span<Origin> origin) const noexcept override;
  [[nodiscard]] bool uncertainty(const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept override;

 private:
  /// Parts of one sample rotation, by increasing theta_i.
  struct Group {
    std::size_t first = 0;
    std::size_t count = 0;
    double phi_i = 0;  ///< Of the steepest incidence, whose azimuth is the best defined one.
  };
  enum class Plane : std::uint8_t { kValue, kRandom, kSystematic };
  /// One node, or a part's pole, and its share in a result.
  struct Tap {
    std::uint32_t part = 0;
    std::uint32_t node = 0;
    double weight = 0;
  };
  /// Two rotations, two incidences each, four nodes each.
  struct Blend {
    std::array<Tap, 16> taps;
    std::size_t count = 0;
    Origin origin = Origin::kMeasured;
  };

  explicit GridBrdf(Content content);
  void build_lookup();
  [[nodiscard]] IncidenceShares shares_of(const Direction& omega_i) const noexcept;
  void add_shares(const Group& group, double theta_i, double phi_i, double weight,
                  IncidenceShares& out) const noexcept;
  /// The slow way to what the lookup does: single taps, for uncertainties and cells of mixed origin.
  [[nodiscard]] Blend blend(const Direction& omega_i, const Direction& omega_o) const noexcept;
  [[nodiscard]] Origin ask_scalar(const Direction& omega_i, const Direction& omega_o,
                                  std::span<double> f_per_sr) const noexcept;
  /// local_o: light of the part in the plane y = 0, x > 0, outgoing side up.
  void blend_part(std::size_t part, const Direction& local_o, double weight, Blend& out) const noexcept;
  void add_tap(std::size_t part, std::size_t row, std::size_t column, double weight,
               Blend& out) const noexcept;
  [[nodiscard]] bool sum(const Blend& blend, Plane plane, std::span<double> out) const noexcept;

  Content content_;
  std::vector<Group> groups_;        ///< By increasing phi_i, in [0, 2 pi).
  std::vector<double> pole_;         ///< [(plane * parts + part) * channels + channel]
  std::vector<Origin> pole_origin_;  ///< One per part.
  NormalLookup lookup_;
};

}  // namespace scatter::reflectance
