#include "host_sdk/reflectance/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "host_sdk/reflectance/inspection.h"
#include "host_sdk/reflectance/peak.h"
#include "host_sdk/reflectance/sampled_grid.h"

namespace scatter::reflectance {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kWithin95 = 1.959963984540054;

/// What three channels without wavelengths, red, green and blue, are taken to be at [nm].
constexpr std::array<float, 3> kRgb_nm{650, 550, 450};

std::vector<float> wavelengths_of(const Brdf& brdf) {
  const auto stated = brdf.wavelengths_nm();
  if (stated.empty() && brdf.channels() == kRgb_nm.size()) {
    return {kRgb_nm.begin(), kRgb_nm.end()};
  }
  return {stated.begin(), stated.end()};
}

/// Which channels to hold against each other. The same pairs of kinds can be matched either way round.
Result<ChannelMatch> match_channels(const Brdf& a, const Brdf& b) {
  ChannelMatch match;
  const auto stated = !a.wavelengths_nm().empty() && !b.wavelengths_nm().empty();
  const std::vector<float> wanted = wavelengths_of(a);
  const std::vector<float> known = wavelengths_of(b);
  if (a.channels() == b.channels()) {
    for (std::size_t c = 0; c < a.channels(); ++c) {
      match.pairs.push_back({c, c});
    }
  } else if (b.channels() == 1 || (a.channels() == 1 && !stated)) {
    match.by = ChannelMatch::By::kOneForAll;
    for (std::size_t c = 0; c < std::max(a.channels(), b.channels()); ++c) {
      match.pairs.push_back(b.channels() == 1 ? ChannelMatch::Pair{c, 0} : ChannelMatch::Pair{0, c});
    }
  } else if (!wanted.empty() && !known.empty()) {
    match.by = stated ? ChannelMatch::By::kWavelength : ChannelMatch::By::kAssumedRgb;
    for (std::size_t c = 0; c < wanted.size(); ++c) {
      const auto nearest =
          std::ranges::min_element(known, {}, [&](float nm) { return std::abs(nm - wanted[c]); });
      match.pairs.push_back({c, static_cast<std::size_t>(nearest - known.begin())});
    }
  } else {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("compare: {} channels against {}, and {} states no wavelengths to match them by",
                            a.channels(), b.channels(), known.empty() ? "the reference" : "the one judged"),
                "write that file again with its wavelengths; files of as many channels, or of one channel, "
                "need none");
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
  /// whole_a: what a was sampled from, or a itself; it knows the Dirac component that no node holds.
  Comparer(const GridBrdf& a, const Brdf& whole_a, const Brdf& b, const CompareOptions& options,
           ChannelMatch match)
      : a_(a), whole_a_(whole_a), b_(b), options_(options) {
    out_.channels = std::move(match);
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
    std::vector<double> difference = dirac_difference(a_.omega_i(index), incidence);
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
      for (std::size_t k = 0; k < out_.channels.pairs.size(); ++k) {
        const ChannelMatch::Pair& pair = out_.channels.pairs[k];
        const double a = part.f_per_sr[pair.a][n];
        const double b = f_b_[n * b_.channels() + pair.b];
        height_a[n] += a;
        height_b[n] += b;
        difference[k] += (a - b) * cosine * solid_angle_[n];
        value(a, b, cosine, solid_angle_[n]);
        if (known) {
          uncertain(a - b, part.random_per_sr[pair.a][n], part.systematic_per_sr[pair.a][n]);
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
    out_.relative_errors_known = !relative_.samples.empty();
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
  /// Per pair of channels what a sends into the one direction of the Dirac component beyond b.
  std::vector<double> dirac_difference(const Direction& omega_i, Comparison::Incidence& out) const {
    std::vector<double> a(whole_a_.channels(), 0.0);
    std::vector<double> b(b_.channels(), 0.0);
    (void)whole_a_.dirac(omega_i, a);
    (void)b_.dirac(omega_i, b);
    std::vector<double> difference;
    for (const ChannelMatch::Pair& pair : out_.channels.pairs) {
      difference.push_back(a[pair.a] - b[pair.b]);
      if (std::abs(difference.back()) >= std::abs(out.dirac_a - out.dirac_b)) {
        out.dirac_a = a[pair.a];
        out.dirac_b = b[pair.b];
      }
    }
    return difference;
  }

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
  const Brdf& whole_a_;
  const Brdf& b_;
  CompareOptions options_;
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

Result<Comparison> compared(const GridBrdf& a, const Brdf& whole_a, const Brdf& b,
                            const CompareOptions& options) {
  if (a.type() != b.type()) {
    return fail(ErrorCode::kInvalidArgument, "compare: one is a BRDF, the other a BTDF",
                "compare reflection with reflection, transmission with transmission");
  }
  auto match = match_channels(a, b);
  if (!match) {
    return std::unexpected(match.error());
  }
  Comparer comparer(a, whole_a, b, options, std::move(*match));
  for (std::size_t p = 0; p < a.content().parts.size(); ++p) {
    comparer.part(p);
  }
  return comparer.finish();
}

/// So many incidences that the sampled values fit 256 MB, and no report is longer than 64 of them.
std::size_t most_incidences(const Brdf& brdf, const GridLayout& layout) {
  constexpr std::size_t kMostValues = std::size_t{1} << 26;
  const std::size_t values = layout.theta_count * layout.phi_count * brdf.channels();
  return std::clamp<std::size_t>(kMostValues / std::max<std::size_t>(values, 1), 4, 64);
}

}  // namespace

Result<Comparison> compare(const GridBrdf& a, const Brdf& b, const CompareOptions& options) {
  return compared(a, a, b, options);
}

Result<Comparison> compare(const Brdf& a, const Brdf& b, const CompareOptions& options) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&a)) {
    return compare(*grid, b, options);
  }
  GridLayout layout;
  std::size_t available = 0;
  if (const auto* reference = dynamic_cast<const GridBrdf*>(&b)) {
    layout = GridLayout::of(*reference);
  } else {
    const std::vector<Direction> own = a.own_incidences().empty() ? b.own_incidences() : a.own_incidences();
    available = own.size();
    if (!own.empty()) {
      layout.incidences.clear();
      for (const Direction& light : thinned(own, most_incidences(a, layout))) {
        layout.incidences.push_back({.rotation_rad = 0, .theta_i = theta_of(light), .phi_i = phi_of(light)});
      }
    }
  }
  const auto sampled = sample_on_grid(a, layout);
  if (!sampled) {
    return std::unexpected(sampled.error());
  }
  auto found = compared(*sampled, a, b, options);
  if (found) {
    found->available_incidences = std::max(available, found->incidences.size());
  }
  return found;
}

}  // namespace scatter::reflectance
