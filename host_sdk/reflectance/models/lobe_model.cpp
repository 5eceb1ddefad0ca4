#include "host_sdk/reflectance/models/lobe_model.h"

#include <algorithm>
#include <utility>

#include "host_sdk/reflectance/models/block_kernels.h"
#include "host_sdk/reflectance/models/geometry_block.h"

namespace scatter::reflectance {
namespace {

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
  GeometryBlock block;
  BlockValues sum;
  block.i = omega_i.z > 0 ? omega_i : Direction{};
  for (std::size_t first = 0; first < omega_o.size(); first += kBlockSize) {
    const std::size_t count = std::min(kBlockSize, omega_o.size() - first);
    for (std::size_t k = 0; k < kBlockSize; ++k) {
      // Lanes without a valid direction get the normal, and 0 below.
      const bool valid = k < count && omega_i.z > 0 && omega_o[first + k].z > 0;
      const Direction o = valid ? omega_o[first + k] : Direction{};
      block.o_x[k] = o.x;
      block.o_y[k] = o.y;
      block.o_z[k] = o.z;
    }
    kernels::complete(block);
    for (BlockArray& channel : sum.f_per_sr) {
      channel.fill(0.0);
    }
    for (const WeightedLobe& lobe : lobes_) {
      lobe.lobe->add_block(block, lobe.weight, sum);
    }
    for (std::size_t k = 0; k < count; ++k) {
      const bool valid = omega_i.z > 0 && omega_o[first + k].z > 0;
      for (std::size_t c = 0; c < kModelChannels; ++c) {
        f_per_sr[(first + k) * kModelChannels + c] = valid ? sum.f_per_sr[c][k] : 0.0;
      }
      if (!origin.empty()) {
        origin[first + k] = valid ? Origin::kMeasured : Origin::kInvalid;
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
