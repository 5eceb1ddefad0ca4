// Layers of varying thickness over copper, and what weather and hands do to them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/patina/material.h"

namespace scatter::corrosion {

/// One layer. Thickness per cell [um], row major, first row at the top; 0 where there is none.
struct PatinaLayer {
  PatinaMaterial material = PatinaMaterial::kTarnish;
  std::vector<float> thickness_um;
};

/// A piece of copper, as thick as need be, under ordered layers. The piece tiles: its left border touches its
/// right one, its top its bottom.
///
/// Operators act on every cell; each tells how much it moved, as the mean over all cells [um]. Layers keep
/// their order for ever; a layer that was taken away stays as a layer of thickness 0. Threads   const
/// functions may be called from any number of threads. Source    Dorsey and Hanrahan 1996, "Modeling and
/// rendering of metallic patinas", section 3.
class LayerStack {
 public:
  /// Flat, bare copper.
  /// Range   side 1..16384, extent_mm > 0.
  /// Errors  kInvalidArgument names the parameter and its range.
  [[nodiscard]] static Result<LayerStack> bare(std::size_t side, double extent_mm);
  /// The same with a relief of the metal [um].
  [[nodiscard]] static Result<LayerStack> bare(std::size_t side, double extent_mm,
                                               std::vector<float> relief_um);

  /// Adds `thickness_um` on top: to the topmost layer if that is of this material, else as a new layer.
  /// Errors  kInvalidArgument where a thickness is outside 0..1e6 um, or their number is not cells().
  Result<double> coat(PatinaMaterial material, std::span<const float> thickness_um);
  /// Takes `depth_um` from the top downward, through as many layers as it takes, down to the metal and no
  /// deeper.
  Result<double> erode(std::span<const float> depth_um);
  /// Fills cavities with `material` up to `level_um` above the metal's plane; nothing afterwards lies below
  /// it.
  Result<double> fill(PatinaMaterial material, double level_um);
  /// Cuts off what lies above `level_um`, layers first and then metal; nothing afterwards lies above it.
  Result<double> polish(double level_um);
  /// Fills with `material` what a ball of this radius, rolling over the surface, cannot touch: narrow pits
  /// vanish, wide valleys stay (the closing of the profile by the ball). Once done, doing it again changes
  /// nothing. Cost    grows with radius x relief / cell^2; the ball's part that reaches deeper than the
  /// relief is left out.
  Result<double> offset(PatinaMaterial material, double radius_um);

  [[nodiscard]] std::size_t side() const noexcept { return side_; }
  [[nodiscard]] std::size_t cells() const noexcept { return side_ * side_; }
  [[nodiscard]] double extent_mm() const noexcept { return extent_mm_; }
  [[nodiscard]] double cell_um() const noexcept { return extent_mm_ * 1000 / static_cast<double>(side_); }
  /// Metal above its plane [um].
  [[nodiscard]] std::span<const float> metal_um() const noexcept { return metal_um_; }
  /// From the metal upwards.
  [[nodiscard]] std::span<const PatinaLayer> layers() const noexcept { return layers_; }
  /// Height of the surface above the metal's plane [um]: metal and all layers.
  [[nodiscard]] std::vector<float> surface_um() const;
  /// Mean thickness over the piece of all layers of this material [um].
  [[nodiscard]] double mean_um(PatinaMaterial material) const noexcept;

 private:
  LayerStack(std::size_t side, double extent_mm, std::vector<float> metal_um)
      : side_(side), extent_mm_(extent_mm), metal_um_(std::move(metal_um)) {}
  [[nodiscard]] Status check(std::span<const float> map_um, const char* what) const;
  std::vector<float>& top_layer(PatinaMaterial material);
  double raise_to(PatinaMaterial material, std::span<const float> target_um);

  std::size_t side_;
  double extent_mm_;
  std::vector<float> metal_um_;
  std::vector<PatinaLayer> layers_;
};

}  // namespace scatter::corrosion
