// Measured BRDF on a grid about the surface normal: what the instrument gives.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

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

  /// Checks shapes and ranges. Errors: kInvalidArgument naming the part and the expected size.
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
  /// Bilinear between nodes; linear in angles about the mirror direction between incidences
  /// (origin kInterpolated there); the nearest incidence outside (kExtrapolated).
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  [[nodiscard]] bool uncertainty(const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept override;

 private:
  explicit GridBrdf(Content content) : content_(std::move(content)) {}
  Content content_;
};

}  // namespace scatter::reflectance
