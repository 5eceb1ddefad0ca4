#include "host_sdk/measurement/lanes.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "host_sdk/measurement/geometry.h"
#include "host_sdk/simd/vector_clones.h"

namespace scatter::measurement {
namespace {

constexpr std::size_t kBlock = 4096;

/// Relative variance of S / W from the photodiode's noise: one reading per frame.
double monitor_variance(const protocol::Descriptor& d, std::size_t frames,
                        std::size_t reference_frames) noexcept {
  const auto u = static_cast<double>(d.uncertainty.monitor);
  return u * u *
         (1.0 / static_cast<double>(std::max<std::size_t>(frames, 1)) +
          1.0 / static_cast<double>(std::max<std::size_t>(reference_frames, 1)));
}

/// A block of one lane: sample, reference and black rates with their variances.
struct RateBlock {
  const float* s;
  const float* s_variance;
  const float* w;
  const float* w_variance;
  const float* b;
  const float* b_variance;
  std::size_t n;
};

SCATTER_VECTOR_CLONES void refer(const RateBlock& in, float f_w, float f_b, float* __restrict f,
                                 float* __restrict variance) {
  const float* __restrict s = in.s;
  const float* __restrict w = in.w;
  const float* __restrict b = in.b;
  const float* __restrict vs = in.s_variance;
  const float* __restrict vw = in.w_variance;
  const float* __restrict vb = in.b_variance;
  const std::size_t n = in.n;
  constexpr float kNone = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < n; ++i) {
    const float span = w[i] - b[i];
    const float scale = (f_w - f_b) / span;
    const float x = (s[i] - b[i]) / span;
    const float total = scale * scale * (vs[i] + (1.0F - x) * (1.0F - x) * vb[i] + x * x * vw[i]);
    // Saturated anywhere: one of the variances is infinite, the sum infinite or (0 * infinity) NaN.
    const float known = total < kNone ? 1.0F : 0.0F;
    const float use = span > 0.0F ? known : 0.0F;
    f[i] = use > 0.0F ? f_b + (f_w - f_b) * x : 0.0F;
    variance[i] = use > 0.0F ? total : kNone;
  }
}

}  // namespace

LaneSelection select_lanes(const RecordedScan& scan) {
  const auto& list = scan.descriptor.illuminations;
  const ReferenceSet& references = *scan.references;
  std::map<std::uint8_t, std::vector<const FrameRecord*>> lit;
  for (const FrameRecord& frame : scan.frames) {
    if (frame.begin.kind == protocol::FrameKind::kLight && frame.begin.illumination < list.size()) {
      lit[frame.begin.illumination].push_back(&frame);
    }
  }
  LaneSelection out;
  out.transmission = !lit.empty() && std::ranges::all_of(lit, [&](const auto& row) {
    return is_transmission(list[row.first]);
  });
  const protocol::ReferenceCertificate* reference = references.certificate(
      out.transmission ? protocol::Target::kTranslucentReference : protocol::Target::kWhiteReference);
  const protocol::ReferenceCertificate* black = references.certificate(protocol::Target::kBlackReference);
  std::map<std::uint8_t, std::vector<Lane>> heads;
  std::set<std::uint8_t> channels;
  for (const auto& [illumination, frames] : lit) {
    const protocol::Illumination& source = list[illumination];
    if (is_transmission(source) != out.transmission) {
      continue;
    }
    channels.insert(source.channel);
    const ReferenceImages* images = references.find(illumination);
    if (images == nullptr || reference == nullptr || source.channel >= reference->f_per_sr.size()) {
      out.omitted.push_back(fmt::format("head {} channel {}: the calibration has no reference for it",
                                        source.head, source.channel));
      continue;
    }
    Lane lane;
    lane.illumination = illumination;
    lane.head = source.head;
    lane.channel = source.channel;
    const auto theta = static_cast<double>(source.theta_rad);
    lane.omega_i = reflectance::from_spherical(out.transmission ? reflectance::kPi - theta : theta,
                                               static_cast<double>(source.phi_rad));
    lane.f_reference_per_sr = static_cast<double>(reference->f_per_sr[source.channel]);
    lane.u_reference = static_cast<double>(reference->relative_uncertainty[source.channel]);
    // The opaque black reference passes no light: its BTDF is 0 exactly.
    if (!out.transmission && black != nullptr && source.channel < black->f_per_sr.size()) {
      lane.f_black_per_sr = static_cast<double>(black->f_per_sr[source.channel]);
      lane.u_black = static_cast<double>(black->relative_uncertainty[source.channel]);
    }
    lane.monitor_relative_variance =
        monitor_variance(scan.descriptor, frames.size(), images->reference_exposures.size());
    lane.light = scan.light.find(illumination);
    for (const FrameRecord* frame : frames) {
      lane.exposures_s_v.push_back(static_cast<float>(frame->exposure_s * frame->monitor_v));
    }
    lane.exposures_s_v = distinct_exposures(std::move(lane.exposures_s_v));
    lane.references = images;
    heads[source.head].push_back(std::move(lane));
  }
  for (auto& [head, lanes] : heads) {
    if (lanes.size() != channels.size()) {
      out.omitted.push_back(fmt::format("head {}: {} of {} colours", head, lanes.size(), channels.size()));
      continue;
    }
    std::ranges::sort(lanes, {}, &Lane::channel);
    out.lanes.insert(out.lanes.end(), lanes.begin(), lanes.end());
  }
  return out;
}

LaneImages lane_images(const RecordedScan& scan, const LaneSelection& selection) {
  const std::size_t pixels = std::size_t{scan.descriptor.sensor.width_px} * scan.descriptor.sensor.height_px;
  const std::size_t lanes = selection.lanes.size();
  const LightSums::Planes* off = scan.light.find(kLedOff);
  LaneImages out{std::vector<float>(pixels * lanes), std::vector<float>(pixels * lanes)};
  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, pixels, kBlock), [&](const auto& range) {
        std::array<float, kBlock> s;
        std::array<float, kBlock> s_variance;
        std::array<float, kBlock> f;
        std::array<float, kBlock> f_variance;
        for (std::size_t begin = range.begin(); begin < range.end(); begin += kBlock) {
          const std::size_t n = std::min(kBlock, range.end() - begin);
          for (std::size_t l = 0; l < lanes; ++l) {
            const Lane& lane = selection.lanes[l];
            std::copy_n(lane.light->image.rate.begin() + static_cast<std::ptrdiff_t>(begin), n, s.begin());
            std::copy_n(lane.light->image.variance.begin() + static_cast<std::ptrdiff_t>(begin), n,
                        s_variance.begin());
            if (off != nullptr) {
              // A pixel that saturates without light (hot) is masked; elsewhere the off rate is known.
              const auto per_volt = static_cast<float>(lane.light->inverse_monitor);
              for (std::size_t i = 0; i < n; ++i) {
                const bool known = std::isfinite(off->image.variance[begin + i]);
                s[i] -= known ? off->image.rate[begin + i] * per_volt : 0.0F;
                s_variance[i] += known ? off->image.variance[begin + i] * per_volt * per_volt : 0.0F;
              }
            }
            refer({s.data(), s_variance.data(), lane.references->reference.rate.data() + begin,
                   lane.references->reference.variance.data() + begin,
                   lane.references->black.rate.data() + begin, lane.references->black.variance.data() + begin,
                   n},
                  static_cast<float>(lane.f_reference_per_sr), static_cast<float>(lane.f_black_per_sr),
                  f.data(), f_variance.data());
            for (std::size_t i = 0; i < n; ++i) {
              out.f_per_sr[(begin + i) * lanes + l] = f[i];
              out.variance[(begin + i) * lanes + l] = f_variance[i];
            }
          }
        }
      });
  return out;
}

void spread_saturation(LaneImages& images, const PixelGeometry& geometry, std::size_t lanes) {
  std::vector<std::size_t> lost;  // Indices into the interleaved image.
  for (std::size_t p = 0; p < geometry.usable.size(); ++p) {
    for (std::size_t l = 0; l < lanes; ++l) {
      if (std::isinf(images.variance[p * lanes + l]) && geometry.usable[p] != 0) {
        lost.push_back(p * lanes + l);
      }
    }
  }
  const std::ptrdiff_t width = geometry.width;
  const std::ptrdiff_t height = geometry.height;
  for (const std::size_t at : lost) {
    const auto p = static_cast<std::ptrdiff_t>(at / lanes);
    const std::size_t lane = at % lanes;
    for (std::ptrdiff_t y = std::max<std::ptrdiff_t>(p / width - 1, 0);
         y <= std::min(p / width + 1, height - 1); ++y) {
      for (std::ptrdiff_t x = std::max<std::ptrdiff_t>(p % width - 1, 0);
           x <= std::min(p % width + 1, width - 1); ++x) {
        const std::size_t neighbour = static_cast<std::size_t>(y * width + x) * lanes + lane;
        images.f_per_sr[neighbour] = 0;
        images.variance[neighbour] = std::numeric_limits<float>::infinity();
      }
    }
  }
}

}  // namespace scatter::measurement
