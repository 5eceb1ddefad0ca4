// Isotropic BRDF in a table of half and difference angles: the form of the MERL database.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// Place of a geometry in half and difference angles [rad]: theta_h of the half vector; theta_d and
/// phi_d of omega_i seen from a frame whose z is the half vector.
struct HalfDifference {
  double theta_h = 0;  ///< 0..pi/2
  double theta_d = 0;  ///< 0..pi/2
  double phi_d = 0;    ///< 0..2 pi

  /// Of two unit vectors of the upper hemisphere.
  [[nodiscard]] static HalfDifference of(const Direction& omega_i, const Direction& omega_o) noexcept;
};
/// The directions of a place, with the half vector at azimuth 0. They may lie below the horizon.
struct DirectionPair {
  Direction omega_i;
  Direction omega_o;
};
[[nodiscard]] DirectionPair directions_of(const HalfDifference& place) noexcept;

/// Table of cells (theta_h, theta_d, phi_d).
///
/// Cell i of n in theta_h covers pi/2 (i/n)^2 .. pi/2 ((i+1)/n)^2, the others are equal steps over
/// 0..pi/2 and 0..phi_range. With a phi_range of pi, f(phi_d) = f(phi_d + pi): reciprocity.
/// Source  Rusinkiewicz 1998; Matusik 2003; formats.md 3.
class HalfDifferenceBrdf final : public Brdf {
 public:
  enum class Lookup : std::uint8_t {
    kInterpolated,  ///< Linear between the centres of cells in all three.
    kNearest,       ///< The cell itself, as the MERL database's own program looks up.
  };
  struct Content {
    std::size_t theta_h_count = 90;
    std::size_t theta_d_count = 90;
    std::size_t phi_d_count = 180;
    bool reciprocal = true;  ///< phi_range is pi, else 2 pi.
    std::size_t channels = 3;
    std::vector<float> wavelengths_nm;  ///< One per channel; empty: red, green and blue.
    /// [channel][(theta_h * theta_d_count + theta_d) * phi_d_count + phi_d]; negative: no value.
    std::vector<float> f_per_sr;
    std::map<std::string, std::string> metadata;

    [[nodiscard]] std::size_t cells() const noexcept { return theta_h_count * theta_d_count * phi_d_count; }
    [[nodiscard]] double phi_range() const noexcept { return reciprocal ? kPi : 2 * kPi; }
    /// Centre of a cell.
    [[nodiscard]] HalfDifference centre(std::size_t theta_h, std::size_t theta_d,
                                        std::size_t phi_d) const noexcept;
  };

  /// Errors  kInvalidArgument: sizes that do not fit, NaN or infinity.
  [[nodiscard]] static Result<HalfDifferenceBrdf> make(Content content,
                                                       Lookup lookup = Lookup::kInterpolated);

  [[nodiscard]] const Content& content() const noexcept { return content_; }
  void set_lookup(Lookup lookup) noexcept { lookup_ = lookup; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return content_.channels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return content_.wavelengths_nm;
  }
  /// kMeasured; kExtrapolated where one of the cells to interpolate between has no value (the
  /// others then count alone); kInvalid where the cell of the directions itself has none, and
  /// below the horizon. A cell has a value when all its channels have one.
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;

 private:
  HalfDifferenceBrdf(Content content, Lookup lookup) : content_(std::move(content)), lookup_(lookup) {}
  [[nodiscard]] bool has_value(std::size_t cell) const noexcept;

  Content content_;
  Lookup lookup_;
};

}  // namespace scatter::reflectance
