#include "host_sdk/formats/sample_list_brdf.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace scatter::formats {
namespace {

using reflectance::Direction;
using reflectance::Origin;
using reflectance::ScatteredSamples;

/// Files give angles with three decimals of a degree at least.
constexpr double kSameDirection = 1e-5;

/// A pair as one number: pairs apart by d are at most 4 d apart in it, and few others share it.
double key_of(const Direction& i, const Direction& o) noexcept {
  return 0.9137 * i.x + 0.5713 * i.y + 0.8291 * o.x + 0.7477 * o.y;
}

bool near(const Direction& a, const Direction& b) noexcept {
  const double x = a.x - b.x;
  const double y = a.y - b.y;
  const double z = a.z - b.z;
  return x * x + y * y + z * z <= kSameDirection * kSameDirection;
}

}  // namespace

Result<SampleListBrdf> SampleListBrdf::make(ScatteredSamples samples) {
  if (Status status = check(samples); !status) {
    return std::unexpected(status.error());
  }
  if (samples.size() == 0 || samples.size() > std::numeric_limits<std::uint32_t>::max()) {
    return fail(ErrorCode::kInvalidArgument, "samples: none, or more than 2^32", "give at least one sample");
  }
  return SampleListBrdf(std::move(samples));
}

SampleListBrdf::SampleListBrdf(ScatteredSamples samples) : samples_(std::move(samples)) {
  by_key_.reserve(samples_.size());
  for (std::size_t s = 0; s < samples_.size(); ++s) {
    by_key_.emplace_back(key_of(samples_.omega_i[s], samples_.omega_o[s]), static_cast<std::uint32_t>(s));
  }
  std::ranges::sort(by_key_);
}

std::size_t SampleListBrdf::find(const Direction& omega_i, const Direction& omega_o) const noexcept {
  const double key = key_of(omega_i, omega_o);
  std::size_t found = samples_.size();
  for (auto it = std::ranges::lower_bound(by_key_, std::pair(key - 4 * kSameDirection, std::uint32_t{0}));
       it != by_key_.end() && it->first <= key + 4 * kSameDirection; ++it) {
    if (it->second < found && near(samples_.omega_i[it->second], omega_i) &&
        near(samples_.omega_o[it->second], omega_o)) {
      found = it->second;
    }
  }
  return found;
}

Origin SampleListBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept {
  const std::size_t s = find(omega_i, omega_o);
  if (s == samples_.size() || samples_.origin_of(s) == Origin::kInvalid) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  for (std::size_t c = 0; c < samples_.channels; ++c) {
    f_per_sr[c] = samples_.f_per_sr[s * samples_.channels + c];
  }
  return samples_.origin_of(s);
}

bool SampleListBrdf::uncertainty(const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept {
  const std::size_t s = find(omega_i, omega_o);
  if (s == samples_.size() || samples_.origin_of(s) == Origin::kInvalid || samples_.random_per_sr.empty() ||
      samples_.systematic_per_sr.empty()) {
    return false;
  }
  for (std::size_t c = 0; c < samples_.channels; ++c) {
    random_per_sr[c] = samples_.random_per_sr[s * samples_.channels + c];
    systematic_per_sr[c] = samples_.systematic_per_sr[s * samples_.channels + c];
  }
  return true;
}

}  // namespace scatter::formats
