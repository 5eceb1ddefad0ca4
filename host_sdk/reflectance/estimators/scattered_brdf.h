// Samples in no order behind the Brdf interface: points can be added and removed.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/scattered_samples.h"
#include "host_sdk/reflectance/search/neighbor_index.h"

namespace scatter::reflectance {

/// One sample to add.
struct ScatteredSample {
  Direction omega_i;
  Direction omega_o;
  std::span<const float> f_per_sr;           ///< One per channel [1/sr].
  std::span<const float> random_per_sr;      ///< Likewise; empty = unknown.
  std::span<const float> systematic_per_sr;  ///< Likewise.
  Origin origin = Origin::kMeasured;
};

/// Knows values at its samples and nowhere else; interpolators make a surface of it.
///
/// Sites     samples at one place (their four tangent-plane components equal as float, as all azimuths
///           at theta_o = 0 are) form one site, whose value is their mean, whose uncertainties are their
///           means (they saw the same light) and whose origin is the worst. Samples that are kInvalid
///           are kept but form no site.
/// Isotropy  when all light that does not come along the normal has one azimuth, the sample is taken as
///           isotropic, and questions are turned until the azimuth fits.
/// Threads   const functions from any thread; add and remove need exclusive access.
/// Memory    per sample 80 bytes and 12 bytes per channel; per site 40 bytes and 12 per channel.
class ScatteredBrdf final : public Brdf {
 public:
  using SampleId = std::uint32_t;

  /// Sample s of the list gets id s.
  /// Errors  those of check(samples); kResourceExhausted above 2^32 - 2 samples.
  [[nodiscard]] static Result<std::shared_ptr<ScatteredBrdf>> make(ScatteredSamples samples);

  /// Returns the new sample's id, which stays its own until it is removed.
  /// Errors  kInvalidArgument as check(ScatteredSamples); nothing changed. A sample without uncertainties
  ///         among samples that have them (or the reverse) is refused too.
  [[nodiscard]] Result<SampleId> add(const ScatteredSample& sample);
  /// Takes out one sample; false when there is none with this id.
  bool remove(SampleId id);

  /// Samples held, kInvalid ones included.
  [[nodiscard]] std::size_t size() const noexcept { return live_; }
  /// Places with a value.
  [[nodiscard]] std::size_t site_count() const noexcept { return index_.size(); }
  /// All samples held, in the order of their ids, with the metadata.
  [[nodiscard]] ScatteredSamples samples() const;
  [[nodiscard]] const std::map<std::string, std::string>& metadata() const noexcept {
    return samples_.metadata;
  }

  [[nodiscard]] ScatterType type() const noexcept override { return samples_.type; }
  [[nodiscard]] std::size_t channels() const noexcept override { return samples_.channels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return samples_.wavelengths_nm;
  }
  /// Of the samples with a value, as `incidences_of`.
  [[nodiscard]] std::vector<Direction> own_incidences() const override;
  /// The site at this place (within 1e-6 of it in the tangent planes), else kInvalid.
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  [[nodiscard]] bool uncertainty(const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept override;

  /// For interpolators: sites by number. Ids of the index are site numbers.
  struct Site {
    search::Point at;
    Direction omega_i;  ///< Of the first sample.
    Direction omega_o;
    SampleId first = 0;      ///< Its samples are chained.
    std::uint32_t held = 0;  ///< Number of samples; 0: the site is free.
    Origin origin = Origin::kInvalid;
  };
  [[nodiscard]] const search::NeighborIndex& index() const noexcept { return index_; }
  [[nodiscard]] std::span<const Site> sites() const noexcept { return sites_; }
  [[nodiscard]] std::span<const float> value(std::uint32_t site) const noexcept {
    return std::span(site_f_).subspan(site * channels(), channels());
  }
  [[nodiscard]] bool has_uncertainty() const noexcept { return has_uncertainty_; }
  /// Both empty without uncertainties.
  [[nodiscard]] std::span<const float> random(std::uint32_t site) const noexcept;
  [[nodiscard]] std::span<const float> systematic(std::uint32_t site) const noexcept;

  /// Azimuth of all light [rad], when the sample is taken as isotropic.
  [[nodiscard]] std::optional<double> azimuth() const noexcept { return azimuth_; }
  /// A pair of directions turned to the data's azimuth; as it is when the sample is not isotropic.
  struct Pair {
    Direction omega_i;
    Direction omega_o;
  };
  [[nodiscard]] Pair turned(const Direction& omega_i, const Direction& omega_o) const noexcept;

 private:
  ScatteredBrdf() = default;
  void note_azimuth(const Direction& omega_i);
  /// Hangs a valid sample on its site, making the site when there is none.
  [[nodiscard]] Status attach(SampleId id);
  void average(std::uint32_t site);
  [[nodiscard]] std::optional<std::uint32_t> site_at(const search::Point& point) const;
  [[nodiscard]] std::optional<std::uint32_t> site_near(const Direction& omega_i,
                                                       const Direction& omega_o) const noexcept;

  ScatteredSamples samples_;    ///< Slots by id; removed ones are reused.
  std::vector<bool> is_live_;   ///< One per slot.
  std::vector<SampleId> next_;  ///< Next sample of the same site, kNone at the end.
  std::vector<SampleId> free_;  ///< Slots to reuse.
  std::vector<Site> sites_;
  std::vector<std::uint32_t> free_sites_;
  std::vector<float> site_f_;
  std::vector<float> site_random_;
  std::vector<float> site_systematic_;
  search::NeighborIndex index_;
  std::size_t live_ = 0;
  bool has_uncertainty_ = false;
  bool azimuth_seen_ = false;
  std::optional<double> azimuth_;
};

}  // namespace scatter::reflectance
