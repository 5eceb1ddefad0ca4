#include "host_sdk/reflectance/fitting/least_squares.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "host_sdk/reflectance/fitting/fit_terms.h"

namespace scatter::reflectance {
namespace {

/// Terms with derivatives at the point that Ceres asks for, computed once for all channels.
class SharedTerms final : public ceres::EvaluationCallback {
 public:
  SharedTerms(const FitData& data, const FitFamily& family, const std::vector<double>& searched)
      : data_(data),
        family_(family),
        parameters_(shape_parameters(family)),
        searched_(searched),
        columns_(1 + parameters_.size()),
        stride_(1 + coefficients(family).size()),
        shape_(parameters_.size()) {}

  void PrepareForEvaluation(bool evaluate_jacobians, bool new_point) override {
    if (!new_point && (with_derivatives_ || !evaluate_jacobians)) {
      return;
    }
    for (std::size_t p = 0; p < shape_.size(); ++p) {
      shape_[p] = parameters_[p].logarithmic ? std::exp(searched_[p]) : searched_[p];
    }
    // Derivatives at every point: most accepted steps ask for them next, and they cost little more.
    value_.resize(data_.size() * stride_ * columns_);
    evaluate_terms_with_derivatives(family_, shape_, data_.geometry, value_);
    with_derivatives_ = true;
  }

  [[nodiscard]] const double* at(std::size_t k) const { return value_.data() + k * stride_ * columns_; }
  [[nodiscard]] std::size_t columns() const { return columns_; }
  [[nodiscard]] std::size_t terms() const { return stride_ - 1; }
  [[nodiscard]] std::size_t shapes() const { return shape_.size(); }
  /// Derivative of shape parameter p by what is searched.
  [[nodiscard]] double scale(std::size_t p) const { return parameters_[p].logarithmic ? shape_[p] : 1.0; }

 private:
  const FitData& data_;
  const FitFamily& family_;
  std::vector<ShapeParameter> parameters_;
  const std::vector<double>& searched_;
  std::size_t columns_;
  std::size_t stride_;
  std::vector<double> shape_;
  std::vector<double> value_;
  bool with_derivatives_ = false;
};

/// Residuals of one channel; parameter blocks: shape (if the family has any), coefficients.
class ChannelCost final : public ceres::CostFunction {
 public:
  ChannelCost(const FitData& data, const SharedTerms& terms, std::size_t channel,
              std::span<const double> frozen)
      : data_(data), terms_(terms), channel_(channel), frozen_(frozen) {
    set_num_residuals(static_cast<int>(data.size()));
    if (terms.shapes() > 0) {
      mutable_parameter_block_sizes()->push_back(static_cast<int>(terms.shapes()));
    }
    mutable_parameter_block_sizes()->push_back(static_cast<int>(terms.terms()));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const std::size_t shapes = terms_.shapes();
    const std::size_t count = terms_.terms();
    const std::size_t columns = terms_.columns();
    const std::size_t last = shapes > 0 ? 1 : 0;
    const double* coefficient = parameters[last];
    double* by_shape = jacobians != nullptr && last == 1 ? jacobians[0] : nullptr;
    double* by_coefficient = jacobians != nullptr ? jacobians[last] : nullptr;
    for (std::size_t k = 0; k < data_.size(); ++k) {
      const double* term = terms_.at(k);
      double m = term[0];
      for (std::size_t j = 0; j < count; ++j) {
        m += coefficient[j] * term[(1 + j) * columns];
      }
      const double slope = residual(k, m, residuals[k]);
      if (by_shape != nullptr) {
        for (std::size_t p = 0; p < shapes; ++p) {
          double derivative = term[1 + p];
          for (std::size_t j = 0; j < count; ++j) {
            derivative += coefficient[j] * term[(1 + j) * columns + 1 + p];
          }
          by_shape[k * shapes + p] = slope * derivative * terms_.scale(p);
        }
      }
      if (by_coefficient != nullptr) {
        for (std::size_t j = 0; j < count; ++j) {
          by_coefficient[k * count + j] = slope * term[(1 + j) * columns];
        }
      }
    }
    return true;
  }

 private:
  /// Returns its derivative by m.
  double residual(std::size_t k, double m, double& r) const {
    const std::size_t at = channel_ * data_.size() + k;
    if (!frozen_.empty()) {
      r = frozen_[at] * (m - data_.f_per_sr[at]);
      return frozen_[at];
    }
    if (data_.residual == Residual::kUncertainty) {
      const double slope = data_.inverse_sigma[at] * data_.root_weight[k];
      r = slope * (m - data_.f_per_sr[at]);
      return slope;
    }
    const double cosine = data_.geometry[k].cos_o;
    const double floored = m * cosine + data_.floor[channel_];
    r = data_.root_weight[k] * (transformed(data_.residual, floored) - data_.target[at]);
    return data_.root_weight[k] * cosine * transformed_slope(data_.residual, floored);
  }

  const FitData& data_;
  const SharedTerms& terms_;
  std::size_t channel_;
  std::span<const double> frozen_;
};

class StopWhenAsked final : public ceres::IterationCallback {
 public:
  explicit StopWhenAsked(std::stop_token stop) : stop_(std::move(stop)) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return stop_.stop_requested() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  std::stop_token stop_;
};

}  // namespace

Result<double> search(const FitData& data, const FitFamily& family, const SearchOptions& options,
                      FitPoint& point) {
  const std::vector<ShapeParameter> parameters = shape_parameters(family);
  const std::size_t terms = point.coefficient.size() / data.channels;
  const auto searched_of = [&](std::size_t p, double value) {
    return parameters[p].logarithmic ? std::log(value) : value;
  };
  std::vector<double> searched(parameters.size());
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    searched[p] = searched_of(p, point.shape[p]);
  }
  SharedTerms shared(data, family, searched);
  ceres::Problem::Options ownership;
  ownership.evaluation_callback = &shared;
  ceres::Problem problem(ownership);
  for (std::size_t c = 0; c < data.channels; ++c) {
    auto* cost = new ChannelCost(data, shared, c, options.frozen_slope);  // the problem owns it
    double* coefficient = point.coefficient.data() + c * terms;
    if (parameters.empty()) {
      problem.AddResidualBlock(cost, nullptr, coefficient);
    } else {
      problem.AddResidualBlock(cost, nullptr, searched.data(), coefficient);
    }
    for (std::size_t j = 0; j < terms; ++j) {
      problem.SetParameterLowerBound(coefficient, static_cast<int>(j), 0);
      problem.SetParameterUpperBound(coefficient, static_cast<int>(j), 1);
    }
  }
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    problem.SetParameterLowerBound(searched.data(), static_cast<int>(p), searched_of(p, parameters[p].lower));
    problem.SetParameterUpperBound(searched.data(), static_cast<int>(p), searched_of(p, parameters[p].upper));
  }
  StopWhenAsked stopper(options.stop);
  ceres::Solver::Options how;
  // Few parameters: forming J^T J is the cheapest; a spectrum makes it sparse.
  how.linear_solver_type = data.channels <= 6 ? ceres::DENSE_NORMAL_CHOLESKY : ceres::SPARSE_NORMAL_CHOLESKY;
  how.max_num_iterations = options.max_iterations;
  how.function_tolerance = options.tolerance;
  how.parameter_tolerance = 1e-9;
  how.gradient_tolerance = 1e-14;
  how.num_threads = 1;
  how.logging_type = ceres::SILENT;
  how.callbacks.push_back(&stopper);
  ceres::Solver::Summary summary;
  ceres::Solve(how, &problem, &summary);
  if (options.stop.stop_requested()) {
    return fail(ErrorCode::kAborted, "the fit was stopped", "start it again");
  }
  if (!summary.IsSolutionUsable()) {
    return fail(ErrorCode::kInternal, "the search failed: " + summary.message,
                "fit fewer parameters, or look at the data with: scatter inspect FILE");
  }
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    const double value = parameters[p].logarithmic ? std::exp(searched[p]) : searched[p];
    point.shape[p] = std::clamp(value, parameters[p].lower, parameters[p].upper);
  }
  return summary.final_cost;
}

std::vector<double> slopes(const FitData& data, const FitFamily& family, const FitPoint& point) {
  const std::size_t n = data.size();
  const std::size_t terms = point.coefficient.size() / data.channels;
  std::vector<double> value(n * (1 + terms));
  evaluate_terms(family, point.shape, data.geometry, value);
  std::vector<double> out(n * data.channels);
  for (std::size_t c = 0; c < data.channels; ++c) {
    for (std::size_t k = 0; k < n; ++k) {
      if (data.residual == Residual::kUncertainty) {
        out[c * n + k] = data.inverse_sigma[c * n + k] * data.root_weight[k];
        continue;
      }
      const double* term = value.data() + k * (1 + terms);
      double m = term[0];
      for (std::size_t j = 0; j < terms; ++j) {
        m += point.coefficient[c * terms + j] * term[1 + j];
      }
      const double cosine = data.geometry[k].cos_o;
      out[c * n + k] =
          data.root_weight[k] * cosine * transformed_slope(data.residual, m * cosine + data.floor[c]);
    }
  }
  return out;
}

}  // namespace scatter::reflectance
