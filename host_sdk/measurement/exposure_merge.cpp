#include "host_sdk/measurement/exposure_merge.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace scatter::measurement {
namespace {

constexpr std::size_t kBlock = 1024;  // Pixels at a time: all scratch stays in the first-level cache.

struct Scratch {
  std::array<float, kBlock> pooled_e;
  std::array<float, kBlock> pooled_t;
  std::array<float, kBlock> longest_s;  // Longest exposure that this pixel may use.
  std::array<float, kBlock> weight;
  std::array<float, kBlock> sum;
  std::array<float, kBlock> offset_share;
};

/// The same for every pixel of a frame.
struct FrameTerms {
  float t_s;
  float tm;    // Exposure times monitor.
  float dark;  // Growth of the dark current.
};

struct SensorTerms {
  float gain;
  float c_over_well;
  float usable_e;
  float saturation_dn;
  float read_variance_e2;
};

/// Pixel inputs of a block.
struct Block {
  const std::uint16_t* dn;
  const float* offset_dn;
  const float* dark_rate;
  const float* ambient_rate;
  std::size_t n;
};

// Lets a pixel use the next longer exposure when all shorter ones together predict that it fits.
[[gnu::target_clones("avx2", "default")]] void admit(const FrameTerms& f, float previous_s, float usable_e,
                                                     std::size_t n, Scratch& s) {
  for (std::size_t i = 0; i < n; ++i) {
    const bool fits = s.pooled_e[i] * f.tm < usable_e * s.pooled_t[i];
    s.longest_s[i] = fits && s.longest_s[i] == previous_s ? f.t_s : s.longest_s[i];
  }
}

[[gnu::target_clones("avx2", "default")]] void pool(const Block& b, const FrameTerms& f, const SensorTerms& k,
                                                    Scratch& s) {
  for (std::size_t i = 0; i < b.n; ++i) {
    const float counts = static_cast<float>(b.dn[i]);
    const float q = (counts - b.offset_dn[i]) * k.gain;
    const float u = k.c_over_well * q;
    const float background = (b.dark_rate[i] * f.dark + b.ambient_rate[i]) * f.t_s;
    const float e = q * (1.0F - u * (1.0F - u * (2.0F - 5.0F * u))) - background;
    const bool use = s.longest_s[i] >= f.t_s && counts < k.saturation_dn;
    s.pooled_e[i] += use ? e : 0.0F;
    s.pooled_t[i] += use ? f.tm : 0.0F;
  }
}

[[gnu::target_clones("avx2", "default")]] void weigh(const Block& b, const FrameTerms& f,
                                                     const SensorTerms& k, Scratch& s) {
  const float inverse_tm = 1.0F / f.tm;
  for (std::size_t i = 0; i < b.n; ++i) {
    const float counts = static_cast<float>(b.dn[i]);
    const float q = (counts - b.offset_dn[i]) * k.gain;
    const float u = k.c_over_well * q;
    const float background = (b.dark_rate[i] * f.dark + b.ambient_rate[i]) * f.t_s;
    const float e = q * (1.0F - u * (1.0F - u * (2.0F - 5.0F * u))) - background;
    const bool use = s.longest_s[i] >= f.t_s && counts < k.saturation_dn;
    const float predicted_e = s.pooled_e[i] / std::max(s.pooled_t[i], 1e-20F) * f.tm;
    const float variance = std::max(predicted_e, 0.0F) + std::max(background, 0.0F) + k.read_variance_e2;
    const float w = use ? f.tm * f.tm / variance : 0.0F;
    s.weight[i] += w;
    s.sum[i] += w * e * inverse_tm;
    s.offset_share[i] += w * inverse_tm;
  }
}

}  // namespace

SensorResponse::SensorResponse(const protocol::SensorInfo& s) noexcept
    : gain_(s.gain_e_per_dn),
      c_over_well_(s.linearity / s.full_well_e),
      read_variance_(s.read_noise_e * s.read_noise_e + s.gain_e_per_dn * s.gain_e_per_dn / 12.0F),
      full_well_(s.full_well_e) {
  const float top_dn = static_cast<float>((1U << s.bits) - 1U);
  const float well_dn = s.black_level_dn + s.full_well_e * (1.0F + s.linearity) / s.gain_e_per_dn;
  const float limit_dn = std::min(top_dn, well_dn);
  saturation_dn_ = static_cast<std::uint16_t>(limit_dn - 0.01F * (limit_dn - s.black_level_dn));
  usable_ = 0.9F * (limit_dn - s.black_level_dn) * s.gain_e_per_dn;
}

double dark_growth(const protocol::SensorInfo& sensor, const DarkModel& dark,
                   std::int32_t temperature_mK) noexcept {
  return std::exp2(1e-3 * (temperature_mK - dark.sensor_temperature_mK) /
                   static_cast<double>(sensor.dark_doubling_K));
}

AmbientImage ambient_image(std::span<const Exposure> frames, const DarkModel& dark,
                           const protocol::SensorInfo& sensor) {
  AmbientImage image;
  if (frames.empty()) {
    return image;
  }
  const std::size_t count = frames.front().dn.size();
  const AmbientImage none{std::vector<float>(count, 0.0F), {}};
  image.rate_e_per_s.resize(count);
  image.variance.resize(count);
  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, count, 16 * kBlock), [&](const auto& range) {
        merge_exposures(frames, dark, none, sensor, range.begin(),
                        std::span(image.rate_e_per_s).subspan(range.begin(), range.size()),
                        std::span(image.variance).subspan(range.begin(), range.size()));
      });
  // A pixel that saturates without light (hot) carries no information; the hot-pixel mask hides it.
  for (std::size_t p = 0; p < count; ++p) {
    if (std::isinf(image.variance[p])) {
      image.rate_e_per_s[p] = 0;
      image.variance[p] = 0;
    }
  }
  return image;
}

void merge_exposures(std::span<const Exposure> frames, const DarkModel& dark, const AmbientImage& ambient,
                     const protocol::SensorInfo& sensor, std::size_t first, std::span<float> rate,
                     std::span<float> variance) {
  const SensorResponse response(sensor);
  const SensorTerms terms{response.gain_e_per_dn(), sensor.linearity / sensor.full_well_e,
                          response.usable_e(), static_cast<float>(response.saturation_dn()),
                          response.read_variance_e2()};
  const std::array<float, kBlock> zeros{};
  Scratch s;
  for (std::size_t begin = 0; begin < rate.size(); begin += kBlock) {
    const std::size_t n = std::min(kBlock, rate.size() - begin);
    const std::size_t p = first + begin;
    const float* offset = dark.offset_dn.data() + p;
    const float* dark_rate = dark.dark_rate_e_per_s.data() + p;
    const float* ambient_rate = ambient.rate_e_per_s.empty() ? zeros.data() : ambient.rate_e_per_s.data() + p;
    s.pooled_e.fill(0);
    s.pooled_t.fill(0);
    s.longest_s.fill(static_cast<float>(frames.front().exposure_s));
    s.weight.fill(0);
    s.sum.fill(0);
    s.offset_share.fill(0);
    float previous_s = static_cast<float>(frames.front().exposure_s);
    for (int pass = 0; pass < 2; ++pass) {
      for (const Exposure& frame : frames) {
        const FrameTerms f{static_cast<float>(frame.exposure_s),
                           static_cast<float>(frame.exposure_s * frame.monitor_v),
                           static_cast<float>(dark_growth(sensor, dark, frame.sensor_temperature_mK))};
        const Block block{frame.dn.data() + p, offset, dark_rate, ambient_rate, n};
        if (pass == 1) {
          weigh(block, f, terms, s);
          continue;
        }
        if (f.t_s > previous_s) {
          admit(f, previous_s, terms.usable_e, n, s);
          previous_s = f.t_s;
        }
        pool(block, f, terms, s);
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (s.weight[i] > 0) {
        const float inverse = 1.0F / s.weight[i];
        const float share = s.offset_share[i] * inverse;  // d rate / d offset electron
        rate[begin + i] = s.sum[i] * inverse;
        variance[begin + i] = inverse + share * share * dark.offset_variance_dn2 * terms.gain * terms.gain;
      } else {
        rate[begin + i] = 0;
        variance[begin + i] = std::numeric_limits<float>::infinity();
      }
    }
    if (!ambient.variance.empty()) {
      // The ambient image is subtracted per second of exposure; in units per volt it is divided by
      // the mean monitor reading, for which the first frame's stands well enough.
      const auto monitor = static_cast<float>(frames.front().monitor_v);
      for (std::size_t i = 0; i < n; ++i) {
        variance[begin + i] += ambient.variance[p + i] / (monitor * monitor);
      }
    }
  }
}

}  // namespace scatter::measurement
