#include "simulator/samples/sample_brdf.h"

#include <algorithm>
#include <string>

namespace scatter::simulator {
namespace {

using reflectance::Direction;
using reflectance::Origin;

constexpr std::size_t kRecent = 16;
/// Directions closer than this have one spot [1].
constexpr double kSame = 1e-9;

bool same(const Direction& a, const Direction& b) noexcept {
  const Direction d{a.x - b.x, a.y - b.y, a.z - b.z};
  return dot(d, d) < kSame * kSame;
}

}  // namespace

SampleBrdf::SampleBrdf(std::shared_ptr<const Surface> surface, double diameter_mm)
    : surface_(std::move(surface)),
      diameter_mm_(diameter_mm),
      straight_(surface_->lit({.diameter_mm = diameter_mm, .omega_i = {}})),
      channels_(straight_->channels()) {}

Result<std::shared_ptr<const SampleBrdf>> SampleBrdf::make(std::string_view spec) {
  const auto sample = Sample::make(spec);
  if (!sample) {
    return std::unexpected(sample.error());
  }
  if ((*sample)->surface_spec() != spec) {
    return fail(ErrorCode::kInvalidArgument, std::string("sample '").append(spec).append("': has defects"),
                "leave out what follows the '+': a truth is that of the flat, firm sample");
  }
  return std::make_shared<const SampleBrdf>((*sample)->shared_surface());
}

std::span<const float> SampleBrdf::wavelengths_nm() const noexcept {
  return straight_->wavelengths_nm();
}

std::shared_ptr<const reflectance::Brdf> SampleBrdf::lit(const Direction& omega_i) const {
  {
    const std::scoped_lock lock(mutex_);
    const auto found =
        std::ranges::find_if(recent_, [&](const Lit& one) { return same(one.omega_i, omega_i); });
    if (found != recent_.end()) {
      recent_.splice(recent_.begin(), recent_, found);
      return recent_.front().brdf;
    }
  }
  auto brdf = surface_->lit({.diameter_mm = diameter_mm_, .omega_i = omega_i});
  const std::scoped_lock lock(mutex_);
  recent_.push_front({omega_i, brdf});
  if (recent_.size() > kRecent) {
    recent_.pop_back();
  }
  return brdf;
}

Origin SampleBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                        std::span<double> f_per_sr) const noexcept {
  if (!(omega_i.z > 0)) {
    return straight_->eval(omega_i, omega_o, f_per_sr);
  }
  return lit(omega_i)->eval(omega_i, omega_o, f_per_sr);
}

void SampleBrdf::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                            std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const auto& brdf = omega_i.z > 0 ? lit(omega_i) : straight_;
  brdf->eval_batch(omega_i, omega_o, f_per_sr, origin);
}

bool SampleBrdf::dirac(const Direction& omega_i, std::span<double> weight) const noexcept {
  return omega_i.z > 0 ? lit(omega_i)->dirac(omega_i, weight) : straight_->dirac(omega_i, weight);
}

}  // namespace scatter::simulator
