#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "host_sdk/measurement/process.h"

namespace scatter::measurement {
namespace {

using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;

constexpr double kSameAngle = 0.1 * reflectance::kPi / 180.0;
constexpr double kRepeatLimit = 1.5;
constexpr double kIsotropyLimit = 0.03;

double angle_difference(double a, double b) noexcept {
  return std::abs(std::remainder(a - b, 2 * reflectance::kPi));
}

bool same_place(const GridPart& a, const GridPart& b) noexcept {
  return std::abs(a.theta_i - b.theta_i) < kSameAngle &&
         angle_difference(a.rotation_rad, b.rotation_rad) < kSameAngle &&
         (a.theta_i < kSameAngle || angle_difference(a.phi_i, b.phi_i) < kSameAngle);
}

/// Rank of origins when two parts disagree: a measured value is never diluted with a filled one.
int rank(Origin origin) noexcept {
  switch (origin) {
    case Origin::kMeasured:
      return 3;
    case Origin::kInterpolated:
      return 2;
    case Origin::kExtrapolated:
      return 1;
    case Origin::kInvalid:
      return 0;
  }
  return 0;
}

/// Weighted mean of equal parts, weights 1 / random^2; the systematic parts are common to all.
GridPart averaged(const std::vector<const GridPart*>& parts, std::size_t channels) {
  GridPart out = *parts.front();
  for (std::size_t node = 0; node < out.origin.size(); ++node) {
    int best = 0;
    for (const GridPart* part : parts) {
      best = std::max(best, rank(part->origin[node]));
    }
    float pixels = 0;
    for (const GridPart* part : parts) {
      if (rank(part->origin[node]) == best) {
        out.origin[node] = part->origin[node];
        pixels += part->pixels.empty() ? 0.0F : part->pixels[node];
      }
    }
    if (!out.pixels.empty()) {
      out.pixels[node] = pixels;
    }
    for (std::size_t ch = 0; ch < channels; ++ch) {
      double weight = 0, f = 0, fixed = 0;
      for (const GridPart* part : parts) {
        if (rank(part->origin[node]) != best || best == 0) {
          continue;
        }
        const auto r = static_cast<double>(part->random_per_sr[ch][node]);
        const double w = r > 0 ? 1.0 / (r * r) : 0;
        weight += w;
        f += w * static_cast<double>(part->f_per_sr[ch][node]);
        fixed += w * static_cast<double>(part->systematic_per_sr[ch][node]);
      }
      const bool any = weight > 0;
      out.f_per_sr[ch][node] = any ? static_cast<float>(f / weight) : 0.0F;
      out.random_per_sr[ch][node] = any ? static_cast<float>(1.0 / std::sqrt(weight)) : 0.0F;
      out.systematic_per_sr[ch][node] = any ? static_cast<float>(fixed / weight) : 0.0F;
    }
  }
  return out;
}

/// Reduced chi-square of the parts about their mean: 1 when the random uncertainties explain all.
double repeat_chi_square(const std::vector<const GridPart*>& parts, const GridPart& mean,
                         std::size_t channels) {
  double sum = 0;
  double count = 0;
  for (std::size_t node = 0; node < mean.origin.size(); ++node) {
    for (std::size_t ch = 0; ch < channels; ++ch) {
      for (const GridPart* part : parts) {
        const auto r = static_cast<double>(part->random_per_sr[ch][node]);
        if (part->origin[node] == Origin::kMeasured && mean.origin[node] == Origin::kMeasured && r > 0) {
          const double d = static_cast<double>(part->f_per_sr[ch][node] - mean.f_per_sr[ch][node]) / r;
          sum += d * d;
          count += 1.0 - 1.0 / static_cast<double>(parts.size());
        }
      }
    }
  }
  return count > 0 ? sum / count : 0;
}

/// Factor on the variance of a mean of `count` repeats with one calibration. The noise of the
/// references is the same in all of them and does not average out; repeats agree better than their
/// random uncertainties say by just that share.
double common_noise_factor(double chi_square, std::size_t count) noexcept {
  const double own = std::clamp(chi_square, 0.0, 1.0);
  return own + static_cast<double>(count) * (1.0 - own);
}

/// Median relative difference between parts of equal incidence at different sample rotations, each
/// seen from its own plane of incidence: 0 for an isotropic sample.
std::optional<double> anisotropy(const GridBrdf::Content& c) {
  std::vector<double> differences;
  for (std::size_t a = 0; a < c.parts.size(); ++a) {
    for (std::size_t b = a + 1; b < c.parts.size(); ++b) {
      const GridPart& pa = c.parts[a];
      const GridPart& pb = c.parts[b];
      if (std::abs(pa.theta_i - pb.theta_i) > kSameAngle ||
          angle_difference(pa.rotation_rad, pb.rotation_rad) < kSameAngle) {
        continue;
      }
      // At normal incidence the azimuth of the light is degenerate: the rotation tells instead.
      const double turn = pb.theta_i < kSameAngle ? pa.rotation_rad - pb.rotation_rad : pb.phi_i - pa.phi_i;
      const auto n = static_cast<std::ptrdiff_t>(c.phi_count);
      const auto shift = static_cast<std::ptrdiff_t>(std::lround(turn / c.phi_step));
      for (std::size_t j = 3; j < c.theta_count; j += 3) {
        for (std::ptrdiff_t i = 0; i < n; i += 5) {
          const std::size_t na = j * c.phi_count + static_cast<std::size_t>(i);
          const std::size_t nb = j * c.phi_count + static_cast<std::size_t>(((i + shift) % n + n) % n);
          if (pa.origin[na] == Origin::kMeasured && pb.origin[nb] == Origin::kMeasured) {
            const double va = static_cast<double>(pa.f_per_sr[c.channels / 2][na]);
            const double vb = static_cast<double>(pb.f_per_sr[c.channels / 2][nb]);
            if (va + vb > 0) {
              differences.push_back(2 * std::abs(va - vb) / (va + vb));
            }
          }
        }
      }
    }
  }
  if (differences.empty()) {
    return std::nullopt;
  }
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return *middle;
}

}  // namespace

Result<Measurement> combine(std::vector<Measurement> measurements) {
  if (measurements.empty()) {
    return fail(ErrorCode::kInvalidArgument, "nothing to combine", "name at least one recording");
  }
  if (measurements.size() == 1) {
    return std::move(measurements.front());
  }
  Measurement out = std::move(measurements.front());
  const GridBrdf::Content& first = out.brdf.content();
  std::vector<const GridPart*> all;
  std::vector<std::string> calibration_of;
  for (const GridPart& part : first.parts) {
    all.push_back(&part);
    calibration_of.push_back(out.calibration_id);
  }
  std::string ids = out.recording_id;
  std::string calibrations = out.calibration_id;
  for (std::size_t i = 1; i < measurements.size(); ++i) {
    const GridBrdf::Content& c = measurements[i].brdf.content();
    if (c.type != first.type || c.channels != first.channels || c.theta_count != first.theta_count ||
        c.phi_count != first.phi_count) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("measurement {} has another grid, colour count or type than the first", i + 1),
                  "combine measurements of the same instrument and geometry");
    }
    for (const GridPart& part : c.parts) {
      all.push_back(&part);
      calibration_of.push_back(measurements[i].calibration_id);
    }
    ids += "," + measurements[i].recording_id;
    if (measurements[i].calibration_id != out.calibration_id) {
      calibrations += "," + measurements[i].calibration_id;
    }
  }

  GridBrdf::Content content;
  content.type = first.type;
  content.wavelengths_nm = first.wavelengths_nm;
  content.channels = first.channels;
  content.theta_count = first.theta_count;
  content.phi_count = first.phi_count;
  content.theta_step = first.theta_step;
  content.phi_step = first.phi_step;
  content.metadata = first.metadata;
  content.metadata["recording_id"] = ids;
  content.metadata["calibration_id"] = calibrations;
  content.metadata["combined"] = fmt::format("{} measurements", measurements.size());
  double worst_chi = 0;
  bool repeated = false;
  std::vector<bool> used(all.size(), false);
  for (std::size_t a = 0; a < all.size(); ++a) {
    if (used[a]) {
      continue;
    }
    std::vector<const GridPart*> group;
    std::map<std::string, std::size_t> with_calibration;
    for (std::size_t b = a; b < all.size(); ++b) {
      if (!used[b] && same_place(*all[a], *all[b])) {
        used[b] = true;
        group.push_back(all[b]);
        ++with_calibration[calibration_of[b]];
      }
    }
    content.parts.push_back(averaged(group, first.channels));
    if (group.size() > 1) {
      repeated = true;
      const double chi = repeat_chi_square(group, content.parts.back(), first.channels);
      worst_chi = std::max(worst_chi, chi);
      std::size_t common = 1;
      for (const auto& [id, count] : with_calibration) {
        common = std::max(common, count);
      }
      const auto factor = static_cast<float>(std::sqrt(common_noise_factor(chi, common)));
      for (std::vector<float>& plane : content.parts.back().random_per_sr) {
        for (float& random : plane) {
          random *= factor;
        }
      }
    }
  }

  std::vector<QualityItem> quality = out.quality;
  for (std::size_t i = 1; i < measurements.size(); ++i) {
    // Of each check the worse row stays, marked with the measurement that it came from.
    for (const QualityItem& row : measurements[i].quality) {
      const auto mine = std::ranges::find(quality, row.name, &QualityItem::name);
      if (mine == quality.end()) {
        quality.push_back(row);
      } else if (row.verdict != Verdict::kOk && mine->verdict == Verdict::kOk) {
        *mine = row;
        mine->advice = fmt::format("measurement {}: {}", i + 1, row.advice);
      }
    }
    out.ledger += measurements[i].ledger;
    out.instrument_seconds += measurements[i].instrument_seconds;
    out.raw_bytes += measurements[i].raw_bytes;
  }
  if (repeated) {
    const bool good = worst_chi <= kRepeatLimit;
    quality.push_back({"repeatability_chi_square", worst_chi, kRepeatLimit,
                       good ? Verdict::kOk : Verdict::kWarn,
                       good ? "repeats agree within their random uncertainty"
                            : "repeats differ by more than their random uncertainty: the sample or the "
                              "instrument changed between them"});
  }
  if (const auto value = anisotropy(content)) {
    quality.push_back({"anisotropy", *value, kIsotropyLimit, Verdict::kOk,
                       *value > kIsotropyLimit ? "the sample is anisotropic: keep all rotations"
                                               : "rotations agree: the sample is isotropic"});
  }
  auto brdf = GridBrdf::make(std::move(content));
  if (!brdf) {
    return std::unexpected(brdf.error());
  }
  out.brdf = std::move(*brdf);
  out.albedo = measured_albedo(out.brdf);
  out.quality = std::move(quality);
  out.recording_id = ids;
  out.calibration_id = calibrations;
  return out;
}

}  // namespace scatter::measurement
