// Analytic models fitted to measured samples by weighted least squares.
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/fitting/fit_family.h"
#include "host_sdk/reflectance/fitting/fit_samples.h"
#include "host_sdk/reflectance/fitting/fitted_brdf.h"

namespace scatter::reflectance {

/// What is made small; m is the model, c the cosine of theta_o.
enum class Residual : std::uint8_t {
  kLog,          ///< ln(f c + e) - ln(m c + e); e: a thousandth of the median of f c, or the noise.
  kCubeRoot,     ///< cbrt(f c) - cbrt(m c): bright parts count more.
  kUncertainty,  ///< (f - m) / sigma: needs sigma_per_sr.
};

/// How much a sample counts.
enum class Weighting : std::uint8_t {
  kSolidAngleAndFlux,  ///< Half by solid angle, half by where the fitted model sends the light.
  kSolidAngle,
  kEqual,
};

struct FitOptions {
  Residual residual = Residual::kLog;
  Weighting weighting = Weighting::kSolidAngleAndFlux;
  /// Local searches after a coarse scan of the shape parameters, 1..16.
  std::size_t starts = 3;
  /// Ask for it to stop early; the fit then fails with kAborted.
  std::stop_token stop = {};
};

/// How far the data pin a parameter down.
enum class Standing : std::uint8_t {
  kDetermined,
  kAtLowerBound,  ///< The data ask for less than the model can have; sigma is 0 and says nothing.
  kAtUpperBound,
  kUndetermined,  ///< Changing it changes (nearly) nothing: the value is arbitrary.
};
[[nodiscard]] std::string_view name(Standing standing) noexcept;

struct FitParameter {
  static constexpr std::size_t kShared = std::numeric_limits<std::size_t>::max();
  std::string name = {};          ///< Key of the model spec: "alpha", "f0", "albedo", "ks", ...
  std::size_t channel = kShared;  ///< kShared: the same for all channels.
  double value = 0;
  double sigma = 0;   ///< Standard uncertainty from the scatter of the residuals.
  double low_95 = 0;  ///< 95 % confidence interval, inside the bounds.
  double high_95 = 0;
  double lower_bound = 0;
  double upper_bound = 0;
  Standing standing = Standing::kDetermined;
};

/// How far the model is from the samples of one incidence.
struct IncidenceLoss {
  double theta_i = 0;  ///< [rad]
  double phi_i = 0;    ///< [rad]
  std::size_t samples = 0;
  double rms_residual = 0;         ///< In the units of the chosen residual, by solid angle.
  double mean_relative_error = 0;  ///< |m - f| / f over f > 0, by solid angle.
  double relative_flux_error = 0;  ///< Sum of |m - f| c over sum of f c, by solid angle.
};

struct FitResult {
  FitFamily family = {};
  std::shared_ptr<const FittedBrdf> model = {};
  /// Text that make_model turns into the same BRDF; empty for glTF and for other channel counts
  /// than 1 and 3.
  std::string spec = {};
  std::vector<FitParameter> parameters = {};  ///< Shared ones first, then channel after channel.
  /// Covariance of the parameters, row after row; empty when there are more than 64.
  std::vector<double> covariance = {};
  double rms_residual = 0;  ///< Over all samples and channels, weighted as fitted.
  double mean_relative_error = 0;
  /// kUncertainty only: sum of squared residuals over degrees of freedom; 1 when the model is right.
  std::optional<double> reduced_chi_square = {};
  std::vector<IncidenceLoss> incidences = {};
  std::size_t samples = 0;
  /// Sentences about what cannot be trusted: parameters at bounds, invisible lobes, ....
  std::vector<std::string> remarks = {};
};

/// Fits one family.
///
/// The intervals cover 95 % when the model family is right and the samples' errors are independent,
/// whatever their size and however they vary (sandwich estimator); they say nothing about a family
/// that does not fit. Where the fit is close (rms of the log residual below 0.2) the estimate is freed
/// of the bias that a curved residual has under noise, by reweighting the linear residual.
/// Errors    kInvalidArgument: check(samples), fewer samples than 3 per parameter, no sigma with
///           kUncertainty; kFailedPrecondition: no positive value, more negative than positive ones;
///           kAborted: stopped; kInternal: no convergence.
/// Threads   any number may fit at once; one fit uses one thread.
[[nodiscard]] Result<FitResult> fit(const FitSamples& samples, const FitFamily& family,
                                    const FitOptions& options = {});

/// How far a BRDF is from samples, one entry per incidence, as in FitResult (kLog and kCubeRoot; with
/// kUncertainty the samples' sigma is needed).
[[nodiscard]] Result<std::vector<IncidenceLoss>> losses(const Brdf& brdf, const FitSamples& samples,
                                                        Residual residual = Residual::kLog);

/// Cross-validation of one family.
struct FamilyScore {
  FitFamily family = {};
  std::size_t parameters = 0;
  /// Root mean square of the held-back incidences' residuals (rms_residual, each incidence alike).
  double rms_residual = 0;
  double mean_relative_error = 0;               ///< Of the held-back incidences.
  std::vector<double> incidence_residual = {};  ///< rms_residual when that incidence was held back.
  std::string failure = {};                     ///< Not empty: it could not be fitted, and why.
};

struct Selection {
  FitResult best = {};                   ///< Fitted to all samples.
  std::vector<FamilyScore> scores = {};  ///< As tried; the smallest rms_residual won.
};

struct SelectOptions {
  FitOptions fit = {};
  std::vector<FitFamily> families = default_families();
  std::size_t folds = 6;            ///< Most groups of incidences held back in turn, >= 2.
  std::size_t fold_samples = 4000;  ///< Samples of a cross-validation fit.
  /// Called with 0..1 and what is being done.
  std::function<void(double, const std::string&)> progress = {};
};

/// Holds incidences back in turn, predicts them, and fits the family that did best to everything.
/// Of two within 2 % of each other the simpler one wins.
/// Errors    as fit; kFailedPrecondition: fewer than two incidences; no family could be fitted.
[[nodiscard]] Result<Selection> select_model(const FitSamples& samples, const SelectOptions& options = {});

}  // namespace scatter::reflectance
