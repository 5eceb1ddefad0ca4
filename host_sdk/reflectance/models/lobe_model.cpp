#include "host_sdk/reflectance/models/lobe_model.h"

#include <algorithm>
#include <array>
#include <utility>

namespace scatter::reflectance {
namespace {

/// Geometries that a batch prepares at a time: they stay in the first-level cache.
constexpr std::size_t kBlock = 64;

double mean(const ChannelValues& values) noexcept {
  double sum = 0;
  for (const double value : values) {
    sum += value;
  }
  return sum / static_cast<double>(kModelChannels);
}

}  // namespace

LobeModel::LobeModel(std::vector<WeightedLobe> lobes, const ChannelValues& mirror)
    : lobes_(std::move(lobes)), mirror_(mirror), mirror_strength_(mean(mirror)) {}

Origin LobeModel::eval(const Direction& omega_i, const Direction& omega_o,
                       std::span<double> f_per_sr) const noexcept {
  std::ranges::fill(f_per_sr, 0.0);
  if (!(omega_i.z > 0 && omega_o.z > 0)) {
    return Origin::kInvalid;
  }
  const formulas::Geometry g = formulas::make_geometry(omega_i, omega_o);
  for (const WeightedLobe& lobe : lobes_) {
    lobe.lobe->add(g, lobe.weight, f_per_sr.first<kModelChannels>());
  }
  return Origin::kMeasured;
}

void LobeModel::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                           std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  std::array<formulas::Geometry, kBlock> g;
  for (std::size_t first = 0; first < omega_o.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, omega_o.size() - first);
    const std::span<double> f = f_per_sr.subspan(first * kModelChannels, count * kModelChannels);
    std::ranges::fill(f, 0.0);
    bool all = true;
    for (std::size_t k = 0; k < count; ++k) {
      const Direction& o = omega_o[first + k];
      const bool valid = omega_i.z > 0 && o.z > 0;
      all = all && valid;
      // A stand-in keeps the lobes' loops free of branches; its value is wiped below.
      g[k] = valid ? formulas::make_geometry(omega_i, o) : formulas::Geometry{};
      if (!origin.empty()) {
        origin[first + k] = valid ? Origin::kMeasured : Origin::kInvalid;
      }
    }
    for (const WeightedLobe& lobe : lobes_) {
      lobe.lobe->add_batch(std::span(g).first(count), lobe.weight, f);
    }
    for (std::size_t k = 0; !all && k < count; ++k) {
      if (!(omega_i.z > 0 && omega_o[first + k].z > 0)) {
        std::ranges::fill(f.subspan(k * kModelChannels, kModelChannels), 0.0);
      }
    }
  }
}

bool LobeModel::dirac(const Direction& omega_i, std::span<double> weight) const noexcept {
  if (!(mirror_strength_ > 0 && omega_i.z > 0)) {
    return false;
  }
  std::ranges::copy(mirror_, weight.begin());
  return true;
}

double LobeModel::strength(const WeightedLobe& lobe, const Direction& omega_i) const noexcept {
  ChannelValues value = lobe.lobe->strength(omega_i);
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    value[c] *= lobe.weight[c];
  }
  return mean(value);
}

double LobeModel::total_strength(const Direction& omega_i) const noexcept {
  double total = mirror_strength_;
  for (const WeightedLobe& lobe : lobes_) {
    total += strength(lobe, omega_i);
  }
  return total;
}

DrawnDirection LobeModel::sample(const Direction& omega_i, const SampleInput& u,
                                 std::span<double> throughput) const noexcept {
  std::ranges::fill(throughput, 0.0);
  const double total = omega_i.z > 0 ? total_strength(omega_i) : 0.0;
  if (!(total > 0)) {
    return {.omega_o = mirrored(omega_i)};
  }
  double left = u[2] * total;
  // The second half: u[2] * total may round up to total.
  if (left < mirror_strength_ || mirror_strength_ == total) {
    const double probability = mirror_strength_ / total;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      throughput[c] = mirror_[c] / probability;
    }
    return {.omega_o = mirrored(omega_i), .density = probability, .is_dirac = true};
  }
  left -= mirror_strength_;
  const Lobe* chosen = nullptr;
  double u3 = 0;
  for (const WeightedLobe& lobe : lobes_) {
    const double share = strength(lobe, omega_i);
    if (share > 0) {
      chosen = lobe.lobe.get();
      // What is left of the number is uniform again within the chosen share.
      u3 = std::clamp(left / share, 0.0, 0x1.fffffffffffffp-1);
      if (left < share) {
        break;
      }
      left -= share;
    }
  }
  DrawnDirection out{.omega_o = chosen->sample(omega_i, u[0], u[1], u3)};
  out.density = LobeModel::pdf(omega_i, out.omega_o);
  if (out.omega_o.z > 0 && out.density > 0) {
    (void)LobeModel::eval(omega_i, out.omega_o, throughput);
    for (double& value : throughput) {
      value *= out.omega_o.z / out.density;
    }
  }
  return out;
}

double LobeModel::pdf(const Direction& omega_i, const Direction& omega_o) const noexcept {
  double density = 0;
  LobeModel::pdf_batch(omega_i, std::span(&omega_o, 1), std::span(&density, 1));
  return density;
}

void LobeModel::pdf_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                          std::span<double> density) const noexcept {
  std::ranges::fill(density, 0.0);
  const double total = omega_i.z > 0 ? total_strength(omega_i) : 0.0;
  if (!(total > 0)) {
    return;
  }
  for (const WeightedLobe& lobe : lobes_) {
    const double share = strength(lobe, omega_i) / total;
    if (share > 0) {
      for (std::size_t k = 0; k < omega_o.size(); ++k) {
        density[k] += share * lobe.lobe->pdf(omega_i, omega_o[k]);
      }
    }
  }
}

}  // namespace scatter::reflectance
