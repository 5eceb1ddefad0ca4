#include "host_sdk/reflectance/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "host_sdk/reflectance/peak.h"
#include "host_sdk/reflectance/sampled_grid.h"

namespace scatter::reflectance {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kWithin95 = 1.959963984540054;

/// For each channel of a the channel of b to hold against it.
Result<std::vector<std::size_t>> match_channels(const Brdf& a, const Brdf& b) {
  std::vector<std::size_t> match(a.channels());
  const auto wanted = a.wavelengths_nm();
  const auto known = b.wavelengths_nm();
  for (std::size_t c = 0; c < match.size(); ++c) {
    if (a.channels() == b.channels()) {
      match[c] = c;
    } else if (b.channels() == 1) {
      match[c] = 0;
    } else if (!wanted.empty() && !known.empty()) {
      const auto nearest = std::ranges::min_element(
          known, {}, [&](float nm) { return std::abs(static_cast<double>(nm) - wanted[c]); });
      match[c] = static_cast<std::size_t>(nearest - known.begin());
    } else {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("compare: {} channels against {}, without wavelengths to match them by",
                              a.channels(), b.channels()),
                  "compare files with the same channels");
    }
  }
  return match;
}

/// Collects one (error, weight) pair per bin and channel.
struct Distribution {
  std::vector<std::pair<double, double>> samples;

  [[nodiscard]] double mean() const {
    double sum = 0;
    double total = 0;
    for (const auto& [value, weight] : samples) {
      sum += value * weight;
      total += weight;
    }
    return total > 0 ? sum / total : 0;
  }
  /// Smallest values that hold each share of the weight. Shares ascend.
  [[nodiscard]] std::vector<double> quantiles(std::initializer_list<double> shares) {
    std::ranges::sort(samples);
    double total = 0;
    for (const auto& sample : samples) {
      total += sample.second;
    }
    std::vector<double> out;
    double below = 0;
    auto share = shares.begin();
    for (const auto& [value, weight] : samples) {
      below += weight;
      for (; share != shares.end() && below >= *share * total; ++share) {
        out.push_back(value);
      }
    }
    out.resize(shares.size(), samples.empty() ? 0.0 : samples.back().first);
    return out;
  }
};

class Comparer {
 public:
  Comparer(const GridBrdf& a, const Brdf& b, const CompareOptions& options, std::vector<std::size_t> match)
      : a_(a), b_(b), options_(options), match_(std::move(match)), channels_(a.channels()) {
    const std::size_t nodes = a.content().theta_count * a.content().phi_count;
    for (std::size_t n = 0; n < nodes; ++n) {
      omega_o_.push_back(a.omega_o(n));
      solid_angle_.push_back(a.solid_angle_sr(n));
    }
    up_ = omega_o_;
    for (Direction& w : up_) {
      w.z = std::abs(w.z);
    }
    f_b_.resize(nodes * b.channels());
    origin_b_.resize(nodes);
  }

  void part(std::size_t index) {
    const GridPart& part = a_.content().parts[index];
    b_.eval_batch(a_.omega_i(index), omega_o_, f_b_, origin_b_);
    Comparison::Incidence incidence;
    incidence.rotation_rad = part.rotation_rad;
    incidence.theta_i = part.theta_i;
    incidence.phi_i = part.phi_i;
    std::vector<double> difference(channels_, 0.0);
    std::vector<double> height_a(omega_o_.size(), kNone);
    std::vector<double> height_b(omega_o_.size(), kNone);
    const bool known = !part.random_per_sr.empty() && !part.systematic_per_sr.empty();
    for (std::size_t n = 0; n < omega_o_.size(); ++n) {
      if (!counts(part.origin[n], origin_b_[n])) {
        continue;
      }
      ++incidence.bins;
      height_a[n] = 0;
      height_b[n] = 0;
      const double cosine = up_[n].z;
      for (std::size_t c = 0; c < channels_; ++c) {
        const double a = part.f_per_sr[c][n];
        const double b = f_b_[n * b_.channels() + match_[c]];
        height_a[n] += a;
        height_b[n] += b;
        difference[c] += (a - b) * cosine * solid_angle_[n];
        value(a, b, cosine, solid_angle_[n]);
        if (known) {
          uncertain(a - b, part.random_per_sr[c][n], part.systematic_per_sr[c][n]);
        }
      }
    }
    for (const double d : difference) {
      incidence.albedo_error = std::max(incidence.albedo_error, std::abs(d));
    }
    peaks(height_a, height_b, incidence);
    out_.bins += incidence.bins;
    out_.incidences.push_back(incidence);
  }

  Result<Comparison> finish() {
    if (out_.bins == 0) {
      return fail(ErrorCode::kFailedPrecondition, "compare: the two have no bin in common",
                  "check that the incidences overlap, or compare with region all");
    }
    out_.mean_relative_error = relative_.mean();
    const auto quantile = relative_.quantiles({0.5, 0.95, 0.99});
    out_.median_relative_error = quantile[0];
    out_.p95_relative_error = quantile[1];
    out_.p99_relative_error = quantile[2];
    out_.cosine_weighted_rms_per_sr = std::sqrt(cosine_squares_ / weight_);
    out_.log_rms = std::sqrt(log_squares_ / weight_);
    if (uncertain_count_ > 0) {
      out_.reduced_chi_square = chi_square_ / uncertain_count_;
      out_.coverage_95 = covered_ / uncertain_count_;
    }
    return std::move(out_);
  }

 private:
  [[nodiscard]] bool counts(Origin a, Origin b) const noexcept {
    if (options_.region == Region::kAll) {
      return a != Origin::kInvalid && b != Origin::kInvalid;
    }
    return a == Origin::kMeasured && (b == Origin::kMeasured || b == Origin::kInterpolated);
  }

  void value(double a, double b, double cosine, double weight) {
    if (b > 0) {
      relative_.samples.emplace_back(std::abs(a - b) / b, weight);
    } else {
      ++out_.bins_without_reference;
    }
    const double d = (a - b) * cosine;
    // Noise can push a dark bin below zero; the logarithm then starts at -1.
    const auto log_of = [&](double f) { return std::log1p(std::max(f * cosine, -0.999999)); };
    const double l = log_of(a) - log_of(b);
    cosine_squares_ += weight * d * d;
    log_squares_ += weight * l * l;
    weight_ += weight;
  }

  void uncertain(double difference, double random, double systematic) {
    if (!(random > 0)) {
      return;
    }
    const double z = difference / random;
    chi_square_ += z * z;
    covered_ += std::abs(difference) <= kWithin95 * std::hypot(random, systematic) ? 1 : 0;
    uncertain_count_ += 1;
  }

  void peaks(std::span<const double> height_a, std::span<const double> height_b,
             Comparison::Incidence& incidence) {
    const auto b = find_peak(up_, solid_angle_, height_b);
    const auto a = b ? find_peak(up_, solid_angle_, height_a, b->radius) : std::nullopt;
    if (!a) {
      return;
    }
    const double angle = degrees(angle_between(a->at, b->at));
    const double ratio = a->height_per_sr / b->height_per_sr;
    incidence.peak_angle_error_deg = angle;
    incidence.peak_ratio = ratio;
    out_.peak_angle_error_deg = std::max(out_.peak_angle_error_deg.value_or(0), angle);
    if (!out_.peak_ratio || std::abs(ratio - 1) > std::abs(*out_.peak_ratio - 1)) {
      out_.peak_ratio = ratio;
    }
  }

  const GridBrdf& a_;
  const Brdf& b_;
  CompareOptions options_;
  std::vector<std::size_t> match_;
  std::size_t channels_;
  std::vector<Direction> omega_o_;
  std::vector<Direction> up_;
  std::vector<double> solid_angle_;
  std::vector<double> f_b_;
  std::vector<Origin> origin_b_;
  Distribution relative_;
  double cosine_squares_ = 0;
  double log_squares_ = 0;
  double weight_ = 0;
  double chi_square_ = 0;
  double covered_ = 0;
  double uncertain_count_ = 0;
  Comparison out_;
};

}  // namespace

Result<Comparison> compare(const GridBrdf& a, const Brdf& b, const CompareOptions& options) {
  if (a.type() != b.type()) {
    return fail(ErrorCode::kInvalidArgument, "compare: one is a BRDF, the other a BTDF",
                "compare reflection with reflection, transmission with transmission");
  }
  auto match = match_channels(a, b);
  if (!match) {
    return std::unexpected(match.error());
  }
  Comparer comparer(a, b, options, std::move(*match));
  for (std::size_t p = 0; p < a.content().parts.size(); ++p) {
    comparer.part(p);
  }
  return comparer.finish();
}

Result<Comparison> compare(const Brdf& a, const Brdf& b, const CompareOptions& options) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&a)) {
    return compare(*grid, b, options);
  }
  const auto* reference = dynamic_cast<const GridBrdf*>(&b);
  const auto sampled = sample_on_grid(a, reference != nullptr ? GridLayout::of(*reference) : GridLayout{});
  if (!sampled) {
    return std::unexpected(sampled.error());
  }
  return compare(*sampled, b, options);
}

}  // namespace scatter::reflectance
