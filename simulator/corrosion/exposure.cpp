#include "simulator/corrosion/exposure.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace scatter::corrosion {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr float kInside = 0.5F;

/// Lower envelope of the parabolas height[i] + (step (x - i))^2, read at whole x; works on one line at a
/// time.
class Envelope {
 public:
  Envelope(std::size_t count, double step, bool toroidal)
      : count_(count), step_squared_(step * step), toroidal_(toroidal) {}

  /// Replaces each height by the least of all parabolas there.
  void lower(std::span<double> heights) {
    roots_.clear();
    const auto n = static_cast<std::ptrdiff_t>(count_);
    // One copy of the line before and one behind it hold all that can be nearest on a torus.
    const std::ptrdiff_t begin = toroidal_ ? -n : 0;
    const std::ptrdiff_t end = toroidal_ ? 2 * n : n;
    for (std::ptrdiff_t i = begin; i < end; ++i) {
      const double height = heights[static_cast<std::size_t>((i + n) % n)];
      if (height < kFar) {
        add({.at = static_cast<double>(i), .height = height, .from = -kFar});
      }
    }
    if (roots_.empty()) {
      return;
    }
    std::size_t k = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const auto x = static_cast<double>(i);
      while (k + 1 < roots_.size() && roots_[k + 1].from <= x) {
        ++k;
      }
      const double way = x - roots_[k].at;
      heights[i] = roots_[k].height + step_squared_ * way * way;
    }
  }

 private:
  struct Parabola {
    double at = 0;
    double height = 0;
    double from = 0;  ///< Lowest from here to the next one's.
  };

  void add(Parabola next) {
    while (!roots_.empty()) {
      const Parabola& last = roots_.back();
      next.from =
          (next.at + last.at) / 2 + (next.height - last.height) / (2 * step_squared_ * (next.at - last.at));
      if (next.from > last.from) {
        break;
      }
      roots_.pop_back();
    }
    if (roots_.empty()) {
      next.from = -kFar;
    }
    roots_.push_back(next);
  }

  std::size_t count_;
  double step_squared_;
  bool toroidal_;
  std::vector<Parabola> roots_;
};

Status within(const char* parameter, double value, double lowest, double highest, const char* unit) {
  // Written so that it is true for a NaN.
  if (!(value >= lowest && value <= highest)) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{}: is {}{}", parameter, value, unit),
                fmt::format("give {} to {}{}", lowest, highest, unit));
  }
  return {};
}

/// inside where the mask is, 1 + gain exp(-d / reach) elsewhere.
Map falling_off(const Map& mask, double extent_mm, Border border, double inside, double gain,
                double reach_mm) {
  Map exposure = distance_to(mask, extent_mm, border);
  for (std::size_t i = 0; i < exposure.values.size(); ++i) {
    exposure.values[i] =
        mask.values[i] >= kInside
            ? static_cast<float>(inside)
            : static_cast<float>(1 + gain * std::exp(-static_cast<double>(exposure.values[i]) / reach_mm));
  }
  return exposure;
}

Status check_mask(const Map& mask, const char* parameter, double extent_mm) {
  if (const Status checked = check(mask, parameter, 0, 1); !checked) {
    return checked;
  }
  return within("extent_mm", extent_mm, 0.1, 10000, " mm");
}

}  // namespace

Map distance_to(const Map& mask, double extent_mm, Border border) {
  const bool toroidal = border == Border::kToroidal;
  const double step_x = extent_mm / static_cast<double>(mask.width);
  const double step_y = extent_mm / static_cast<double>(mask.height);
  std::vector<double> squared(mask.values.size());
  std::transform(mask.values.begin(), mask.values.end(), squared.begin(),
                 [](float value) { return value >= kInside ? 0.0 : kFar; });
  Envelope columns(mask.height, step_y, toroidal);
  std::vector<double> column(mask.height);
  for (std::size_t x = 0; x < mask.width; ++x) {
    for (std::size_t y = 0; y < mask.height; ++y) {
      column[y] = squared[y * mask.width + x];
    }
    columns.lower(column);
    for (std::size_t y = 0; y < mask.height; ++y) {
      squared[y * mask.width + x] = column[y];
    }
  }
  Envelope rows(mask.width, step_x, toroidal);
  Map distance{mask.width, mask.height, std::vector<float>(mask.values.size())};
  const double half = std::min(step_x, step_y) / 2;
  for (std::size_t y = 0; y < mask.height; ++y) {
    const std::span<double> row = std::span(squared).subspan(y * mask.width, mask.width);
    rows.lower(row);
    for (std::size_t x = 0; x < mask.width; ++x) {
      distance.values[y * mask.width + x] = static_cast<float>(std::max(std::sqrt(row[x]) - half, 0.0));
    }
  }
  return distance;
}

Result<Map> aeration_exposure(const Map& cover, double extent_mm, Border border,
                              const AerationOptions& options) {
  for (const Status& status :
       {check_mask(cover, "cover", extent_mm), within("covered", options.covered, 0, 1, ""),
        within("edge_gain", options.edge_gain, 0, 1000, ""),
        within("reach_mm", options.reach_mm, 1e-3, 10000, " mm")}) {
    if (!status) {
      return std::unexpected(status.error());
    }
  }
  return falling_off(cover, extent_mm, border, options.covered, options.edge_gain, options.reach_mm);
}

Result<Map> galvanic_exposure(const Map& contact, double extent_mm, Border border,
                              const GalvanicOptions& options) {
  for (const Status& status :
       {check_mask(contact, "contact", extent_mm), within("contact_gain", options.contact_gain, 0, 1000, ""),
        within("reach_mm", options.reach_mm, 1e-3, 10000, " mm")}) {
    if (!status) {
      return std::unexpected(status.error());
    }
  }
  const auto nobler = static_cast<double>(std::count_if(contact.values.begin(), contact.values.end(),
                                                        [](float value) { return value >= kInside; }));
  const double rest = static_cast<double>(contact.values.size()) - nobler;
  if (rest == 0) {
    return fail(ErrorCode::kInvalidArgument,
                "contact: covers the whole sheet, so no metal is left to corrode",
                "give a mask with values below 0.5");
  }
  return falling_off(contact, extent_mm, border, 0, options.contact_gain * nobler / rest, options.reach_mm);
}

Result<Map> product(const Map& first, const Map& second) {
  if (first.values.size() != 1 && second.values.size() != 1 &&
      (first.width != second.width || first.height != second.height)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("exposure: maps of {} x {} and {} x {} cells cannot be multiplied", first.width,
                            first.height, second.width, second.height),
                "give maps of one size");
  }
  Map result = first.values.size() == 1 ? second : first;
  const Map& other = first.values.size() == 1 ? first : second;
  for (std::size_t i = 0; i < result.values.size(); ++i) {
    result.values[i] *= other.values[other.values.size() == 1 ? 0 : i];
  }
  return result;
}

}  // namespace scatter::corrosion
