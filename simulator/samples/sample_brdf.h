// What an ideal instrument would find on one place of a sample.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "simulator/samples/sample.h"

namespace scatter::simulator {

/// A surface's BRDF with the spot that belongs to each incidence: for a given omega_i the light covers its
/// ellipse, so values at two incidences are those of two spots, and exchanging directions changes the spot.
/// Keeps the last few incidences; another one costs what Surface::lit does.
/// Implements `Brdf`.
class SampleBrdf final : public reflectance::Brdf {
 public:
  explicit SampleBrdf(std::shared_ptr<const Surface> surface, double diameter_mm = Footprint{}.diameter_mm);

  /// Truth of a sample's text without defects, for HS-1's spot.
  /// Errors   those of Sample::make; kInvalidArgument when the text has defects.
  [[nodiscard]] static Result<std::shared_ptr<const SampleBrdf>> make(std::string_view spec);

  [[nodiscard]] reflectance::ScatterType type() const noexcept override { return surface_->type(); }
  [[nodiscard]] std::size_t channels() const noexcept override { return channels_; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override;
  [[nodiscard]] reflectance::Origin eval(const reflectance::Direction& omega_i,
                                         const reflectance::Direction& omega_o,
                                         std::span<double> f_per_sr) const noexcept override;
  void eval_batch(const reflectance::Direction& omega_i, std::span<const reflectance::Direction> omega_o,
                  std::span<double> f_per_sr, std::span<reflectance::Origin> origin) const noexcept override;
  [[nodiscard]] bool dirac(const reflectance::Direction& omega_i,
                           std::span<double> weight) const noexcept override;

 private:
  struct Lit {
    reflectance::Direction omega_i;
    std::shared_ptr<const reflectance::Brdf> brdf;
  };
  [[nodiscard]] std::shared_ptr<const reflectance::Brdf> lit(const reflectance::Direction& omega_i) const;

  std::shared_ptr<const Surface> surface_;
  double diameter_mm_;
  std::shared_ptr<const reflectance::Brdf> straight_;  ///< At normal incidence.
  std::size_t channels_;
  mutable std::mutex mutex_;
  mutable std::list<Lit> recent_;  ///< Newest first.
};

}  // namespace scatter::simulator
