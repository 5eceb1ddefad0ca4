// A sheet that looks different from place to place, as the instrument's light meets it.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/models/model_channels.h"
#include "simulator/corrosion/appearance.h"
#include "simulator/samples/lit_cells.h"
#include "simulator/samples/sample.h"
#include "simulator/samples/spot_brdf.h"

namespace scatter::simulator {

/// What the regimes of a sheet scatter like.
struct SheetOptics {
  std::string metal = "iron";  ///< Of models/metals.h.
  double metal_alpha = 0.15;   ///< GGX roughness of bare metal, 0.01..1.
  double backing = 0;          ///< Reflectance of what holes show, diffuse, 0..1.
};

/// Standard deviation of the slope angles of the facets of rust, below what the map resolves [rad]. An
/// estimate.
inline constexpr double kRustSigmaRad = reflectance::radians(25);
/// Index of the clear coat over rust; it covers the share 1 - porosity.
inline constexpr double kCoatIndex = 1.5;

/// One map cell in the light.
struct SheetCell {
  double weight = 0;                    ///< Share of the spot.
  double slope_x = 0, slope_y = 0;      ///< dz/dx, dz/dy.
  double metal = 0, rust = 0;           ///< Shares of the cell; the rest is a hole.
  reflectance::ChannelValues albedo{};  ///< Of the rust.
  double coat_alpha = 1;                ///< GGX roughness of the rust's coat.
  double coat = 0;                      ///< Share of the rust that it covers.
};

/// Maps with the materials that they stand for. Immutable, shared by every place of the sheet.
class TexturedSheet {
 public:
  /// Errors    kInvalidArgument: optics out of range, unknown metal, maps of different sizes.
  [[nodiscard]] static Result<std::shared_ptr<const TexturedSheet>> make(corrosion::Appearance maps,
                                                                         double extent_mm,
                                                                         const SheetOptics& optics);

  [[nodiscard]] std::size_t side() const noexcept { return maps_.side; }
  [[nodiscard]] double extent_mm() const noexcept { return extent_mm_; }
  [[nodiscard]] const SheetOptics& optics() const noexcept { return optics_; }
  /// The metal's n and k at kModelWavelengthsNm.
  [[nodiscard]] const reflectance::ChannelValues& metal_n() const noexcept { return n_; }
  [[nodiscard]] const reflectance::ChannelValues& metal_k() const noexcept { return k_; }

  /// Cells with all that scattering needs. On the border between metal and rust a cell is both: the rust in
  /// it looks like that of its neighbours.
  [[nodiscard]] std::vector<SheetCell> cells(std::span<const LitCell> lit) const;

  /// Scattering of the lit cells. Per regime, cells of like slope are put together (SpotBrdf's facets): level
  /// metal is one lobe with exactly its share; leaning metal ten lobes, each widened by the slopes it
  /// stands for; rust 24 facets that keep the slopes' mean and variance; holes the backing. Cost      some
  /// ms for a spot of 3000 cells; evaluation as that of some 60 lobes.
  [[nodiscard]] std::shared_ptr<const SpotBrdf> scattering(std::span<const LitCell> lit) const;
  /// The same as summands: level metal of alpha below 0.1 stands apart.
  [[nodiscard]] std::vector<Surface::Summand> scattering_apart(std::span<const LitCell> lit) const;

 private:
  TexturedSheet(corrosion::Appearance maps, double extent_mm, SheetOptics optics)
      : maps_(std::move(maps)), extent_mm_(extent_mm), optics_(std::move(optics)) {}
  [[nodiscard]] SheetCell cell(std::size_t index) const noexcept;
  struct Facets {
    std::vector<SpotBrdf::Facet> all;
    bool starts_level = false;  ///< The first is level metal.
  };
  [[nodiscard]] Facets facets(std::span<const LitCell> lit) const;

  corrosion::Appearance maps_;
  double extent_mm_;
  SheetOptics optics_;
  reflectance::ChannelValues n_{};
  reflectance::ChannelValues k_{};
};

/// A sheet with the instrument on one place of it. Axes: x to the sheet's right, y up (towards the first
/// row).
class TexturedSurface final : public Surface {
 public:
  /// place: nothing lights the whole sheet evenly, whatever the footprint.
  TexturedSurface(std::shared_ptr<const TexturedSheet> sheet, const std::optional<Place>& place);

  [[nodiscard]] std::shared_ptr<const reflectance::Brdf> lit(const Footprint& footprint) const override;
  [[nodiscard]] std::vector<Summand> lit_apart(const Footprint& footprint) const override;
  [[nodiscard]] reflectance::ScatterType type() const noexcept override {
    return reflectance::ScatterType::kBrdf;
  }
  [[nodiscard]] std::optional<Place> place() const noexcept override { return place_; }
  [[nodiscard]] std::shared_ptr<const Surface> moved(const Place& place) const override;

  [[nodiscard]] const TexturedSheet& sheet() const noexcept { return *sheet_; }

 private:
  std::shared_ptr<const TexturedSheet> sheet_;
  std::optional<Place> place_;
  /// Only without a place.
  std::shared_ptr<const reflectance::Brdf> whole_;
  std::vector<Summand> whole_apart_;
};

}  // namespace scatter::simulator
