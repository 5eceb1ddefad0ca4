#include "simulator/corrosion/patina/layer_stack.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "simulator/corrosion/patina/rolling_ball.h"

namespace scatter::corrosion {
namespace {

constexpr std::size_t kLargestSide = 16384;
/// A metre: heights beyond are mistakes, and sums of a few stay finite.
constexpr float kHighest_um = 1e6F;
constexpr double kLargestBall_um = 1e4;

bool in_reach(double height_um) {
  return std::abs(height_um) <= static_cast<double>(kHighest_um);
}

std::unexpected<Error> invalid(std::string what, std::string remedy) {
  return fail(ErrorCode::kInvalidArgument, std::move(what), std::move(remedy));
}

}  // namespace

Result<LayerStack> LayerStack::bare(std::size_t side, double extent_mm) {
  if (side < 1 || side > kLargestSide) {
    return invalid(fmt::format("side is {}, expected 1..{}", side, kLargestSide),
                   "choose a side within the range");
  }
  return bare(side, extent_mm, std::vector<float>(side * side, 0.0F));
}

Result<LayerStack> LayerStack::bare(std::size_t side, double extent_mm, std::vector<float> relief_um) {
  if (side < 1 || side > kLargestSide) {
    return invalid(fmt::format("side is {}, expected 1..{}", side, kLargestSide),
                   "choose a side within the range");
  }
  if (!(extent_mm > 0) || !std::isfinite(extent_mm)) {
    return invalid(fmt::format("extent_mm is {}, expected more than 0", extent_mm), "give the piece a size");
  }
  if (relief_um.size() != side * side) {
    return invalid(fmt::format("relief has {} values, expected {}", relief_um.size(), side * side),
                   "give one value for each cell");
  }
  const auto bad = std::ranges::find_if_not(relief_um, [](float v) { return in_reach(v); });
  if (bad != relief_um.end()) {
    return invalid(
        fmt::format("relief: cell {} is {}, expected -1e6..1e6 [um]", bad - relief_um.begin(), *bad),
        "give heights within the range");
  }
  return LayerStack(side, extent_mm, std::move(relief_um));
}

Status LayerStack::check(std::span<const float> map_um, const char* what) const {
  if (map_um.size() != cells()) {
    return invalid(fmt::format("{} has {} values, expected {}", what, map_um.size(), cells()),
                   "give one value for each cell");
  }
  const auto bad = std::ranges::find_if_not(map_um, [](float v) { return v >= 0 && v <= kHighest_um; });
  if (bad != map_um.end()) {
    return invalid(fmt::format("{}: cell {} is {}, expected 0..1e6 [um]", what, bad - map_um.begin(), *bad),
                   "give values within the range");
  }
  return {};
}

std::vector<float>& LayerStack::top_layer(PatinaMaterial material) {
  if (layers_.empty() || layers_.back().material != material) {
    layers_.push_back({material, std::vector<float>(cells(), 0.0F)});
  }
  return layers_.back().thickness_um;
}

Result<double> LayerStack::coat(PatinaMaterial material, std::span<const float> thickness_um) {
  if (const Status status = check(thickness_um, "coat"); !status) {
    return std::unexpected(status.error());
  }
  std::vector<float>& layer = top_layer(material);
  double sum = 0;
  for (std::size_t i = 0; i < layer.size(); ++i) {
    layer[i] += thickness_um[i];
    sum += thickness_um[i];
  }
  return sum / static_cast<double>(cells());
}

Result<double> LayerStack::erode(std::span<const float> depth_um) {
  if (const Status status = check(depth_um, "erode"); !status) {
    return std::unexpected(status.error());
  }
  double sum = 0;
  for (std::size_t i = 0; i < depth_um.size(); ++i) {
    float left = depth_um[i];
    for (std::size_t k = layers_.size(); k-- > 0 && left > 0;) {
      float& thickness = layers_[k].thickness_um[i];
      const float taken = std::min(thickness, left);
      thickness -= taken;
      left -= taken;
      sum += taken;
    }
  }
  return sum / static_cast<double>(cells());
}

double LayerStack::raise_to(PatinaMaterial material, std::span<const float> target_um) {
  const std::vector<float> before = surface_um();
  std::vector<float>& layer = top_layer(material);
  double sum = 0;
  for (std::size_t i = 0; i < layer.size(); ++i) {
    if (const float missing = target_um[i] - before[i]; missing > 0) {
      layer[i] += missing;
      sum += missing;
    }
  }
  return sum / static_cast<double>(cells());
}

Result<double> LayerStack::fill(PatinaMaterial material, double level_um) {
  if (!in_reach(level_um)) {
    return invalid(fmt::format("fill: level_um is {}, expected -1e6..1e6", level_um),
                   "choose a level within the range");
  }
  return raise_to(material, std::vector<float>(cells(), static_cast<float>(level_um)));
}

Result<double> LayerStack::polish(double level_um) {
  if (!in_reach(level_um)) {
    return invalid(fmt::format("polish: level_um is {}, expected -1e6..1e6", level_um),
                   "choose a level within the range");
  }
  const std::vector<float> before = surface_um();
  double sum = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    float left = before[i] - static_cast<float>(level_um);
    if (left <= 0) {
      continue;
    }
    sum += left;
    for (std::size_t k = layers_.size(); k-- > 0 && left > 0;) {
      float& thickness = layers_[k].thickness_um[i];
      const float taken = std::min(thickness, left);
      thickness -= taken;
      left -= taken;
    }
    if (left > 0) {
      metal_um_[i] = static_cast<float>(level_um);
    }
  }
  return sum / static_cast<double>(cells());
}

Result<double> LayerStack::offset(PatinaMaterial material, double radius_um) {
  if (!(radius_um >= 0 && radius_um <= kLargestBall_um)) {
    return invalid(fmt::format("offset: radius_um is {}, expected 0..{}", radius_um, kLargestBall_um),
                   "choose a radius within the range");
  }
  return raise_to(material, closed_by_ball(surface_um(), side_, cell_um(), radius_um));
}

std::vector<float> LayerStack::surface_um() const {
  std::vector<float> surface = metal_um_;
  for (const PatinaLayer& layer : layers_) {
    for (std::size_t i = 0; i < surface.size(); ++i) {
      surface[i] += layer.thickness_um[i];
    }
  }
  return surface;
}

double LayerStack::mean_um(PatinaMaterial material) const noexcept {
  double sum = 0;
  for (const PatinaLayer& layer : layers_) {
    if (layer.material == material) {
      for (const float thickness : layer.thickness_um) {
        sum += thickness;
      }
    }
  }
  return sum / static_cast<double>(cells());
}

}  // namespace scatter::corrosion
