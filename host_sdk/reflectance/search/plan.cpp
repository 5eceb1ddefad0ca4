#include "host_sdk/reflectance/search/plan.h"

#include <algorithm>
#include <cmath>

namespace scatter::search {

void deal_children(std::size_t children, std::size_t groups, std::span<const std::size_t> size,
                   std::span<std::size_t> share) noexcept {
  std::fill_n(share.begin(), groups, std::size_t{1});
  for (std::size_t given = groups; given < children; ++given) {
    std::size_t fullest = 0;
    for (std::size_t g = 1; g < groups; ++g) {
      fullest = size[g] * share[fullest] > size[fullest] * share[g] ? g : fullest;
    }
    ++share[fullest];
  }
}

std::size_t incidence_axis(const Box& box) noexcept {
  const bool x_same = box.lo[0] == box.hi[0];
  const bool y_same = box.lo[1] == box.hi[1];
  return x_same == y_same ? kAxes : x_same ? 1 : 0;
}

// A last value of `bins` less one step: the largest component falls into the last bin.
float bin_scale(const Box& box, std::size_t axis, std::size_t bins) noexcept {
  return (static_cast<float>(bins) - 0.01F) / (box.hi[axis] - box.lo[axis]);
}

bool make_plan(const Box& box, std::size_t children, std::size_t bins, std::size_t incidences,
               Plan& plan) noexcept {
  std::array<std::size_t, kAxes> parts{1, 1, 1, 1};
  std::array<float, kAxes> side{};
  for (std::size_t a = incidences > 0 ? 2 : 0; a < kAxes; ++a) {
    side[a] = box.hi[a] - box.lo[a];
  }
  for (std::size_t cells = std::max<std::size_t>(incidences, 1); cells < children; cells *= 2) {
    const auto a = static_cast<std::size_t>(std::max_element(side.begin(), side.end()) - side.begin());
    side[a] *= 0.5F;
    parts[a] *= 2;
  }
  if (incidences > 0) {
    const std::size_t a = incidence_axis(box);
    plan.axes[plan.count++] = {a, children, box.lo[a], bin_scale(box, a, bins)};
  }
  std::array<std::size_t, kAxes> order{0, 1, 2, 3};
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return parts[a] > parts[b]; });
  for (const std::size_t a : order) {
    if (parts[a] == 1) {
      continue;
    }
    const float scale = bin_scale(box, a, bins);
    if (!(scale > 0) || !std::isfinite(scale)) {
      return false;
    }
    plan.axes[plan.count++] = {a, parts[a], box.lo[a], scale};
  }
  return true;
}

}  // namespace scatter::search
