#include "simulator/samples/textured_sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "host_sdk/reflectance/models/lobe_model.h"
#include "host_sdk/reflectance/models/lobes.h"
#include "host_sdk/reflectance/models/metals.h"
#include "simulator/samples/slope_clusters.h"

namespace scatter::simulator {
namespace {

using corrosion::Regime;
using reflectance::ChannelValues;
using reflectance::FacetFresnel;
using reflectance::kModelChannels;
using reflectance::LobeModel;
using reflectance::WeightedLobe;
using Facet = SpotBrdf::Facet;

/// Groups of leaning metal, and of rust. With these the sum over cells is met within 3 % of the peak
/// (textured_sample_test.cpp).
constexpr std::size_t kMetalGroups = 10;
constexpr std::size_t kRustGroups = 24;
/// Slope below which metal counts as level: a sixteenth of a degree.
constexpr double kLevelSlope = 1e-3;
/// What the coat of index 1.5 keeps from the rust under it in diffuse light (Duntley 1942, eq. for the
/// external diffuse reflectance of an interface).
constexpr double kCoatKeeps = 0.092;
/// alpha^2 grows by this times the variance of the slopes: GGX's peak, 1 / (pi alpha^2), falls by
/// 1 - 4 s^2 / alpha^2 when it is smeared with variance s^2 along both axes.
constexpr double kWidening = 4;
/// Metal from this roughness on is broad: the fourth-order share of averaging over source disc and pixel,
/// some 0.01^4 / alpha^4 of a lobe, is below 1e-4.
constexpr double kBroadAlpha = 0.1;
/// Nearly all of the slopes' variance lies between so many groups; where it does not, drawing them apart
/// would make it worse.
constexpr double kMostStretch = 1.5;

std::shared_ptr<const reflectance::Brdf> metal_lobe(const TexturedSheet& sheet, double alpha_x,
                                                    double alpha_y) {
  return std::make_shared<const LobeModel>(std::vector<WeightedLobe>{
      {reflectance::make_ggx_lobe(FacetFresnel::conductor(sheet.metal_n(), sheet.metal_k()),
                                  reflectance::uniform(alpha_x), reflectance::uniform(alpha_y)),
       reflectance::uniform(1)}});
}

/// Sums over the rust of one group.
struct RustSum {
  double rust = 0, coat = 0, coat_alpha = 0;
  ChannelValues albedo{};

  void add(const SheetCell& cell) noexcept {
    const double share = cell.weight * cell.rust;
    rust += share;
    coat += share * cell.coat;
    coat_alpha += share * cell.coat * cell.coat_alpha;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      albedo[c] += share * (1 - kCoatKeeps * cell.coat) * cell.albedo[c];
    }
  }
  [[nodiscard]] std::shared_ptr<const reflectance::Brdf> material() const {
    ChannelValues mean = albedo;
    for (double& value : mean) {
      value /= rust;
    }
    std::vector<WeightedLobe> lobes{
        {reflectance::make_oren_nayar_lobe(mean, reflectance::uniform(kRustSigmaRad)),
         reflectance::uniform(1)}};
    if (coat > 0) {
      const ChannelValues alpha = reflectance::uniform(coat_alpha / coat);
      lobes.push_back({reflectance::make_ggx_lobe(FacetFresnel::dielectric(reflectance::uniform(kCoatIndex)),
                                                  alpha, alpha),
                       reflectance::uniform(coat / rust)});
    }
    return std::make_shared<const LobeModel>(std::move(lobes));
  }
};

/// Facets of leaning metal: a lobe about each group's mean normal.
void add_metal(const TexturedSheet& sheet, std::span<const SlopePoint> points, std::vector<Facet>& facets) {
  const std::vector<std::size_t> group = cluster_slopes(points, kMetalGroups);
  const std::size_t groups = group.empty() ? 0 : *std::ranges::max_element(group) + 1;
  const std::vector<SlopeMoments> means = moments_of_groups(points, group, groups);
  for (std::size_t g = 0; g < groups; ++g) {
    const reflectance::Direction normal = normal_of_slope(means[g].mean_x, means[g].mean_y);
    const FacetFrame frame = facet_frame(normal);
    std::vector<SlopePoint> local;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (group[k] == g) {
        const reflectance::Direction n = to_facet(normal_of_slope(points[k].x, points[k].y), frame);
        local.push_back({-n.x / n.z, -n.y / n.z, points[k].weight});
      }
    }
    const SlopeMoments spread =
        moments_of_groups(local, std::vector<std::size_t>(local.size(), 0), 1).front();
    const SlopeMoments::Axis axis = spread.longest();
    const double across = std::max(spread.xx + spread.yy - axis.variance, 0.0);
    const auto widened = [&](double variance) {
      const double alpha = sheet.optics().metal_alpha;
      return std::min(std::sqrt(alpha * alpha + kWidening * variance), 1.0);
    };
    facets.push_back({.weight = means[g].weight,
                      .normal = normal,
                      .turn_rad = std::atan2(axis.y, axis.x),
                      .material = metal_lobe(sheet, widened(axis.variance), widened(across))});
  }
}

/// How much the groups' means must be drawn apart along x and y to have the variance of all points: smooth
/// lobes are then summed right to second order.
struct Stretch {
  double mean_x = 0, mean_y = 0;
  double x = 1, y = 1;
};

Stretch stretch_of(std::span<const SlopePoint> points, std::span<const SlopeMoments> groups) {
  const SlopeMoments all = moments_of_groups(points, std::vector<std::size_t>(points.size(), 0), 1).front();
  double between_x = 0;
  double between_y = 0;
  for (const SlopeMoments& g : groups) {
    between_x += g.weight / all.weight * (g.mean_x - all.mean_x) * (g.mean_x - all.mean_x);
    between_y += g.weight / all.weight * (g.mean_y - all.mean_y) * (g.mean_y - all.mean_y);
  }
  const auto factor = [](double whole, double between) {
    return between > 0 ? std::min(std::sqrt(whole / between), kMostStretch) : 1.0;
  };
  return {all.mean_x, all.mean_y, factor(all.xx, between_x), factor(all.yy, between_y)};
}

void add_rust(std::span<const SheetCell> cells, std::vector<Facet>& facets) {
  std::vector<SlopePoint> points;
  std::vector<const SheetCell*> rusty;
  for (const SheetCell& cell : cells) {
    if (cell.rust > 0) {
      points.push_back({cell.slope_x, cell.slope_y, cell.weight * cell.rust});
      rusty.push_back(&cell);
    }
  }
  if (points.empty()) {
    return;
  }
  const std::vector<std::size_t> group = cluster_slopes(points, kRustGroups);
  const std::size_t groups = *std::ranges::max_element(group) + 1;
  const std::vector<SlopeMoments> means = moments_of_groups(points, group, groups);
  std::vector<RustSum> sums(groups);
  for (std::size_t k = 0; k < points.size(); ++k) {
    sums[group[k]].add(*rusty[k]);
  }
  const Stretch stretch = stretch_of(points, means);
  for (std::size_t g = 0; g < groups; ++g) {
    facets.push_back(
        {.weight = means[g].weight,
         .normal = normal_of_slope(stretch.mean_x + stretch.x * (means[g].mean_x - stretch.mean_x),
                                   stretch.mean_y + stretch.y * (means[g].mean_y - stretch.mean_y)),
         .turn_rad = 0,
         .material = sums[g].material()});
  }
}

std::unexpected<Error> refuse(std::string what, std::string remedy) {
  return fail(ErrorCode::kInvalidArgument, std::move(what), std::move(remedy));
}

}  // namespace

Result<std::shared_ptr<const TexturedSheet>> TexturedSheet::make(corrosion::Appearance maps, double extent_mm,
                                                                 const SheetOptics& optics) {
  const std::size_t cells = maps.side * maps.side;
  for (const std::size_t size : {maps.albedo.size(), maps.regime.size(), maps.metalness.size(),
                                 maps.roughness.size(), maps.porosity.size(), maps.normal.size()}) {
    if (cells == 0 || size != cells) {
      return refuse(fmt::format("sheet: a map has {} cells, expected {} x {}", size, maps.side, maps.side),
                    "make all maps from one sheet");
    }
  }
  if (!(optics.metal_alpha >= 0.01 && optics.metal_alpha <= 1)) {
    return refuse(fmt::format("metal_alpha is {}, expected 0.01..1", optics.metal_alpha),
                  "write metal_alpha=0.15");
  }
  if (!(optics.backing >= 0 && optics.backing <= 1)) {
    return refuse(fmt::format("backing is {}, expected black or a reflectance 0..1", optics.backing),
                  "write backing=black");
  }
  std::shared_ptr<TexturedSheet> sheet(new TexturedSheet(std::move(maps), extent_mm, optics));
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    const auto index =
        reflectance::metal_index(optics.metal, static_cast<double>(reflectance::kModelWavelengthsNm[c]));
    if (!index) {
      return std::unexpected(index.error());
    }
    sheet->n_[c] = index->n;
    sheet->k_[c] = index->k;
  }
  return sheet;
}

SheetCell TexturedSheet::cell(std::size_t index) const noexcept {
  const std::array<float, 3>& n = maps_.normal[index];
  SheetCell cell{.weight = 0,
                 .slope_x = -double{n[0]} / double{n[2]},
                 .slope_y = -double{n[1]} / double{n[2]},
                 .metal = 0,
                 .rust = 0,
                 .albedo = {},
                 .coat_alpha = 1,
                 .coat = 0};
  if (maps_.regime[index] == Regime::kHole) {
    cell.slope_x = cell.slope_y = 0;
    return cell;
  }
  const double metal = std::clamp(double{maps_.metalness[index]}, 0.0, 1.0);
  double found = 0;
  const auto look = [&](std::size_t at) {
    if (maps_.regime[at] == Regime::kRust) {
      for (std::size_t c = 0; c < kModelChannels; ++c) {
        cell.albedo[c] += double{maps_.albedo[at][c]};
      }
      cell.coat += 1 - double{maps_.porosity[at]};
      cell.coat_alpha += double{maps_.roughness[at]};
      found += 1;
    }
  };
  if (metal < 1) {
    cell.coat_alpha = 0;
    if (maps_.regime[index] == Regime::kRust) {
      look(index);
    } else {
      const std::size_t side = maps_.side;
      const std::size_t x = index % side;
      const std::size_t y = index / side;
      for (std::size_t k = 0; k < 9; ++k) {
        look((y + side + k / 3 - 1) % side * side + (x + side + k % 3 - 1) % side);
      }
    }
  }
  if (found == 0) {
    cell.metal = 1;
    cell.coat_alpha = 1;
    return cell;
  }
  cell.metal = metal;
  cell.rust = 1 - metal;
  for (double& value : cell.albedo) {
    value = std::clamp(value / found, 0.0, 1.0);
  }
  cell.coat = std::clamp(cell.coat / found, 0.0, 1.0);
  cell.coat_alpha = std::clamp(cell.coat_alpha / found, 0.01, 1.0);
  return cell;
}

std::vector<SheetCell> TexturedSheet::cells(std::span<const LitCell> lit) const {
  std::vector<SheetCell> cells;
  cells.reserve(lit.size());
  for (const LitCell& one : lit) {
    cells.push_back(cell(one.cell));
    cells.back().weight = one.weight;
  }
  return cells;
}

TexturedSheet::Facets TexturedSheet::facets(std::span<const LitCell> lit) const {
  const std::vector<SheetCell> lit_up = cells(lit);
  Facets found;
  std::vector<SlopePoint> leaning;
  double level = 0;
  double holes = 0;
  for (const SheetCell& cell : lit_up) {
    holes += cell.weight * (1 - cell.metal - cell.rust);
    if (std::hypot(cell.slope_x, cell.slope_y) < kLevelSlope) {
      level += cell.weight * cell.metal;
    } else if (cell.metal > 0) {
      leaning.push_back({cell.slope_x, cell.slope_y, cell.weight * cell.metal});
    }
  }
  if (level > 0) {
    found.starts_level = true;
    found.all.push_back({.weight = level,
                         .normal = {},
                         .turn_rad = 0,
                         .material = metal_lobe(*this, optics_.metal_alpha, optics_.metal_alpha)});
  }
  add_metal(*this, leaning, found.all);
  add_rust(lit_up, found.all);
  if (holes > 0) {
    Facet hole{.weight = holes, .normal = {}, .turn_rad = 0, .material = nullptr};
    if (optics_.backing > 0) {
      hole.material = std::make_shared<const LobeModel>(std::vector<WeightedLobe>{
          {reflectance::make_lambert_lobe(reflectance::uniform(optics_.backing)), reflectance::uniform(1)}});
    }
    found.all.push_back(std::move(hole));
  }
  return found;
}

std::shared_ptr<const SpotBrdf> TexturedSheet::scattering(std::span<const LitCell> lit) const {
  return std::make_shared<const SpotBrdf>(facets(lit).all);
}

std::vector<Surface::Summand> TexturedSheet::scattering_apart(std::span<const LitCell> lit) const {
  auto [all, starts_level] = facets(lit);
  // Leaning metal is widened by the slopes that it stands for.
  if (!starts_level || optics_.metal_alpha >= kBroadAlpha) {
    return {{std::make_shared<const SpotBrdf>(all), true}};
  }
  // Each summand holds all facets, since those of the other one hide and show area too.
  std::vector<Facet> level = all;
  for (std::size_t k = 1; k < level.size(); ++k) {
    level[k].material = nullptr;
  }
  all.front().material = nullptr;
  return {{std::make_shared<const SpotBrdf>(level), false}, {std::make_shared<const SpotBrdf>(all), true}};
}

TexturedSurface::TexturedSurface(std::shared_ptr<const TexturedSheet> sheet,
                                 const std::optional<Place>& place)
    : sheet_(std::move(sheet)), place_(place) {
  if (!place_) {
    whole_ = sheet_->scattering(all_cells(sheet_->side()));
    whole_apart_ = sheet_->scattering_apart(all_cells(sheet_->side()));
  }
}

std::vector<Surface::Summand> TexturedSurface::lit_apart(const Footprint& footprint) const {
  return place_ ? sheet_->scattering_apart(lit_cells(sheet_->side(), sheet_->extent_mm(), *place_, footprint))
                : whole_apart_;
}

std::shared_ptr<const reflectance::Brdf> TexturedSurface::lit(const Footprint& footprint) const {
  return place_ ? sheet_->scattering(lit_cells(sheet_->side(), sheet_->extent_mm(), *place_, footprint))
                : whole_;
}

std::shared_ptr<const Surface> TexturedSurface::moved(const Place& place) const {
  return std::make_shared<const TexturedSurface>(sheet_, place);
}

}  // namespace scatter::simulator
