// Copper that weathers: one growth, from which a piece of any age can be had.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/map.h"
#include "simulator/corrosion/patina/atmosphere.h"
#include "simulator/corrosion/patina/deposition.h"
#include "simulator/corrosion/patina/layer_stack.h"
#include "simulator/corrosion/patina/look.h"

namespace scatter::corrosion {

/// Everything that decides how a piece of copper weathers.
struct PatinaOptions {
  Atmosphere atmosphere = Atmosphere::kUrban;
  double age_years = 25;    ///< The oldest age that will be asked for; clamped to 0..100 with a note.
  std::size_t side = 1024;  ///< Cells along each side, 8..8192.
  double extent_mm = 50;    ///< Length of each side, 0.1..10000.
  std::uint64_t seed = 1;

  /// How the patina proper thickens; the tarnish below it is an even film and grows steadily.
  Deposition deposition = Deposition::kBallistic;
  double particle_um = 1;  ///< Height of a particle on one grain, 0.05..20.
  double grain_mm = 0.05;  ///< Width of a particle, 0.001..10; cells are grouped to about this size.

  double patch_mm = 6;        ///< Mean distance of places of slow and fast growth, 0.01..10000.
  double patch_sigma = 0.35;  ///< Of the logarithm of the local rate, 0..2; see seed_field.h.

  /// Multiplies the loss of metal and the rain, 0..10; 1 = in the open.
  Map exposure{1, 1, {1.0F}};
  /// Multiplies the loss of metal, 0..10: share of the time that it is wet, relative to the atmosphere's own.
  Map wetness{1, 1, {1.0F}};
  /// Of the surface's normal from straight up [deg], 0..180. Loss goes with the part of the sky that is seen,
  /// (1 + cos) / 2; what rain takes, with cos, 0 when facing down.
  Map inclination_deg{1, 1, {0.0F}};

  float metal_roughness = 0.15F;  ///< GGX alpha of bare copper, 0.01..1.
};

/// A piece at one age. All that shows it is made from `layers`.
struct PatinaPiece {
  double age_years = 0;
  LayerStack layers;          ///< Tarnish, and over it the atmosphere's patina.
  double copper_loss_um = 0;  ///< Metal lost, mean over the piece.
  double mean_tarnish_um = 0;
  double mean_patina_um = 0;
  Coverage coverage{};
  std::uint64_t particles = 0;  ///< That have fallen.
};

/// The history of a piece: a calendar of steps, and the particles that fall in each.
///
/// Ages are nested by construction: no cell's layers are thinner at a later age.
/// Threads   const functions may be called from any number of threads; the same options give the same
/// history.
class Patina {
 public:
  /// Prepares a history up to options.age_years.
  /// Errors  kInvalidArgument names the parameter, what it is and its range.
  /// Cost    25 seeds per cell and scale of patches.
  [[nodiscard]] static Result<std::shared_ptr<const Patina>> grow(PatinaOptions options);

  /// As used: age clamped.
  [[nodiscard]] const PatinaOptions& options() const noexcept { return options_; }
  /// What was changed or should be known, one sentence each.
  [[nodiscard]] std::span<const std::string> notes() const noexcept { return notes_; }
  /// Mean over the piece that the laws ask for, and that the piece has (patina: to one particle).
  [[nodiscard]] Layers expected(double age_years) const;

  /// The piece at `age_years`, clamped to 0..options().age_years.
  /// Errors  kInvalidArgument when it is not finite; kAborted when stopped.
  /// Cost    every particle that has fallen until then: docs/patina.md.
  [[nodiscard]] Result<PatinaPiece> at(double age_years, const std::stop_token& stop = {}) const;
  /// Shows the piece at each of `ages_years` (rising) in one replay.
  /// Errors  kInvalidArgument when ages fall or are not finite; kAborted when stopped.
  [[nodiscard]] Status each(std::span<const double> ages_years,
                            const std::function<void(const PatinaPiece&)>& visit,
                            const std::stop_token& stop = {}) const;

  /// Appearance of a piece with this history's roughness.
  [[nodiscard]] Appearance appearance(const PatinaPiece& piece) const;

 private:
  /// A stretch of time in which every cell thickens at a constant rate.
  struct Step {
    double begin_years;
    double end_years;
    double patina_um_at_begin;  ///< Mean over the piece.
    double patina_um_at_end;
  };
  explicit Patina(PatinaOptions options, std::vector<std::string> notes)
      : options_(std::move(options)), notes_(std::move(notes)) {}
  void lay_out();
  [[nodiscard]] std::vector<float> patina_um(std::span<const float> loss_share,
                                             std::span<const float> rain_share, double years) const;
  [[nodiscard]] std::vector<float> tarnish_um(double years) const;
  /// Of each square of the grains' grid; `before` is what the law gives at the step's begin, and becomes that
  /// at its end.
  [[nodiscard]] std::vector<float> gain_um(const Step& step, std::vector<float>& before) const;
  [[nodiscard]] PatinaPiece piece(double age_years, std::span<const float> patina_um,
                                  std::uint64_t particles) const;

  PatinaOptions options_;
  std::vector<std::string> notes_;
  std::vector<float> loss_share_;        ///< Of the atmosphere's loss, per cell.
  std::size_t grains_ = 0;               ///< Along each side.
  double particle_um_ = 0;               ///< Height of a particle on one square of the grains' grid.
  std::vector<float> grain_loss_share_;  ///< The same on the grains' grid.
  std::vector<float> grain_rain_share_;
  std::vector<Step> steps_;
};

}  // namespace scatter::corrosion
