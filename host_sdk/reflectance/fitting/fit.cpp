#include "host_sdk/reflectance/fitting/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "host_sdk/reflectance/fitting/fit_data.h"
#include "host_sdk/reflectance/fitting/fit_spec.h"
#include "host_sdk/reflectance/fitting/fit_starts.h"
#include "host_sdk/reflectance/fitting/fit_terms.h"
#include "host_sdk/reflectance/fitting/least_squares.h"
#include "host_sdk/reflectance/fitting/parameter_uncertainty.h"

namespace scatter::reflectance {
namespace {

/// Samples of the first searches; the second lobe wants more.
constexpr std::size_t kCoarseSamples = 1500;
/// Above this rms of the log residual the family does not fit, and noise is not what matters.
constexpr double kCloseFit = 0.2;

Status can_be_fitted(const FitSamples& samples, const FitFamily& family, const FitOptions& options) {
  if (const auto sound = check(samples); !sound) {
    return sound;
  }
  const std::size_t values = samples.size() * samples.channels;
  const std::size_t count = shape_parameters(family).size() + coefficients(family).size() * samples.channels;
  if (values < 3 * count) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("fit: {} values for the {} parameters of {}, at least {} are needed", values,
                            count, name(family), 3 * count),
                "measure more directions, or fit a simpler model");
  }
  if (options.residual == Residual::kUncertainty && samples.sigma_per_sr.empty()) {
    return fail(ErrorCode::kInvalidArgument,
                "fit: residuals by uncertainty, but the samples have none above 0",
                "use log or cube-root residuals");
  }
  const auto positive =
      static_cast<std::size_t>(std::ranges::count_if(samples.f_per_sr, [](double f) { return f > 0; }));
  const auto negative =
      static_cast<std::size_t>(std::ranges::count_if(samples.f_per_sr, [](double f) { return f < 0; }));
  if (positive == 0 || negative >= positive) {
    return fail(
        ErrorCode::kFailedPrecondition,
        fmt::format("fit: {} positive and {} negative values among {}: this is no BRDF but noise about zero",
                    positive, negative, values),
        "check dark subtraction and units, or fit only the channels that hold light");
  }
  return {};
}

/// 97.5 % point of Student's t.
/// Source  Abramowitz and Stegun 26.7.5, two terms: within 1 % from 3 degrees of freedom on.
double t_975(double freedom) {
  const double z = 1.959963984540054;
  const double z3 = z * z * z;
  return z + (z3 + z) / (4 * freedom) + (5 * z3 * z * z + 16 * z3 + 3 * z) / (96 * freedom * freedom);
}

/// Narrow lobe first, so that names mean the same in every fit.
void order_lobes(const FitFamily& family, std::size_t channels, FitPoint& point) {
  if (family.lobes.size() != 2 || family.lobes[0] != family.lobes[1]) {
    return;
  }
  const std::vector<ShapeParameter> parameters = shape_parameters(family);
  const std::size_t first = family.base == FitBase::kOrenNayar ? 1 : 0;
  const std::size_t each = (parameters.size() - first) / 2;
  const bool exponent = family.lobes[0] == FitLobe::kLafortune;
  const double a = point.shape[first];
  const double b = point.shape[first + each];
  if (exponent ? a >= b : a <= b) {
    return;
  }
  for (std::size_t p = 0; p < each; ++p) {
    std::swap(point.shape[first + p], point.shape[first + each + p]);
  }
  for (std::size_t c = 0; c < channels; ++c) {
    std::swap(point.coefficient[c * 3 + 1], point.coefficient[c * 3 + 2]);
  }
}

/// The best of several searches on some of the samples.
Result<FitPoint> coarse_fit(const FitSamples& samples, const FitFamily& family, const FitOptions& options,
                            std::span<const double> floor) {
  const std::size_t wanted = kCoarseSamples * std::max<std::size_t>(family.lobes.size(), 1);
  const FitData data = make_fit_data(thinned(samples, wanted), options.residual, options.weighting, floor);
  std::optional<FitPoint> best;
  double least = 0;
  for (FitPoint& point : starts(data, family, options.starts)) {
    const auto cost =
        search(data, family, {.max_iterations = 60, .tolerance = 1e-7, .stop = options.stop}, point);
    if (!cost) {
      return std::unexpected(cost.error());
    }
    if (!best || *cost < least) {
      least = *cost;
      best = std::move(point);
    }
  }
  if (!best) {
    return fail(ErrorCode::kInternal, "fit: no start of " + name(family) + " gives finite residuals",
                "check the units of the data: values should be in 1/sr");
  }
  return *best;
}

/// Same minimum without the curve's bias: the slopes are those of the model, found by turns.
Status polish(const FitData& data, const FitFamily& family, const FitOptions& options, FitPoint& point) {
  double before = -1;
  for (int round = 0; round < 6; ++round) {
    const std::vector<double> frozen = slopes(data, family, point);
    const auto cost =
        search(data, family,
               {.max_iterations = 4, .tolerance = 1e-9, .frozen_slope = frozen, .stop = options.stop}, point);
    if (!cost) {
      return std::unexpected(cost.error());
    }
    // The slopes change the cost by as little as the parameters still move.
    if (before >= 0 && std::abs(*cost - before) <= 1e-7 * before) {
      return {};
    }
    before = *cost;
  }
  return {};
}

struct Named {
  std::string name;
  std::size_t channel = FitParameter::kShared;
  double value = 0;
  double lower = 0;
  double upper = 1;
  bool logarithmic = false;
};

std::vector<Named> named_parameters(const FitFamily& family, const FitPoint& point, std::size_t channels) {
  std::vector<Named> all;
  const std::vector<ShapeParameter> shape = shape_parameters(family);
  for (std::size_t p = 0; p < shape.size(); ++p) {
    all.push_back({shape[p].name, FitParameter::kShared, point.shape[p], shape[p].lower, shape[p].upper,
                   shape[p].logarithmic});
  }
  const std::vector<Coefficient> terms = coefficients(family);
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t j = 0; j < terms.size(); ++j) {
      all.push_back({terms[j].name, c, point.coefficient[c * terms.size() + j], 0, 1, false});
    }
  }
  return all;
}

void describe_parameters(const FitData& data, const FitPoint& point, const ParameterUncertainty& uncertainty,
                         FitResult& result) {
  const std::vector<Named> all = named_parameters(result.family, point, data.channels);
  const double values = static_cast<double>(data.size() * data.channels);
  const double t = t_975(std::max(values - static_cast<double>(all.size()), 1.0));
  std::vector<double> scale;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Named& parameter = all[k];
    FitParameter out{.name = parameter.name,
                     .channel = parameter.channel,
                     .value = parameter.value,
                     .sigma = 0,
                     .low_95 = parameter.value,
                     .high_95 = parameter.value,
                     .lower_bound = parameter.lower,
                     .upper_bound = parameter.upper,
                     .standing = uncertainty.standing[k]};
    const double sigma = uncertainty.sigma[k];
    scale.push_back(parameter.logarithmic ? parameter.value : 1.0);
    if (out.standing == Standing::kDetermined) {
      const auto searched = [&](double v) { return parameter.logarithmic ? std::log(v) : v; };
      const auto shown = [&](double v) { return parameter.logarithmic ? std::exp(v) : v; };
      const double middle = searched(parameter.value);
      out.sigma = sigma * scale.back();
      out.low_95 = std::max(shown(middle - t * sigma), parameter.lower);
      out.high_95 = std::min(shown(middle + t * sigma), parameter.upper);
      if (2 * t * sigma > 0.9 * (searched(parameter.upper) - searched(parameter.lower))) {
        out.standing = Standing::kUndetermined;
      }
    }
    if (out.standing == Standing::kUndetermined) {
      out.sigma = std::numeric_limits<double>::infinity();
      out.low_95 = parameter.lower;
      out.high_95 = parameter.upper;
    }
    result.parameters.push_back(std::move(out));
  }
  result.covariance = uncertainty.covariance;
  for (std::size_t i = 0; i < scale.size() && !result.covariance.empty(); ++i) {
    for (std::size_t j = 0; j < scale.size(); ++j) {
      result.covariance[i * scale.size() + j] *= scale[i] * scale[j];
    }
  }
}

/// "f0 of channels 1, 2".
std::string listed(const FitResult& result, Standing standing) {
  std::string text;
  for (const FitParameter& parameter : result.parameters) {
    if (parameter.standing == standing) {
      text += text.empty() ? "" : ", ";
      text += parameter.name;
      if (parameter.channel != FitParameter::kShared) {
        text += fmt::format(" of channel {}", parameter.channel + 1);
      }
    }
  }
  return text;
}

void remark(const FitSamples& samples, bool close, const FitOptions& options, FitResult& result) {
  if (const auto text = listed(result, Standing::kUndetermined); !text.empty()) {
    result.remarks.push_back("not determined by the data, any value does: " + text);
  }
  if (const auto text = listed(result, Standing::kAtLowerBound); !text.empty()) {
    result.remarks.push_back("at the lower bound: " + text);
  }
  if (const auto text = listed(result, Standing::kAtUpperBound); !text.empty()) {
    result.remarks.push_back("at the upper bound: " + text);
  }
  if (samples.incidences.size() == 1) {
    result.remarks.emplace_back(
        "one incidence only: how the material changes with the angle of incidence is "
        "the model's guess");
  }
  if (!close && options.residual != Residual::kUncertainty) {
    result.remarks.emplace_back(
        "the family does not fit closely: the intervals say how well its best parameters "
        "are known, not how true they are");
  }
  if (options.residual == Residual::kUncertainty && result.reduced_chi_square &&
      *result.reduced_chi_square > 2) {
    result.remarks.push_back(
        fmt::format("residuals are {:.1f} times as large as the stated uncertainties: the "
                    "family does not fit, or the uncertainties are too small",
                    std::sqrt(*result.reduced_chi_square)));
  }
}

}  // namespace

std::string_view name(Standing standing) noexcept {
  switch (standing) {
    case Standing::kDetermined:
      return "determined";
    case Standing::kAtLowerBound:
      return "at lower bound";
    case Standing::kAtUpperBound:
      return "at upper bound";
    case Standing::kUndetermined:
      break;
  }
  return "undetermined";
}

Result<FitResult> fit(const FitSamples& samples, const FitFamily& family, const FitOptions& options) {
  if (const auto possible = can_be_fitted(samples, family, options); !possible) {
    return std::unexpected(possible.error());
  }
  if (options.starts < 1 || options.starts > 16) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("fit: {} starts", options.starts), "use 1 to 16");
  }
  const std::vector<double> floor = residual_floor(samples);
  auto point = coarse_fit(samples, family, options, floor);
  if (!point) {
    return std::unexpected(point.error());
  }
  FitData data = make_fit_data(samples, options.residual, options.weighting, floor);
  weigh_by_model(data, options.weighting, family, *point);
  if (const auto cost = search(data, family, {.tolerance = 1e-8, .stop = options.stop}, *point); !cost) {
    return std::unexpected(cost.error());
  }
  const double in_log = options.residual == Residual::kCubeRoot ? kCloseFit / 3 : kCloseFit;
  const double rms = rms_residual(data, family, *point);
  double typical = 1;  // the cube root's residual is relative to the root itself
  if (options.residual == Residual::kCubeRoot) {
    double sum = 0;
    for (const double target : data.target) {
      sum += std::abs(target);
    }
    typical = sum / static_cast<double>(data.target.size());
  }
  const bool close = options.residual == Residual::kUncertainty || rms < in_log * typical;
  if (close && options.residual != Residual::kUncertainty) {
    if (const auto polished = polish(data, family, options, *point); !polished) {
      return std::unexpected(polished.error());
    }
  }
  order_lobes(family, data.channels, *point);

  FitResult result{.family = family};
  result.rms_residual = rms_residual(data, family, *point);
  result.samples = samples.size();
  describe_parameters(data, *point, parameter_uncertainty(data, family, *point, slopes(data, family, *point)),
                      result);
  if (options.residual == Residual::kUncertainty) {
    const double values = static_cast<double>(data.size() * data.channels);
    result.reduced_chi_square = result.rms_residual * result.rms_residual * values /
                                std::max(values - static_cast<double>(result.parameters.size()), 1.0);
  }
  FittedBrdf::Parameters parameters{.family = family,
                                    .shape = point->shape,
                                    .coefficient = point->coefficient,
                                    .channels = samples.channels,
                                    .wavelengths_nm = samples.wavelengths_nm};
  result.spec = model_spec(parameters);
  result.model = std::make_shared<const FittedBrdf>(std::move(parameters));
  auto incidences = losses(*result.model, samples, options.residual);
  if (!incidences) {
    return std::unexpected(incidences.error());
  }
  result.incidences = std::move(*incidences);
  double weight = 0;
  for (const IncidenceLoss& loss : result.incidences) {
    result.mean_relative_error += loss.mean_relative_error * static_cast<double>(loss.samples);
    weight += static_cast<double>(loss.samples);
  }
  result.mean_relative_error /= weight;
  remark(samples, close, options, result);
  return result;
}

Result<std::vector<IncidenceLoss>> losses(const Brdf& brdf, const FitSamples& samples, Residual residual) {
  if (const auto sound = check(samples); !sound) {
    return std::unexpected(sound.error());
  }
  if (brdf.channels() != samples.channels) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("losses: {} channels against {}", brdf.channels(), samples.channels),
                "compare BRDFs of the same channels");
  }
  if (residual == Residual::kUncertainty && samples.sigma_per_sr.empty()) {
    return fail(ErrorCode::kInvalidArgument,
                "losses: residuals by uncertainty, but the samples have none above 0",
                "use log or cube-root residuals");
  }
  const std::vector<double> floor = residual_floor(samples);
  std::vector<double> model(samples.f_per_sr.size());
  std::vector<IncidenceLoss> out;
  for (const FitSamples::Incidence& incidence : samples.incidences) {
    const std::size_t channels = samples.channels;
    const std::span values = std::span(model).subspan(incidence.first * channels, incidence.count * channels);
    brdf.eval_batch(from_spherical(incidence.theta_i, incidence.phi_i),
                    std::span(samples.omega_o).subspan(incidence.first, incidence.count), values, {});
    IncidenceLoss loss{.theta_i = incidence.theta_i, .phi_i = incidence.phi_i, .samples = incidence.count};
    double squares = 0;
    double weight = 0;
    double relative = 0;
    double positive = 0;
    double missing = 0;
    double flux = 0;
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      const double omega = samples.solid_angle_sr[k];
      const double cosine = samples.omega_o[k].z;
      for (std::size_t c = 0; c < channels; ++c) {
        const double f = samples.f_per_sr[k * channels + c];
        const double m = model[k * channels + c];
        const double e = floor[c];
        const double r = residual == Residual::kUncertainty
                             ? (m - f) / samples.sigma_per_sr[k * channels + c]
                             : transformed(residual, std::max(m * cosine + e, 0.1 * e)) -
                                   transformed(residual, std::max(f * cosine + e, 0.1 * e));
        squares += omega * r * r;
        weight += omega;
        if (f > 0) {
          relative += omega * std::abs(m - f) / f;
          positive += omega;
        }
        missing += omega * std::abs(m - f) * cosine;
        flux += omega * f * cosine;
      }
    }
    loss.rms_residual = std::sqrt(squares / weight);
    loss.mean_relative_error = positive > 0 ? relative / positive : 0;
    loss.relative_flux_error = flux > 0 ? missing / flux : 0;
    out.push_back(loss);
  }
  return out;
}

}  // namespace scatter::reflectance
