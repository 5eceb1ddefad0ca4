#include "host_sdk/measurement/light_sums.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <limits>

namespace scatter::measurement {
namespace {

constexpr std::size_t kBlock = 4096;

/// Averages one more batch into a pixel.
void average(float& rate, float& variance, float& weight, float new_rate, float new_variance,
             float new_weight) noexcept {
  if (!(new_weight > 0)) {
    return;
  }
  if (!(weight > 0)) {
    rate = new_rate;
    variance = new_variance;
    weight = new_weight;
    return;
  }
  const float total = weight + new_weight;
  const float a = weight / total;
  const float b = new_weight / total;
  rate = a * rate + b * new_rate;
  variance = a * a * variance + b * b * new_variance;
  weight = total;
}

}  // namespace

void LightSums::add(const FrameBatch& batch, const DarkModel& dark, const protocol::SensorInfo& sensor) {
  const std::vector<FrameBatch::Group> groups = batch.groups();
  std::vector<Planes*> targets;
  std::vector<bool> first;
  std::size_t pixels = 0;
  for (const FrameBatch::Group& group : groups) {
    Planes& planes = planes_[group.illumination];
    pixels = group.exposures.front().dn.size();
    first.push_back(planes.frames == 0);
    if (planes.frames == 0) {
      planes.image.rate.resize(pixels);
      planes.image.variance.resize(pixels);
      planes.weight.resize(pixels);
    }
    for (const Exposure& exposure : group.exposures) {
      planes.inverse_monitor =
          (planes.inverse_monitor * static_cast<double>(planes.frames) + 1.0 / exposure.monitor_v) /
          static_cast<double>(planes.frames + 1);
      ++planes.frames;
    }
    targets.push_back(&planes);
  }
  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, pixels, kBlock), [&](const auto& range) {
        std::array<float, kBlock> rate;
        std::array<float, kBlock> variance;
        std::array<float, kBlock> weight;
        for (std::size_t g = 0; g < groups.size(); ++g) {
          Planes& to = *targets[g];
          for (std::size_t begin = range.begin(); begin < range.end(); begin += kBlock) {
            const std::size_t n = std::min(kBlock, range.end() - begin);
            const auto part = [&](std::vector<float>& plane) { return std::span(plane).subspan(begin, n); };
            if (first[g]) {
              merge_exposures(groups[g].exposures, dark, sensor, begin,
                              {part(to.image.rate), part(to.image.variance), part(to.weight)});
              continue;
            }
            merge_exposures(
                groups[g].exposures, dark, sensor, begin,
                {std::span(rate).first(n), std::span(variance).first(n), std::span(weight).first(n)});
            for (std::size_t i = 0; i < n; ++i) {
              average(to.image.rate[begin + i], to.image.variance[begin + i], to.weight[begin + i], rate[i],
                      variance[i], weight[i]);
            }
          }
        }
      });
}

const LightSums::Planes* LightSums::find(std::uint8_t illumination) const noexcept {
  const auto at = planes_.find(illumination);
  return at == planes_.end() ? nullptr : &at->second;
}

}  // namespace scatter::measurement
