#include "host_sdk/reflectance/estimators/guided_mixture.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/fitting/fit.h"

namespace scatter::reflectance {
namespace {

/// Families that guide. Every base and lobe of the library, and the pairs that real surfaces need.
constexpr std::array<const char*, 8> kFamilies{"ggx",       "beckmann",       "ward",
                                               "lafortune", "oren-nayar+ggx", "oren-nayar+beckmann",
                                               "ggx2",      "oren-nayar+ggx2"};
/// So many of them, those that fit all data best, are tried in the cross-validation.
constexpr std::size_t kTriedGuides = 5;
constexpr std::size_t kFitSamples = 2400;
/// So many candidates stay in the mixture.
constexpr std::size_t kMembers = 12;
/// Candidates that differ by less than this part of their error are one: a mixture of twins is none.
constexpr double kSameShare = 0.1;
/// Nodes predicted per region and held-back incidence.
constexpr std::size_t kNodesPerRegion = 200;
/// Weights go as error^-kSharpness: 2 averages the noise of equally good ways, infinity takes one.
constexpr double kSharpness = 4;
/// Errors below this are equal: noise, not the method.
constexpr double kLeastError = 1e-4;
/// At most so many incidences are held back; the rest is skipped evenly.
constexpr std::size_t kMostHeldBack = 4;
/// The simple way is taken where it is better by more than this; less is a draw, and a mixture is safer.
constexpr double kClearlyWorse = 1.1;
/// No single value counts for more than this.
constexpr double kLargestError = 1;
/// Ring centres lie at 2^(k - 0.5) * 2 deg: 1.4, 2.8, 5.7, 11, 23 and 45 deg from the mirror direction.
constexpr double kFirstRingDeg = 2;
/// theta_o of the two halves [deg].
constexpr double kUpperDeg = 50;
constexpr double kGrazingDeg = 70;

std::string title(const Guide& guide, const GuidedCandidate& candidate) {
  return fmt::format("{}{}{} {}", guide.name, guide.name.empty() ? "" : " ", name(candidate.alignment),
                     name(candidate.joint));
}

/// Guides fitted to the incidences named; a family that cannot be fitted is left out.
std::vector<Guide> fit_guides(const GuidedData& data, std::span<const std::size_t> use,
                              std::span<const std::string> families, std::vector<double>* rms) {
  std::vector<Guide> guides{{"", nullptr}};
  if (data.type != ScatterType::kBrdf) {
    return guides;
  }
  const FitSamples samples = data.samples(use, kFitSamples);
  std::vector<Guide> fitted(families.size());
  std::vector<double> loss(families.size());
  tbb::parallel_for(std::size_t{0}, families.size(), [&](std::size_t k) {
    const auto result = fit(samples, fit_family(families[k]).value(),
                            {.weighting = Weighting::kSolidAngleAndFlux, .starts = 2});
    if (result) {
      fitted[k] = {families[k], result->model};
      loss[k] = result->rms_residual;
    }
  });
  for (std::size_t k = 0; k < families.size(); ++k) {
    if (fitted[k].model) {
      guides.push_back(std::move(fitted[k]));
      if (rms != nullptr) {
        rms->push_back(loss[k]);
      }
    }
  }
  return guides;
}

std::vector<GuidedCandidate> all_candidates(std::size_t guides) {
  std::vector<GuidedCandidate> all;
  for (std::size_t g = 0; g < guides; ++g) {
    for (const Alignment alignment : {Alignment::kPlain, Alignment::kSpecular, Alignment::kHalf}) {
      for (const Joint joint : {Joint::kValue, Joint::kLog, Joint::kLogCubic}) {
        if (g == 0 || joint != Joint::kValue) {
          all.push_back({g, alignment, joint});
        }
      }
    }
  }
  return all;
}

/// Directions of one held-back incidence, with every candidate's error.
struct Trial {
  double theta_i = 0;
  std::vector<Direction> local_o;
  std::vector<double> solid_angle;
  std::vector<double> flux;
  std::vector<std::size_t> region;
  std::vector<float> log_truth;      ///< [k * channels + c]
  std::vector<float> log_predicted;  ///< [(candidate * size + k) * channels + c]
};

double error_of(double log_predicted, double log_truth) noexcept {
  const double difference = log_predicted - log_truth;
  return std::min(kLargestError, 0.5 * std::abs(difference) + 0.5 * std::abs(std::expm1(difference)));
}

/// Up to kNodesPerRegion measured nodes of each region, evenly strided, standing for all of it.
void choose_nodes(const GuidedData& data, std::size_t incidence, Trial& trial) {
  const GuidedRegions regions(trial.theta_i);
  std::array<std::vector<std::size_t>, GuidedRegions::kCount> nodes;
  for (std::size_t node = 0; node < data.grid.size(); ++node) {
    const bool positive =
        std::ranges::all_of(std::span(data.f_per_sr[incidence]).subspan(node * data.channels, data.channels),
                            [](float f) { return f > 0; });
    if (data.measured[incidence][node] != 0 && positive && (node == 0 || node >= data.grid.columns)) {
      nodes[regions.nearest(data.grid.direction(node))].push_back(node);
    }
  }
  for (std::size_t r = 0; r < nodes.size(); ++r) {
    const std::size_t take = std::min(nodes[r].size(), kNodesPerRegion);
    double whole = 0;
    for (const std::size_t node : nodes[r]) {
      whole += data.grid.solid_angle_sr(node);
    }
    double taken = 0;
    const std::size_t first = trial.local_o.size();
    for (std::size_t k = 0; k < take; ++k) {
      // A golden-ratio stride visits rows and columns alike.
      const double position = std::fmod(static_cast<double>(k) * 0.6180339887498949, 1.0);
      const std::size_t node =
          take == nodes[r].size()
              ? nodes[r][k]
              : nodes[r][static_cast<std::size_t>(position * static_cast<double>(nodes[r].size()))];
      const Direction o = data.grid.direction(node);
      trial.local_o.push_back(o);
      trial.solid_angle.push_back(data.grid.solid_angle_sr(node));
      taken += trial.solid_angle.back();
      trial.region.push_back(r);
      double mean = 0;
      for (std::size_t c = 0; c < data.channels; ++c) {
        const double f = data.f_per_sr[incidence][node * data.channels + c];
        trial.log_truth.push_back(static_cast<float>(std::log(std::max(f, data.floor_per_sr[c]))));
        mean += f / static_cast<double>(data.channels);
      }
      trial.flux.push_back(mean * o.z);
    }
    for (std::size_t k = first; k < trial.local_o.size(); ++k) {
      trial.solid_angle[k] *= whole / taken;
      trial.flux[k] *= trial.solid_angle[k];
    }
  }
}

/// Incidences that can be predicted from the others without leaving their range.
std::vector<std::size_t> can_be_held_back(const GuidedData& data) {
  std::vector<std::size_t> inner;
  const std::size_t count = data.theta_i.size();
  for (std::size_t k = 0; k + 1 < count; ++k) {
    // Light along the normal lies between an incidence and its own turned one.
    if (k > 0 ? count > 2 : data.isotropic && data.theta_i[0] < kSameAngle) {
      inner.push_back(k);
    }
  }
  std::vector<std::size_t> chosen;
  const std::size_t take = std::min(inner.size(), kMostHeldBack);
  for (std::size_t k = 0; k < take; ++k) {
    chosen.push_back(inner[(2 * k + 1) * inner.size() / (2 * take)]);
  }
  return chosen;
}

/// Mean error of each candidate, over everything and by region.
struct Errors {
  std::vector<double> mean;    ///< [candidate], half by solid angle and half by flux.
  std::vector<double> solid;   ///< [candidate], by solid angle.
  std::vector<double> region;  ///< [region * candidates + candidate], by solid angle.
  std::array<double, GuidedRegions::kCount> region_weight{};
};

Errors errors_of(std::span<const Trial> trials, std::size_t candidates, std::size_t channels) {
  Errors errors;
  errors.mean.assign(candidates, 0.0);
  errors.solid.assign(candidates, 0.0);
  errors.region.assign(GuidedRegions::kCount * candidates, 0.0);
  for (const Trial& trial : trials) {
    const double solid = std::accumulate(trial.solid_angle.begin(), trial.solid_angle.end(), 0.0);
    const double flux = std::accumulate(trial.flux.begin(), trial.flux.end(), 0.0);
    const std::size_t size = trial.local_o.size();
    for (std::size_t k = 0; k < size; ++k) {
      const double share = trial.solid_angle[k] / solid;
      errors.region_weight[trial.region[k]] += share;
      for (std::size_t q = 0; q < candidates; ++q) {
        double error = 0;
        for (std::size_t c = 0; c < channels; ++c) {
          error +=
              error_of(trial.log_predicted[(q * size + k) * channels + c], trial.log_truth[k * channels + c]);
        }
        error /= static_cast<double>(channels);
        errors.mean[q] +=
            (0.5 * share + 0.5 * trial.flux[k] / flux) * error / static_cast<double>(trials.size());
        errors.solid[q] += share * error / static_cast<double>(trials.size());
        errors.region[trial.region[k] * candidates + q] += share * error;
      }
    }
  }
  for (std::size_t r = 0; r < GuidedRegions::kCount; ++r) {
    for (std::size_t q = 0; q < candidates; ++q) {
      double& error = errors.region[r * candidates + q];
      error = errors.region_weight[r] > 0 ? error / errors.region_weight[r] : errors.mean[q];
    }
  }
  return errors;
}

/// What linear candidates would do between the incidences that there are, which lie half as far apart as
/// those around a held-back one: of the square of their error what the cubic one of the same kind does
/// away with is curvature, and falls to a sixteenth; the rest is noise.
void halve_gap(std::span<const GuidedCandidate> candidates, std::span<double> error) {
  for (std::size_t q = 0; q < candidates.size(); ++q) {
    if (candidates[q].joint != Joint::kLogCubic) {
      continue;
    }
    // The linear one of the same kind stands before its cubic one (all_candidates).
    double& linear = error[q - 1];
    if (linear > error[q]) {
      linear = std::sqrt(error[q] * error[q] + (linear * linear - error[q] * error[q]) / 16);
    }
  }
}

/// Mean difference of ln f between two candidates' predictions.
double mean_difference(std::span<const Trial> trials, std::size_t a, std::size_t b) {
  double sum = 0;
  double count = 0;
  for (const Trial& trial : trials) {
    const std::size_t size = trial.log_truth.size();
    for (std::size_t k = 0; k < size; ++k) {
      sum += std::abs(
          static_cast<double>(trial.log_predicted[a * size + k] - trial.log_predicted[b * size + k]));
    }
    count += static_cast<double>(size);
  }
  return sum / count;
}

std::vector<float> weights_of(const Errors& errors, std::span<const std::size_t> members) {
  const std::size_t candidates = errors.mean.size();
  std::vector<float> weight(GuidedRegions::kCount * members.size());
  for (std::size_t r = 0; r < GuidedRegions::kCount; ++r) {
    double sum = 0;
    std::vector<double> raw(members.size());
    double least = kLargestError;
    for (const std::size_t q : members) {
      least = std::min(least, std::max(errors.region[r * candidates + q], kLeastError));
    }
    for (std::size_t m = 0; m < members.size(); ++m) {
      const double error = std::max(errors.region[r * candidates + members[m]], kLeastError);
      raw[m] = std::pow(least / error, kSharpness);
      sum += raw[m];
    }
    for (std::size_t m = 0; m < members.size(); ++m) {
      weight[r * members.size() + m] = static_cast<float>(raw[m] / sum);
    }
  }
  return weight;
}

/// What the mixture makes of the trials; its error among them.
void judge(std::span<const Trial> trials, std::span<const std::size_t> members, std::size_t channels,
           GuidedMixture& mixture) {
  std::array<double, GuidedRegions::kCount> square{};
  std::array<double, GuidedRegions::kCount> weight{};
  double total = 0;
  for (const Trial& trial : trials) {
    const std::size_t size = trial.local_o.size();
    std::vector<float> log_f(members.size() * size * channels);
    for (std::size_t m = 0; m < members.size(); ++m) {
      std::copy_n(trial.log_predicted.begin() + static_cast<std::ptrdiff_t>(members[m] * size * channels),
                  size * channels, log_f.begin() + static_cast<std::ptrdiff_t>(m * size * channels));
    }
    std::vector<double> f(size * channels);
    mix(mixture, trial.theta_i, trial.local_o, log_f, channels, f);
    double error = 0;
    double solid = 0;
    for (std::size_t k = 0; k < size; ++k) {
      for (std::size_t c = 0; c < channels; ++c) {
        const double log_truth = trial.log_truth[k * channels + c];
        const double log_predicted = std::log(f[k * channels + c]);
        error += trial.solid_angle[k] * error_of(log_predicted, log_truth);
        solid += trial.solid_angle[k];
        const double capped = std::min(std::abs(log_predicted - log_truth), kLargestError);
        square[trial.region[k]] += trial.solid_angle[k] * capped * capped;
        weight[trial.region[k]] += trial.solid_angle[k];
      }
    }
    mixture.held_back.push_back(trial.theta_i);
    mixture.held_back_error.push_back(error / solid);
    total += error / solid / static_cast<double>(trials.size());
  }
  mixture.error = total;
  const double squares = std::accumulate(square.begin(), square.end(), 0.0);
  const double all = std::accumulate(weight.begin(), weight.end(), 0.0);
  for (std::size_t r = 0; r < GuidedRegions::kCount; ++r) {
    mixture.region_rms[r] = std::sqrt(weight[r] > 0 ? square[r] / weight[r] : squares / all);
  }
}

/// The mixture of the candidates named, by index into `candidates`.
GuidedMixture assemble(std::vector<Guide> guides, std::span<const GuidedCandidate> candidates,
                       const std::optional<Errors>& errors, std::span<const std::size_t> members) {
  GuidedMixture mixture;
  mixture.guides = std::move(guides);
  for (const std::size_t q : members) {
    mixture.candidates.push_back(candidates[q]);
    mixture.members.push_back({.name = title(mixture.guides[candidates[q].guide], candidates[q]),
                               .weight = 1.0 / static_cast<double>(members.size()),
                               .error = errors ? std::optional(errors->solid[q]) : std::nullopt});
  }
  if (!errors) {
    mixture.weight.assign(GuidedRegions::kCount * members.size(), 1.0F / static_cast<float>(members.size()));
    return mixture;
  }
  mixture.weight = weights_of(*errors, members);
  for (std::size_t m = 0; m < members.size(); ++m) {
    double sum = 0;
    double all = 0;
    for (std::size_t r = 0; r < GuidedRegions::kCount; ++r) {
      sum += errors->region_weight[r] * static_cast<double>(mixture.weight[r * members.size() + m]);
      all += errors->region_weight[r];
    }
    mixture.members[m].weight = sum / all;
  }
  return mixture;
}

}  // namespace

GuidedRegions::GuidedRegions(double theta_i) noexcept
    : sin_i_(std::sin(theta_i)), cos_i_(std::cos(theta_i)) {}

GuidedRegions::Shares GuidedRegions::at(const Direction& local_o) const noexcept {
  const double cos_mirror = std::clamp(cos_i_ * local_o.z - sin_i_ * local_o.x, -1.0, 1.0);
  const double mirror_deg = degrees(std::acos(cos_mirror));
  const double ring = std::clamp(std::log2(std::max(mirror_deg, 1.0) / kFirstRingDeg) + 0.5, 0.0,
                                 static_cast<double>(kRings - 1));
  const double theta_deg = degrees(std::acos(std::clamp(local_o.z, -1.0, 1.0)));
  const auto grazing =
      static_cast<float>(std::clamp((theta_deg - kUpperDeg) / (kGrazingDeg - kUpperDeg), 0.0, 1.0));
  const auto inner = std::min(static_cast<std::size_t>(ring), kRings - 2);
  const auto outer_share = static_cast<float>(ring - static_cast<double>(inner));
  return {.region = {2 * inner, 2 * inner + 1, 2 * inner + 2, 2 * inner + 3},
          .share = {(1 - outer_share) * (1 - grazing), (1 - outer_share) * grazing,
                    outer_share * (1 - grazing), outer_share * grazing}};
}

std::size_t GuidedRegions::nearest(const Direction& local_o) const noexcept {
  const Shares shares = at(local_o);
  const auto largest = std::ranges::max_element(shares.share) - shares.share.begin();
  return shares.region[static_cast<std::size_t>(largest)];
}

void mix(const GuidedMixture& mixture, double theta_i, std::span<const Direction> local_o,
         std::span<const float> log_f, std::size_t channels, std::span<double> f_per_sr) noexcept {
  const GuidedRegions regions(theta_i);
  const std::size_t members = mixture.candidates.size();
  const std::size_t count = local_o.size();
  for (std::size_t k = 0; k < count; ++k) {
    const GuidedRegions::Shares shares = regions.at(local_o[k]);
    const std::span<double> out = f_per_sr.subspan(k * channels, channels);
    std::ranges::fill(out, 0.0);
    for (std::size_t m = 0; m < members; ++m) {
      float weight = 0;
      for (std::size_t s = 0; s < shares.region.size(); ++s) {
        weight += shares.share[s] * mixture.weight[shares.region[s] * members + m];
      }
      for (std::size_t c = 0; c < channels; ++c) {
        out[c] += static_cast<double>(weight * log_f[(m * count + k) * channels + c]);
      }
    }
    for (double& f : out) {
      f = std::exp(f);
    }
  }
}

Result<GuidedMixture> select_guided(const GuidedData& data) {
  const std::size_t count = data.theta_i.size();
  if (count < 2) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("guided: {} incidences, expected at least 2", count),
                "leave the interpolation between incidences out, or measure more incidences");
  }
  std::vector<std::size_t> all(count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::vector<double> rms;
  std::vector<Guide> guides =
      fit_guides(data, all, std::vector<std::string>(kFamilies.begin(), kFamilies.end()), &rms);
  // The best-fitting families first; guide 0 is none.
  std::vector<std::size_t> order(rms.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t k) { return std::pair(rms[k], k); });
  order.resize(std::min(order.size(), kTriedGuides));
  std::vector<Guide> kept{guides[0]};
  std::vector<std::string> families;
  for (const std::size_t k : order) {
    kept.push_back(guides[k + 1]);
    families.push_back(guides[k + 1].name);
  }

  std::vector<GuidedCandidate> candidates = all_candidates(kept.size());
  const std::vector<std::size_t> held_back = can_be_held_back(data);
  std::vector<Trial> trials(held_back.size());
  for (std::size_t t = 0; t < held_back.size(); ++t) {
    std::vector<std::size_t> use = all;
    use.erase(use.begin() + static_cast<std::ptrdiff_t>(held_back[t]));
    // A family that cannot be fitted without this incidence stands in with its fit to everything.
    std::vector<Guide> guides_here = kept;
    for (Guide& refitted : fit_guides(data, use, families, nullptr)) {
      *std::ranges::find(guides_here, refitted.name, &Guide::name) = std::move(refitted);
    }
    Trial& trial = trials[t];
    trial.theta_i = data.theta_i[held_back[t]];
    choose_nodes(data, held_back[t], trial);
    trial.log_predicted.resize(candidates.size() * trial.log_truth.size());
    const GuidedPredictor predictor(data, use, std::move(guides_here), candidates);
    predictor.predict(trial.theta_i, trial.local_o, trial.log_predicted);
  }
  std::erase_if(trials, [](const Trial& trial) { return trial.local_o.empty(); });
  if (trials.empty()) {
    // Nothing to learn from: the best-fitting model, joined without overshoot, by half vector and mirror.
    std::vector<std::size_t> members;
    const std::size_t best = kept.size() > 1 ? 1 : 0;
    for (std::size_t q = 0; q < candidates.size(); ++q) {
      if (candidates[q].guide == best && candidates[q].joint == Joint::kLog &&
          candidates[q].alignment != Alignment::kPlain) {
        members.push_back(q);
      }
    }
    return assemble(std::move(kept), candidates, std::nullopt, members);
  }

  Errors errors = errors_of(trials, candidates.size(), data.channels);
  halve_gap(candidates, errors.mean);
  for (std::size_t r = 0; r < GuidedRegions::kCount; ++r) {
    halve_gap(candidates, std::span(errors.region).subspan(r * candidates.size(), candidates.size()));
  }
  std::vector<std::size_t> ranking(candidates.size());
  std::iota(ranking.begin(), ranking.end(), std::size_t{0});
  std::ranges::sort(ranking, {}, [&](std::size_t q) { return std::pair(errors.mean[q], q); });
  std::vector<std::size_t> members;
  for (const std::size_t q : ranking) {
    const bool known = std::ranges::any_of(members, [&](std::size_t m) {
      return candidates[m].alignment == candidates[q].alignment &&
             candidates[m].joint == candidates[q].joint &&
             mean_difference(trials, q, m) < kSameShare * errors.mean[q];
    });
    if (!known && members.size() < kMembers) {
      members.push_back(q);
    }
  }
  std::ranges::sort(members);  // Candidates of one guide together: its model is evaluated once.
  const auto specular =
      static_cast<std::size_t>(std::ranges::find_if(candidates,
                                                    [](const GuidedCandidate& candidate) {
                                                      return candidate.guide == 0 &&
                                                             candidate.alignment == Alignment::kSpecular &&
                                                             candidate.joint == Joint::kValue;
                                                    }) -
                               candidates.begin());
  GuidedMixture mixture = assemble(kept, candidates, errors, members);
  judge(trials, members, data.channels, mixture);
  if (*mixture.error > kClearlyWorse * errors.solid[specular]) {
    // Nothing beats the simple way on this material.
    const std::array<std::size_t, 1> only{specular};
    mixture = assemble(kept, candidates, errors, only);
    judge(trials, only, data.channels, mixture);
  }
  mixture.specular_error = errors.solid[specular];
  return mixture;
}

}  // namespace scatter::reflectance
