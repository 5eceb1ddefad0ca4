#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/fitting/fit.h"
#include "host_sdk/reflectance/fitting/fit_terms.h"

namespace scatter::reflectance {
namespace {

/// A simpler family wins when it is no more than this much worse.
constexpr double kNoWorse = 1.02;
/// Below this nobody is worse: it is what rounding to float leaves of an exact fit, and more.
constexpr double kExact = 1e-6;

/// Fold of every incidence: neighbours go to different folds, so that what is held back lies between
/// incidences that are kept.
std::vector<std::size_t> folds_of(const FitSamples& samples, std::size_t folds) {
  std::vector<std::size_t> order(samples.incidences.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    order[k] = k;
  }
  std::ranges::stable_sort(order, {}, [&](std::size_t k) { return samples.incidences[k].theta_i; });
  std::vector<std::size_t> fold(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    fold[order[k]] = k % folds;
  }
  return fold;
}

struct Fold {
  FitSamples kept;
  FitSamples held;
  std::vector<std::size_t> incidence;  ///< Of `held`, as numbered in all samples.
};

FamilyScore validate(const std::vector<Fold>& folds, const FitFamily& family, const FitOptions& options,
                     std::size_t incidences) {
  FamilyScore score{.family = family,
                    .parameters = shape_parameters(family).size() +
                                  coefficients(family).size() * folds.front().kept.channels,
                    .incidence_residual = std::vector<double>(incidences, 0.0)};
  double squares = 0;
  for (const Fold& fold : folds) {
    const auto fitted = fit(fold.kept, family, options);
    if (!fitted) {
      score.failure = fitted.error().what;
      return score;
    }
    const auto found = losses(*fitted->model, fold.held, options.residual);
    if (!found) {
      score.failure = found.error().what;
      return score;
    }
    for (std::size_t k = 0; k < found->size(); ++k) {
      score.incidence_residual[fold.incidence[k]] = (*found)[k].rms_residual;
      squares += (*found)[k].rms_residual * (*found)[k].rms_residual;
      score.mean_relative_error += (*found)[k].mean_relative_error;
    }
  }
  score.rms_residual = std::sqrt(squares / static_cast<double>(incidences));
  score.mean_relative_error /= static_cast<double>(incidences);
  return score;
}

}  // namespace

Result<Selection> select_model(const FitSamples& samples, const SelectOptions& options) {
  if (const auto sound = check(samples); !sound) {
    return std::unexpected(sound.error());
  }
  if (options.families.empty() || options.folds < 2) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("model selection among {} families in {} folds", options.families.size(), options.folds),
        "name at least one family and at least two folds");
  }
  if (samples.incidences.size() < 2) {
    return fail(ErrorCode::kFailedPrecondition,
                "model selection holds incidences back, but there is only one",
                "measure more incidences, or name the model to fit");
  }
  const FitSamples some = thinned(samples, options.fold_samples);
  const std::size_t count = std::min(options.folds, some.incidences.size());
  const std::vector<std::size_t> fold_of = folds_of(some, count);
  std::vector<Fold> folds;
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<bool> keep(fold_of.size());
    std::vector<bool> hold(fold_of.size());
    Fold fold;
    for (std::size_t i = 0; i < fold_of.size(); ++i) {
      keep[i] = fold_of[i] != k;
      hold[i] = !keep[i];
      if (hold[i]) {
        fold.incidence.push_back(i);
      }
    }
    fold.kept = only(some, keep);
    fold.held = only(some, hold);
    folds.push_back(std::move(fold));
  }

  Selection selection;
  const FamilyScore* best = nullptr;
  for (std::size_t k = 0; k < options.families.size(); ++k) {
    if (options.progress) {
      options.progress(static_cast<double>(k) / static_cast<double>(options.families.size() + 1),
                       "cross-validating " + name(options.families[k]));
    }
    selection.scores.push_back(validate(folds, options.families[k], options.fit, some.incidences.size()));
    if (options.fit.stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "the fit was stopped", "start it again");
    }
  }
  for (const FamilyScore& score : selection.scores) {
    if (score.failure.empty() && (best == nullptr || score.rms_residual < best->rms_residual)) {
      best = &score;
    }
  }
  if (best == nullptr) {
    return fail(ErrorCode::kFailedPrecondition,
                "no family could be fitted: " + selection.scores.front().failure,
                "check the data with: scatter inspect FILE");
  }
  const double limit = std::max(best->rms_residual * kNoWorse, kExact);
  for (const FamilyScore& score : selection.scores) {
    if (score.failure.empty() && score.rms_residual <= limit && score.parameters < best->parameters) {
      best = &score;
    }
  }
  if (options.progress) {
    options.progress(
        static_cast<double>(options.families.size()) / static_cast<double>(options.families.size() + 1),
        "fitting " + name(best->family));
  }
  auto fitted = fit(samples, best->family, options.fit);
  if (!fitted) {
    return std::unexpected(fitted.error());
  }
  selection.best = std::move(*fitted);
  return selection;
}

}  // namespace scatter::reflectance
