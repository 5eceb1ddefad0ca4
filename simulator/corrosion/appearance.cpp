#include "simulator/corrosion/appearance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "simulator/corrosion/interpolation.h"

namespace scatter::corrosion {
namespace {

Rgb mix(const Rgb& a, const Rgb& b, float share) noexcept {
  Rgb out{};
  for (std::size_t c = 0; c < out.size(); ++c) {
    out[c] = a[c] * (1 - share) + b[c] * share;
  }
  return out;
}

/// Where `at` lies between rising `knots`: the lower knot and the share of the next one.
struct Between {
  std::size_t lower;
  float share;
};
Between between(std::span<const float> knots, float at) noexcept {
  if (!(at > knots.front())) {
    return {0, 0.0F};
  }
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    if (at < knots[k + 1]) {
      return {k, (at - knots[k]) / (knots[k + 1] - knots[k])};
    }
  }
  return {knots.size() - 1, 0.0F};
}

struct Corner {
  std::size_t low;
  std::size_t high;
  double share;  ///< Of the high one.
};
Corner repeated(double share_of_map, std::size_t cells) noexcept {
  const double count = static_cast<double>(cells);
  const double at = (share_of_map - std::floor(share_of_map)) * count - 0.5;
  const double floor = std::floor(at);
  const auto low = static_cast<std::size_t>(floor < 0 ? count - 1 : std::min(floor, count - 1));
  return {low, (low + 1) % cells, at - floor};
}

Status check_falling(const AppearanceOptions& options) {
  const auto& depths = options.layer_depths_um;
  if (!(depths[2] >= 0 && depths[1] > depths[2] && depths[0] > depths[1] && std::isfinite(depths[0]))) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("layer depths are {}, {}, {} um, expected falling ones >= 0 for layers 0, 1, 2",
                            depths[0], depths[1], depths[2]),
                "give the deepest layer first, for example 700,180,5");
  }
  const auto& limits = options.layer_limits;
  if (!(limits[0] >= 0 && limits[1] > limits[0] && limits[2] > limits[1] && limits[3] > limits[2] &&
        limits[3] <= 1)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("layer limits are {}, {}, {}, {}, expected rising shares of the thickness, 0..1",
                            limits[0], limits[1], limits[2], limits[3]),
                "give the deepest layer first, for example 0,0.33,0.67,1");
  }
  return {};
}

/// Slope of the surface in mm per mm along one axis from the heights on both sides.
class Slopes {
 public:
  Slopes(const Sheet& sheet, const AppearanceOptions& options) : sheet_(sheet) {
    if (options.bump.values.size() > 1) {
      bumped_ = on_grid(options.bump, sheet.side);
      for (std::size_t n = 0; n < bumped_.size(); ++n) {
        bumped_[n] *= sheet.height[n];
      }
    }
  }

  [[nodiscard]] std::array<float, 3> normal(std::size_t x, std::size_t y) const noexcept {
    const std::vector<float>& height = bumped_.empty() ? sheet_.height : bumped_;
    const std::size_t side = sheet_.side;
    const auto [left, right] = neighbours(x);
    const auto [above, below] = neighbours(y);
    const auto scale = static_cast<float>(sheet_.thickness_mm / sheet_.cell_mm());
    const auto steps = [&](std::size_t low, std::size_t high, std::size_t at) {
      return static_cast<float>((low != at ? 1 : 0) + (high != at ? 1 : 0));
    };
    const float dx = (height[y * side + right] - height[y * side + left]) * scale / steps(left, right, x);
    const float dy = (height[above * side + x] - height[below * side + x]) * scale / steps(above, below, y);
    const float length = std::sqrt(dx * dx + dy * dy + 1);
    return {-dx / length, -dy / length, 1 / length};
  }

 private:
  struct Pair {
    std::size_t before;
    std::size_t after;
  };
  [[nodiscard]] Pair neighbours(std::size_t at) const noexcept {
    const std::size_t last = sheet_.side - 1;
    if (sheet_.toroidal) {
      return {at == 0 ? last : at - 1, at == last ? 0 : at + 1};
    }
    return {at == 0 ? 0 : at - 1, at == last ? last : at + 1};
  }

  const Sheet& sheet_;
  std::vector<float> bumped_;
};

Status check_colours(const ColourMap& map, std::size_t layer) {
  const auto wrong = [layer](std::string_view what) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("layer {}: {}", layer, what),
                "give colours of 0..1 in each channel");
  };
  if (map.width < 1 || map.height < 1 || map.values.size() != map.width * map.height) {
    return wrong(fmt::format("{} x {} cells, but {} values", map.width, map.height, map.values.size()));
  }
  for (std::size_t n = 0; n < map.values.size(); ++n) {
    for (const float value : map.values[n]) {
      if (!(value >= 0 && value <= 1)) {
        return wrong(
            fmt::format("{} at column {}, row {}, expected 0..1", value, n % map.width, n / map.width));
      }
    }
  }
  return {};
}

}  // namespace

Status check(const AppearanceOptions& options) {
  for (std::size_t layer = 0; layer < options.layers.size(); ++layer) {
    if (Status status = check_colours(options.layers[layer], layer); !status) {
      return status;
    }
  }
  if (!(options.metal_roughness >= 0.01F && options.metal_roughness <= 1)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("metal roughness is {}, expected 0.01..1", options.metal_roughness),
                "choose a GGX alpha");
  }
  if (Status status = check(options.bump, "bump", 0, 1); !status) {
    return status;
  }
  return check_falling(options);
}

Rgb colour_at(const ColourMap& map, double u, double v) noexcept {
  if (map.values.size() == 1) {
    return map.values.front();
  }
  const Corner x = repeated(u, map.width);
  const Corner y = repeated(v, map.height);
  Rgb out{};
  for (std::size_t c = 0; c < out.size(); ++c) {
    const auto at = [&](std::size_t column, std::size_t row) {
      return static_cast<double>(map.values[row * map.width + column][c]);
    };
    const double top = at(x.low, y.low) * (1 - x.share) + at(x.high, y.low) * x.share;
    const double bottom = at(x.low, y.high) * (1 - x.share) + at(x.high, y.high) * x.share;
    out[c] = static_cast<float>(top * (1 - y.share) + bottom * y.share);
  }
  return out;
}

Rgb colour(const AppearanceOptions& options, double u, double v, float height, float depth_um,
           float rust) noexcept {
  const auto layer = [&](std::size_t n) { return colour_at(options.layers[n], u, v); };
  if (options.rule == LookRule::kByHeight) {
    const auto [lower, share] = between(options.layer_limits, height);
    return share > 0 ? mix(layer(lower), layer(lower + 1), share) : layer(lower);
  }
  if (!(rust > 0)) {
    return layer(3);
  }
  const auto& falling = options.layer_depths_um;
  const auto [lower, share] = between(std::array{falling[2], falling[1], falling[0]}, depth_um);
  const Rgb rusty = share > 0 ? mix(layer(2 - lower), layer(1 - lower), share) : layer(2 - lower);
  return rust < 1 ? mix(layer(3), rusty, rust) : rusty;
}

float rust_roughness(float depth_um) noexcept {
  return 0.40F + 0.40F * (1 - std::exp(-depth_um / 60));
}

float rust_porosity(float depth_um) noexcept {
  return 0.10F + 0.45F * (1 - std::exp(-depth_um / 100));
}

Appearance appearance(const Sheet& sheet, const AppearanceOptions& options) {
  const std::size_t cells = sheet.cells();
  Appearance look;
  look.side = sheet.side;
  look.albedo.resize(cells);
  look.regime.resize(cells);
  look.metalness.resize(cells);
  look.roughness.resize(cells);
  look.porosity.resize(cells);
  look.opacity.resize(cells);
  look.normal.resize(cells);
  const Slopes slopes(sheet, options);
  const bool by_state = options.rule == LookRule::kByState;
  const auto side = static_cast<double>(sheet.side);
  for (std::size_t y = 0; y < sheet.side; ++y) {
    for (std::size_t x = 0; x < sheet.side; ++x) {
      const std::size_t n = y * sheet.side + x;
      const float height = sheet.height[n];
      const auto depth_um = static_cast<float>(sheet.thickness_mm * 1000 * (1 - static_cast<double>(height)));
      Regime regime = Regime::kMetal;
      if (by_state) {
        regime = sheet.state[n] == CellState::kHole        ? Regime::kHole
                 : sheet.state[n] >= CellState::kSpreading ? Regime::kRust
                                                           : Regime::kMetal;
      } else {
        regime = regime_of_height(height);
      }
      const bool metal = regime == Regime::kMetal;
      look.regime[n] = regime;
      look.metalness[n] = metal ? 1.0F : 0.0F;
      look.opacity[n] = regime == Regime::kHole ? 0.0F : 1.0F;
      look.roughness[n] = metal ? options.metal_roughness : rust_roughness(depth_um);
      look.porosity[n] = metal ? 0.0F : rust_porosity(depth_um);
      look.albedo[n] = colour(options, (static_cast<double>(x) + 0.5) / side,
                              (static_cast<double>(y) + 0.5) / side, height, depth_um, metal ? 0.0F : 1.0F);
      look.normal[n] = slopes.normal(x, y);
    }
  }
  return look;
}

}  // namespace scatter::corrosion
