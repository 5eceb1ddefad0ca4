// Step 7 of instrument.md section 4: pixels onto the 1 deg grid by local weighted least squares.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/measurement/pixel_geometry.h"
#include "protocol/descriptor.h"

namespace scatter::measurement {

struct FitWeights;

/// Regular grid about the normal of the sample's exit side.
struct GridShape {
  std::size_t theta_count = 76;
  std::size_t phi_count = 360;
  double theta_step = reflectance::kPi / 180.0;
  double phi_step = reflectance::kPi / 180.0;
  [[nodiscard]] std::size_t nodes() const noexcept { return theta_count * phi_count; }
  [[nodiscard]] reflectance::Direction direction(std::size_t node) const noexcept {
    return reflectance::from_spherical(static_cast<double>(node / phi_count) * theta_step,
                                       static_cast<double>(node % phi_count) * phi_step);
  }
};

/// What a node can be computed from.
enum class NodeKind : std::uint8_t {
  kEmpty,    ///< No pixel sees this direction.
  kBlind,    ///< Inside a blind spot.
  kOutside,  ///< Beyond the instrument's measured range (a tilted sample), but the image reaches it.
  kSeen,
};

/// Values of all lanes (illuminations) at all nodes: index node * lanes + lane.
struct NodeValues {
  std::size_t lanes = 0;
  std::vector<float> value;     ///< Same unit as the pixels.
  std::vector<float> variance;  ///< Of value; infinity = no value.
  std::vector<float> pixels;    ///< Effective number of pixels per node, 1 / sum h^2 of the operator.
  std::vector<NodeKind> kind;   ///< Per node.
  /// Shift that a blind node's value takes when the fill is linear instead of quadratic; 0 elsewhere.
  std::vector<float> fill_spread;
};

/// A linear operator from pixels to nodes, built once per geometry.
///
/// Each node's value is the value at its centre of the quadratic in the tangent plane that fits the
/// pixels within `radius` best, weighted by 1 - (d / radius)^2. Weights do not depend on the
/// measured values, so the operator is linear and its noise is known exactly. A quadratic keeps peaks
/// that plain averaging flattens. The known blur of source disc and pixel (variance sigma^2 per axis)
/// is taken back to first order: f = g - sigma^2 / 2 laplacian(g), with the laplacian of the same fit.
/// Near the pole, where 1 deg of azimuth is less than a pixel, the footprint stays the same disc.
class Resampler {
 public:
  struct Options {
    GridShape grid;
    double radius_rad = 1.5 * reflectance::kPi / 180.0;  ///< Never less than 2.5 pixels are used.
    double source_radius_rad = 0;                        ///< Angular radius of the sources' discs.
  };

  /// Cost  about 30 ms for HS-1 on 2 cores; 15 MB.
  [[nodiscard]] static Resampler build(const PixelGeometry& pixels, const protocol::Descriptor& descriptor,
                                       const SampleFrame& frame, const Options& options);

  /// Applies the operator to interleaved pixels: index pixel * lanes + lane; variance infinity marks a
  /// pixel without value in that lane (saturated): nodes near it are solved again without it.
  [[nodiscard]] NodeValues apply(std::span<const float> value, std::span<const float> variance,
                                 std::size_t lanes) const;

  [[nodiscard]] const GridShape& grid() const noexcept { return options_.grid; }

 private:
  /// Operator of one ring of nodes, compressed rows.
  struct Rows {
    std::vector<std::uint32_t> first;  ///< Per node, into pixel and weight; one more at the end.
    std::vector<std::uint32_t> pixel;
    std::vector<float> weight;
    void append(const FitWeights& weights);
    void append_empty() { first.push_back(static_cast<std::uint32_t>(pixel.size())); }
  };
  struct Ring {
    Rows best;  ///< Quadratic; across blind discs from the pixels around them.
    Rows flat;  ///< Linear, for blind nodes only: the difference tells how far the fill can be trusted.
  };

  /// How a node is fitted; radius 0 = not at all.
  struct Footprint {
    NodeKind kind = NodeKind::kEmpty;
    double radius_rad = 0;
    double blur_variance_rad2 = 0;
    int stride = 1;
  };
  [[nodiscard]] Footprint footprint(const reflectance::Direction& w) const;
  void solve_again(const reflectance::Direction& w, std::span<const float> value,
                   std::span<const float> variance, std::size_t lanes, std::size_t lane, float& mean,
                   float& var) const;

  Resampler(const PixelGeometry& pixels, const protocol::Descriptor& descriptor, const SampleFrame& frame,
            const Options& options);

  struct BlindDisc {
    reflectance::Direction axis;
    double radius = 0;
    double cos_radius = 0;
  };

  Options options_;
  const PixelGeometry* pixels_;
  protocol::Descriptor descriptor_;
  SampleFrame frame_;
  std::vector<BlindDisc> blind_;
  std::vector<Ring> rings_;
  std::vector<NodeKind> kinds_;
};

}  // namespace scatter::measurement
