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

namespace scatter::measurement {
namespace {

constexpr std::size_t kBlock = 4096;

bool is_transmission(const protocol::Illumination& i) noexcept {
  return static_cast<double>(i.theta_rad) > reflectance::kPi / 2;
}

/// Relative variance of S / W from the photodiode's noise: one reading per frame.
double monitor_variance(const protocol::Descriptor& d, std::size_t frames,
                        std::size_t reference_frames) noexcept {
  const auto u = static_cast<double>(d.uncertainty.monitor);
  return u * u *
         (1.0 / static_cast<double>(std::max<std::size_t>(frames, 1)) +
          1.0 / static_cast<double>(std::max<std::size_t>(reference_frames, 1)));
}

}  // namespace

LaneSelection select_lanes(const RecordedScan& scan, const ReferenceSet& references) {
  const auto& list = scan.descriptor.illuminations;
  LaneSelection out;
  out.transmission = !scan.lit.empty() && std::ranges::all_of(scan.lit, [&](const IlluminationFrames& g) {
    return g.illumination < list.size() && is_transmission(list[g.illumination]);
  });
  const protocol::ReferenceCertificate* reference = references.certificate(
      out.transmission ? protocol::Target::kTranslucentReference : protocol::Target::kWhiteReference);
  const protocol::ReferenceCertificate* black = references.certificate(protocol::Target::kBlackReference);
  std::map<std::uint8_t, std::vector<Lane>> heads;
  std::set<std::uint8_t> channels;
  for (const IlluminationFrames& group : scan.lit) {
    if (group.illumination >= list.size() || is_transmission(list[group.illumination]) != out.transmission) {
      continue;
    }
    const protocol::Illumination& source = list[group.illumination];
    channels.insert(source.channel);
    const ReferenceImages* images = references.find(group.illumination);
    if (images == nullptr || reference == nullptr || source.channel >= reference->f_per_sr.size()) {
      out.omitted.push_back(fmt::format("head {} channel {}: the calibration has no reference for it",
                                        source.head, source.channel));
      continue;
    }
    Lane lane;
    lane.illumination = group.illumination;
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
        monitor_variance(scan.descriptor, group.frames.size(), images->reference_exposures.size());
    lane.frames = &group;
    lane.references = images;
    heads[source.head].push_back(lane);
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

LaneImages lane_images(const RecordedScan& scan, const LaneSelection& selection,
                       const ReferenceSet& references, const AmbientImage& ambient) {
  const std::size_t pixels = std::size_t{scan.descriptor.sensor.width_px} * scan.descriptor.sensor.height_px;
  const std::size_t lanes = selection.lanes.size();
  LaneImages out{std::vector<float>(pixels * lanes), std::vector<float>(pixels * lanes)};
  std::vector<std::vector<Exposure>> exposures;
  for (const Lane& lane : selection.lanes) {
    exposures.push_back(lane.frames->exposures());
  }
  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, pixels, kBlock), [&](const auto& range) {
        std::array<float, kBlock> rate{};
        std::array<float, kBlock> variance{};
        for (std::size_t begin = range.begin(); begin < range.end(); begin += kBlock) {
          const std::size_t n = std::min(kBlock, range.end() - begin);
          for (std::size_t l = 0; l < lanes; ++l) {
            const Lane& lane = selection.lanes[l];
            merge_exposures(exposures[l], references.content().dark, ambient, scan.descriptor.sensor, begin,
                            std::span(rate).first(n), std::span(variance).first(n));
            const auto f_w = static_cast<float>(lane.f_reference_per_sr);
            const auto f_b = static_cast<float>(lane.f_black_per_sr);
            for (std::size_t i = 0; i < n; ++i) {
              const std::size_t p = begin + i;
              const float w = lane.references->reference.rate[p];
              const float b = lane.references->black.rate[p];
              const float span = w - b;
              const std::size_t at = p * lanes + l;
              if (!(span > 0) || std::isinf(variance[i]) ||
                  std::isinf(lane.references->reference.variance[p]) ||
                  std::isinf(lane.references->black.variance[p])) {
                out.f_per_sr[at] = 0;
                out.variance[at] = std::numeric_limits<float>::infinity();
                continue;
              }
              const float scale = (f_w - f_b) / span;
              const float x = (rate[i] - b) / span;
              out.f_per_sr[at] = f_b + (f_w - f_b) * x;
              out.variance[at] = scale * scale *
                                 (variance[i] + (1 - x) * (1 - x) * lane.references->black.variance[p] +
                                  x * x * lane.references->reference.variance[p]);
            }
          }
        }
      });
  return out;
}

}  // namespace scatter::measurement
