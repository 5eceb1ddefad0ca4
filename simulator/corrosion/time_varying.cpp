#include "simulator/corrosion/time_varying.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "simulator/corrosion/front_growth.h"
#include "simulator/corrosion/interpolation.h"

namespace scatter::corrosion {
namespace {

constexpr std::array<std::string_view, kLookParameters> kNames{
    "red", "green", "blue", "roughness", "porosity", "metalness", "opacity", "height"};
constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Where material or exposure stop a cell from deepening it would have no time of its own: a millionth of a
/// micrometre in a millimetre of the clock tells before from after and changes no colour.
constexpr double kSlowest_um_per_mm = 1e-6;
constexpr std::size_t kTicks = 512;
constexpr std::size_t kCurveKnots = 257;

using Look = std::array<float, kLookParameters>;

/// What options make of a sheet's depth, apart from where the place is.
class LookOfDepth {
 public:
  LookOfDepth(const AppearanceOptions& options, double thickness_um)
      : options_(options), thickness_um_(thickness_um) {}

  [[nodiscard]] Regime regime(double depth_um, bool corroded) const noexcept {
    const auto height = static_cast<float>(std::max(0.0, 1 - depth_um / thickness_um_));
    if (options_.rule == LookRule::kByHeight) {
      return regime_of_height(height);
    }
    return height <= 0 ? Regime::kHole : corroded ? Regime::kRust : Regime::kMetal;
  }

  [[nodiscard]] Rgb albedo(double u, double v, double depth_um, bool corroded) const noexcept {
    const auto height = static_cast<float>(std::max(0.0, 1 - depth_um / thickness_um_));
    const float rust = regime(depth_um, corroded) == Regime::kMetal ? 0.0F : 1.0F;
    return colour(options_, u, v, height, static_cast<float>(std::min(depth_um, thickness_um_)), rust);
  }

  /// Everything but the albedo.
  [[nodiscard]] Look rest(double depth_um, bool corroded) const noexcept {
    const Regime kind = regime(depth_um, corroded);
    const bool metal = kind == Regime::kMetal;
    const auto depth = static_cast<float>(std::min(depth_um, thickness_um_));
    Look look{};
    look[static_cast<std::size_t>(LookParameter::kRoughness)] =
        metal ? options_.metal_roughness : rust_roughness(depth);
    look[static_cast<std::size_t>(LookParameter::kPorosity)] = metal ? 0.0F : rust_porosity(depth);
    look[static_cast<std::size_t>(LookParameter::kMetalness)] = metal ? 1.0F : 0.0F;
    look[static_cast<std::size_t>(LookParameter::kOpacity)] = kind == Regime::kHole ? 0.0F : 1.0F;
    look[static_cast<std::size_t>(LookParameter::kHeight)] =
        static_cast<float>(std::max(0.0, 1 - depth_um / thickness_um_));
    return look;
  }

  /// Depths [um] at which colour bends or a regime begins.
  [[nodiscard]] std::vector<double> bends() const {
    std::vector<double> depths{thickness_um_};
    if (options_.rule == LookRule::kByHeight) {
      for (const float limit : options_.layer_limits) {
        depths.push_back((1 - static_cast<double>(limit)) * thickness_um_);
      }
      depths.push_back((1 - static_cast<double>(kMetalFromHeight)) * thickness_um_);
      depths.push_back((1 - static_cast<double>(kRustFromHeight)) * thickness_um_);
    } else {
      depths.insert(depths.end(), options_.layer_depths_um.begin(), options_.layer_depths_um.end());
    }
    return depths;
  }

 private:
  const AppearanceOptions& options_;
  double thickness_um_;
};

/// Times of the knots after rust has come: close where things change quickly, doubled where they may step.
std::vector<double> knot_times(const LookOfDepth& look, double skin_um, double last) {
  std::vector<double> times;
  for (std::size_t i = 0; i < kCurveKnots; ++i) {
    const double share = static_cast<double>(i) / (kCurveKnots - 1);
    times.push_back(share * share * last);
  }
  for (const double depth : look.bends()) {
    const double time = depth - skin_um;
    if (time > 0 && time <= last) {
      // Heights are floats: a regime may begin their rounding away from where it is reckoned.
      const double margin = 2e-6 * (skin_um + last);
      times.push_back(std::max(0.0, time - margin));
      times.push_back(std::min(last, time + margin));
    }
  }
  std::ranges::sort(times);
  const auto repeated = std::ranges::unique(times);
  times.erase(repeated.begin(), repeated.end());
  return times;
}

Rgb mean_albedo(const AppearanceOptions& options, const LookOfDepth& look, std::size_t side, double depth_um,
                bool corroded) {
  const bool even =
      std::ranges::all_of(options.layers, [](const ColourMap& map) { return map.values.size() == 1; });
  if (even) {
    return look.albedo(0.5, 0.5, depth_um, corroded);
  }
  std::array<double, 3> sum{};
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      const Rgb here =
          look.albedo((static_cast<double>(x) + 0.5) / static_cast<double>(side),
                      (static_cast<double>(y) + 0.5) / static_cast<double>(side), depth_um, corroded);
      for (std::size_t c = 0; c < 3; ++c) {
        sum[c] += here[c];
      }
    }
  }
  const auto cells = static_cast<double>(side * side);
  return {static_cast<float>(sum[0] / cells), static_cast<float>(sum[1] / cells),
          static_cast<float>(sum[2] / cells)};
}

/// Colours of a cell at its four layers are fitted by A phi + D with those of phi, by least squares.
struct Fit {
  double amplitude = 1;
  double constant = 0;
  double squares = 0;  ///< Sum of squared differences left.
};

Fit fit(const std::array<double, 4>& phi, const std::array<double, 4>& cell) {
  double phi_mean = 0;
  double cell_mean = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    phi_mean += phi[k] / 4;
    cell_mean += cell[k] / 4;
  }
  double both = 0;
  double own = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    both += (phi[k] - phi_mean) * (cell[k] - cell_mean);
    own += (phi[k] - phi_mean) * (phi[k] - phi_mean);
  }
  Fit result;
  result.amplitude = own > 0 ? both / own : 0;
  result.constant = cell_mean - result.amplitude * phi_mean;
  for (std::size_t k = 0; k < 4; ++k) {
    const double left = result.amplitude * phi[k] + result.constant - cell[k];
    result.squares += left * left;
  }
  return result;
}

/// A and D of the three colours where layers are textures; constants stay 1 and 0.
void fit_albedo(const AppearanceOptions& options, TimeVarying& varying) {
  if (std::ranges::all_of(options.layers, [](const ColourMap& map) { return map.values.size() == 1; })) {
    return;
  }
  const std::size_t side = varying.side;
  const std::size_t cells = side * side;
  std::vector<std::array<Rgb, 4>> colours(cells);
  std::array<std::array<double, 4>, 3> phi{};
  for (std::size_t i = 0; i < cells; ++i) {
    const double u = (static_cast<double>(i % side) + 0.5) / static_cast<double>(side);
    const double v = (static_cast<double>(i / side) + 0.5) / static_cast<double>(side);
    for (std::size_t layer = 0; layer < 4; ++layer) {
      colours[i][layer] = colour_at(options.layers[layer], u, v);
      for (std::size_t c = 0; c < 3; ++c) {
        phi[c][layer] += colours[i][layer][c] / static_cast<double>(cells);
      }
    }
  }
  double squares = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    Map amplitude{side, side, std::vector<float>(cells)};
    Map constant{side, side, std::vector<float>(cells)};
    for (std::size_t i = 0; i < cells; ++i) {
      std::array<double, 4> cell{};
      for (std::size_t layer = 0; layer < 4; ++layer) {
        cell[layer] = colours[i][layer][c];
      }
      const Fit fitted = fit(phi[c], cell);
      amplitude.values[i] = static_cast<float>(fitted.amplitude);
      constant.values[i] = static_cast<float>(fitted.constant);
      squares += fitted.squares;
    }
    varying.factors[c].amplitude = std::move(amplitude);
    varying.factors[c].constant = std::move(constant);
  }
  varying.albedo_error = static_cast<float>(std::sqrt(squares / static_cast<double>(12 * cells)));
}

void make_curves(const AppearanceOptions& options, const LookOfDepth& look, double skin_um,
                 double thickness_um, TimeVarying& varying) {
  const auto append = [&](double time, double depth_um, bool corroded) {
    const Rgb albedo = mean_albedo(options, look, varying.side, depth_um, corroded);
    Look values = look.rest(depth_um, corroded);
    std::ranges::copy(albedo, values.begin());
    for (std::size_t p = 0; p < kLookParameters; ++p) {
      varying.factors[p].phi.knots.push_back({time, values[p]});
    }
  };
  append(0, 0, false);
  for (const double time : knot_times(look, skin_um, std::max(0.0, thickness_um - skin_um))) {
    append(time, std::min(skin_um + time, thickness_um), true);
  }
}

}  // namespace

std::string_view name(LookParameter parameter) noexcept {
  return kNames[static_cast<std::size_t>(parameter)];
}

float TemporalCurve::at(double time) const noexcept {
  const auto after = std::ranges::upper_bound(knots, time, {}, &Knot::time);
  if (after == knots.begin()) {
    return knots.front().value;
  }
  const Knot& from = *(after - 1);
  if (after == knots.end() || from.value == after->value) {
    return from.value;
  }
  const double share = (time - from.time) / (after->time - from.time);
  return static_cast<float>(
      std::lerp(static_cast<double>(from.value), static_cast<double>(after->value), share));
}

Result<TimeVarying> TimeVarying::make(const Growth& growth, const AppearanceOptions& options) {
  const std::optional<FrontView> front = front_of(growth);
  if (!front) {
    return fail(
        ErrorCode::kInvalidArgument,
        "mode is thesis, expected physical: cells that lose metal by chance have no time of their own",
        "grow the sheet in mode physical");
  }
  if (const Status status = check(options); !status) {
    return std::unexpected(status.error());
  }
  const double thickness_um = growth.options().thickness_mm * 1000;
  const double skin_um = std::min(front->skin * thickness_um, thickness_um);
  TimeVarying varying{.side = growth.options().side, .extent_mm = growth.options().extent_mm};
  const std::size_t cells = varying.side * varying.side;
  varying.rate.resize(cells);
  varying.offset.resize(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    const double rate = std::max(static_cast<double>(front->rates[i]) * thickness_um, kSlowest_um_per_mm);
    varying.rate[i] = static_cast<float>(rate);
    const bool open = !front->opening.empty() && front->opening[i] != 0;
    varying.offset[i] = open ? -kInfinity
                             : static_cast<float>(static_cast<double>(varying.rate[i]) *
                                                  static_cast<double>(front->births_mm[i]));
  }
  const LookOfDepth look(options, thickness_um);
  make_curves(options, look, skin_um, thickness_um, varying);
  fit_albedo(options, varying);

  std::vector<double> ages(kTicks + 1);
  for (std::size_t k = 0; k <= kTicks; ++k) {
    const double share = static_cast<double>(k) / kTicks;
    ages[k] = growth.options().age_years * share * share;
  }
  const std::vector<double> clocks = front_clock_mm(growth, ages);
  for (std::size_t k = 0; k < ages.size(); ++k) {
    varying.clock.push_back({ages[k], clocks[k]});
  }
  return varying;
}

double TimeVarying::clock_mm(double age_years) const noexcept {
  const auto after = std::ranges::upper_bound(clock, age_years, {}, &Tick::age_years);
  if (after == clock.begin()) {
    return clock.front().clock_mm;
  }
  const Tick& from = *(after - 1);
  if (after == clock.end() || age_years == from.age_years) {
    return from.clock_mm;
  }
  const double share = (age_years - from.age_years) / (after->age_years - from.age_years);
  // Just after age 0 the clock starts at 0, not at the -1 that stands for "before everything".
  return std::lerp(std::max(from.clock_mm, 0.0), after->clock_mm, share);
}

float TimeVarying::value(LookParameter parameter, std::size_t cell, double clock_mm) const noexcept {
  const Factor& factor = factors[static_cast<std::size_t>(parameter)];
  const auto of = [cell](const Map& map) {
    return map.values.size() == 1 ? map.values[0] : map.values[cell];
  };
  return of(factor.amplitude) * factor.phi.at(local_time(cell, clock_mm)) + of(factor.constant);
}

std::vector<float> TimeVarying::map(LookParameter parameter, double clock_mm) const {
  std::vector<float> values(rate.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = value(parameter, i, clock_mm);
  }
  return values;
}

}  // namespace scatter::corrosion
