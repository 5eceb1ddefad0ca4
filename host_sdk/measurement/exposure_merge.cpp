#include "host_sdk/measurement/exposure_merge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "host_sdk/simd/vector_clones.h"

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
  std::size_t n;
};

// Neighbours on either side whose rates predict a pixel's next exposure.
constexpr std::size_t kReach = 4;

// Lets a pixel use the next longer exposure when the shorter exposures of its neighbours predict that
// it fits. The pixel's own rate has no say: it would keep the pixels that came out high by chance.
SCATTER_VECTOR_CLONES void admit(const FrameTerms& f, float previous_s, float usable_e, std::size_t n,
                                 Scratch& s) {
  std::array<float, kBlock + 2 * kReach> e;
  std::array<float, kBlock + 2 * kReach> t;
  e.fill(0);
  t.fill(0);
  std::copy_n(s.pooled_e.begin(), n, e.begin() + kReach);
  std::copy_n(s.pooled_t.begin(), n, t.begin() + kReach);
  for (std::size_t i = 0; i < n; ++i) {
    float near_e = 0;
    float near_t = 0;
    for (std::size_t k = 0; k < kReach; ++k) {
      near_e += e[i + k] + e[i + kReach + 1 + k];
      near_t += t[i + k] + t[i + kReach + 1 + k];
    }
    const float now_s = s.longest_s[i];
    const float longer_s = now_s == previous_s ? f.t_s : now_s;
    s.longest_s[i] = near_e * f.tm < usable_e * near_t ? longer_s : now_s;
  }
}

// The two loops below see every pixel of every frame. They are written for the vectoriser: plain
// pointers to planes that do not overlap (ivdep), choices as selections, no early exits.
SCATTER_VECTOR_CLONES void pool(const Block& b, const FrameTerms& f, const SensorTerms& k, Scratch& s) {
  const std::uint16_t* dn = b.dn;
  const float* offset = b.offset_dn;
  const float* dark = b.dark_rate;
  const float* longest = s.longest_s.data();
  float* pooled_e = s.pooled_e.data();
  float* pooled_t = s.pooled_t.data();
  const float gain = k.gain;
  const float c = k.c_over_well;
  const float saturation = k.saturation_dn;
  const float growth = f.dark;
  const float t_s = f.t_s;
  const float tm = f.tm;
  const std::size_t n = b.n;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const float counts = static_cast<float>(static_cast<int>(dn[i]));
    const float q = (counts - offset[i]) * gain;
    const float u = c * q;
    const float background = dark[i] * growth * t_s;
    const float e = q * (1.0F - u * (1.0F - u * (2.0F - 5.0F * u))) - background;
    const float allowed = longest[i] >= t_s ? 1.0F : 0.0F;
    const float use = counts < saturation ? allowed : 0.0F;
    pooled_e[i] += use * e;
    pooled_t[i] += use * tm;
  }
}

SCATTER_VECTOR_CLONES void weigh(const Block& b, const FrameTerms& f, const SensorTerms& k, Scratch& s) {
  const std::uint16_t* dn = b.dn;
  const float* offset = b.offset_dn;
  const float* dark = b.dark_rate;
  const float* longest = s.longest_s.data();
  const float* pooled_rate = s.pooled_e.data();  // Divided by pooled_t by now.
  float* weight = s.weight.data();
  float* sum = s.sum.data();
  float* offset_share = s.offset_share.data();
  const float inverse_tm = 1.0F / f.tm;
  const float tm2 = f.tm * f.tm;
  const float gain = k.gain;
  const float c = k.c_over_well;
  const float saturation = k.saturation_dn;
  const float growth = f.dark;
  const float t_s = f.t_s;
  const float tm = f.tm;
  const std::size_t n = b.n;
  const float read_variance = k.read_variance_e2;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const float counts = static_cast<float>(static_cast<int>(dn[i]));
    const float q = (counts - offset[i]) * gain;
    const float u = c * q;
    const float background = dark[i] * growth * t_s;
    const float e = q * (1.0F - u * (1.0F - u * (2.0F - 5.0F * u))) - background;
    const float allowed = longest[i] >= t_s ? 1.0F : 0.0F;
    const float use = counts < saturation ? allowed : 0.0F;
    const float predicted_e = pooled_rate[i] * tm;
    const float light_e = predicted_e > 0.0F ? predicted_e : 0.0F;
    const float background_e = background > 0.0F ? background : 0.0F;
    const float w = use * tm2 / (light_e + background_e + read_variance);
    weight[i] += w;
    sum[i] += w * e * inverse_tm;
    offset_share[i] += w * inverse_tm;
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

std::vector<float> distinct_exposures(std::vector<float> exposures_s_v) {
  std::ranges::sort(exposures_s_v);
  std::vector<float> out;
  for (const float exposure : exposures_s_v) {
    if (out.empty() || exposure > 1.05F * out.back()) {
      out.push_back(exposure);
    }
  }
  return out;
}

void merge_exposures(std::span<const Exposure> frames, const DarkModel& dark,
                     const protocol::SensorInfo& sensor, std::size_t first, const MergedPixels& out) {
  const SensorResponse response(sensor);
  const SensorTerms terms{response.gain_e_per_dn(), sensor.linearity / sensor.full_well_e,
                          response.usable_e(), static_cast<float>(response.saturation_dn()),
                          response.read_variance_e2()};
  Scratch s;
  for (std::size_t begin = 0; begin < out.rate.size(); begin += kBlock) {
    const std::size_t n = std::min(kBlock, out.rate.size() - begin);
    const std::size_t p = first + begin;
    const float* offset = dark.offset_dn.data() + p;
    const float* dark_rate = dark.dark_rate_e_per_s.data() + p;
    s.pooled_e.fill(0);
    s.pooled_t.fill(0);
    s.longest_s.fill(static_cast<float>(frames.front().exposure_s));
    s.weight.fill(0);
    s.sum.fill(0);
    s.offset_share.fill(0);
    float previous_s = static_cast<float>(frames.front().exposure_s);
    for (int pass = 0; pass < 2; ++pass) {
      if (pass == 1) {
        for (std::size_t i = 0; i < n; ++i) {
          s.pooled_e[i] /= s.pooled_t[i] > 0.0F ? s.pooled_t[i] : 1.0F;
        }
      }
      for (const Exposure& frame : frames) {
        const FrameTerms f{static_cast<float>(frame.exposure_s),
                           static_cast<float>(frame.exposure_s * frame.monitor_v),
                           static_cast<float>(dark_growth(sensor, dark, frame.sensor_temperature_mK))};
        const Block block{frame.dn.data() + p, offset, dark_rate, n};
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
        out.rate[begin + i] = s.sum[i] * inverse;
        out.weight[begin + i] = s.pooled_t[i];
        out.variance[begin + i] =
            inverse + share * share * dark.offset_variance_dn2 * terms.gain * terms.gain;
      } else {
        out.rate[begin + i] = 0;
        out.weight[begin + i] = 0;
        out.variance[begin + i] = std::numeric_limits<float>::infinity();
      }
    }
  }
}

}  // namespace scatter::measurement
