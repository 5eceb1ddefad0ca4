#include "host_sdk/reflectance/fitting/parameter_uncertainty.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>

#include "host_sdk/reflectance/fitting/fit_terms.h"

namespace scatter::reflectance {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kMostForCovariance = 64;
/// Smallest eigenvalue of a matrix scaled to a unit diagonal that counts as information.
constexpr double kSmallestEigenvalue = 1e-11;

/// The normal equations are an arrow: every channel's coefficients meet the shape, never each other.
struct Arrow {
  MatrixXd shape;                 // shapes x shapes
  std::vector<MatrixXd> border;   // shapes x terms, per channel
  std::vector<MatrixXd> channel;  // terms x terms, per channel
};

/// Gradients of a sample's residuals with respect to what is searched.
class Gradients {
 public:
  Gradients(const FitData& data, const FitFamily& family, const FitPoint& point,
            std::span<const double> slope)
      : data_(data),
        point_(point),
        slope_(slope),
        shapes_(point.shape.size()),
        terms_(point.coefficient.size() / data.channels) {
    value_.resize(data.size() * (1 + terms_) * (1 + shapes_));
    evaluate_terms_with_derivatives(family, point.shape, data.geometry, value_);
    for (const ShapeParameter& parameter : shape_parameters(family)) {
      const std::size_t p = scale_.size();
      scale_.push_back(parameter.logarithmic ? point.shape[p] : 1.0);
    }
  }

  /// by_shape and by_term are filled; returns the residual.
  double row(std::size_t k, std::size_t c, VectorXd& by_shape, VectorXd& by_term) const {
    const double* term = value_.data() + k * (1 + terms_) * (1 + shapes_);
    const double* x = point_.coefficient.data() + c * terms_;
    const std::size_t at = c * data_.size() + k;
    double m = term[0];
    for (std::size_t j = 0; j < terms_; ++j) {
      const double value = term[(1 + j) * (1 + shapes_)];
      m += x[j] * value;
      by_term[static_cast<Eigen::Index>(j)] = slope_[at] * value;
    }
    for (std::size_t p = 0; p < shapes_; ++p) {
      double derivative = term[1 + p];
      for (std::size_t j = 0; j < terms_; ++j) {
        derivative += x[j] * term[(1 + j) * (1 + shapes_) + 1 + p];
      }
      by_shape[static_cast<Eigen::Index>(p)] = slope_[at] * derivative * scale_[p];
    }
    return slope_[at] * (m - data_.f_per_sr[at]);
  }

  [[nodiscard]] std::size_t shapes() const { return shapes_; }
  [[nodiscard]] std::size_t terms() const { return terms_; }

 private:
  const FitData& data_;
  const FitPoint& point_;
  std::span<const double> slope_;
  std::size_t shapes_;
  std::size_t terms_;
  std::vector<double> value_;
  std::vector<double> scale_;
};

Arrow normal_equations(const FitData& data, const Gradients& gradients) {
  const auto shapes = static_cast<Eigen::Index>(gradients.shapes());
  const auto terms = static_cast<Eigen::Index>(gradients.terms());
  Arrow arrow{MatrixXd::Zero(shapes, shapes), {}, {}};
  VectorXd s(shapes);
  VectorXd t(terms);
  for (std::size_t c = 0; c < data.channels; ++c) {
    MatrixXd border = MatrixXd::Zero(shapes, terms);
    MatrixXd own = MatrixXd::Zero(terms, terms);
    for (std::size_t k = 0; k < data.size(); ++k) {
      gradients.row(k, c, s, t);
      arrow.shape.noalias() += s * s.transpose();
      border.noalias() += s * t.transpose();
      own.noalias() += t * t.transpose();
    }
    arrow.border.push_back(std::move(border));
    arrow.channel.push_back(std::move(own));
  }
  return arrow;
}

/// Takes parameter `index` out of a symmetric matrix: no coupling, unit diagonal.
void hold(MatrixXd& m, Eigen::Index index) {
  m.row(index).setZero();
  m.col(index).setZero();
  m(index, index) = 1;
}

/// Parameters that take part in a direction without information; empty when all are determined.
std::vector<Eigen::Index> undetermined(const MatrixXd& m, const VectorXd& reference) {
  std::vector<Eigen::Index> found;
  MatrixXd scaled = m;
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    if (!(reference[i] > 0) || !std::isfinite(reference[i])) {
      found.push_back(i);
    }
  }
  if (!found.empty() || m.rows() == 0) {
    return found;
  }
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.rows(); ++j) {
      scaled(i, j) = m(i, j) / std::sqrt(reference[i] * reference[j]);
    }
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  for (Eigen::Index e = 0; e < m.rows(); ++e) {
    if (eigen.eigenvalues()[e] < kSmallestEigenvalue) {
      for (Eigen::Index i = 0; i < m.rows(); ++i) {
        if (std::abs(eigen.eigenvectors()(i, e)) > 0.3) {
          found.push_back(i);
        }
      }
    }
  }
  std::ranges::sort(found);
  found.erase(std::ranges::unique(found).begin(), found.end());
  return found;
}

Standing at_bound(double value, double lower, double upper) {
  const double near = 1e-6 * (upper - lower);
  return value <= lower + near   ? Standing::kAtLowerBound
         : value >= upper - near ? Standing::kAtUpperBound
                                 : Standing::kDetermined;
}

}  // namespace

ParameterUncertainty parameter_uncertainty(const FitData& data, const FitFamily& family,
                                           const FitPoint& point, std::span<const double> slope) {
  const Gradients gradients(data, family, point, slope);
  const std::size_t shapes = gradients.shapes();
  const std::size_t terms = gradients.terms();
  const std::size_t count = shapes + data.channels * terms;
  ParameterUncertainty out{std::vector<double>(count, 0.0), std::vector<Standing>(count), {}};
  const std::vector<ShapeParameter> parameters = shape_parameters(family);
  for (std::size_t p = 0; p < shapes; ++p) {
    const auto searched = [&](double v) { return parameters[p].logarithmic ? std::log(v) : v; };
    out.standing[p] =
        at_bound(searched(point.shape[p]), searched(parameters[p].lower), searched(parameters[p].upper));
  }
  for (std::size_t j = 0; j < point.coefficient.size(); ++j) {
    out.standing[shapes + j] = at_bound(point.coefficient[j], 0, 1);
  }

  const Arrow whole = normal_equations(data, gradients);
  // Parameters without information are found one after another and held; then the rest is sound.
  Arrow arrow;
  std::vector<MatrixXd> inverse(data.channels);
  MatrixXd shape_inverse;
  const auto held = [&](std::size_t k) { return out.standing[k] != Standing::kDetermined; };
  for (bool again = true; again;) {
    again = false;
    arrow = whole;
    for (std::size_t p = 0; p < shapes; ++p) {
      if (held(p)) {
        hold(arrow.shape, static_cast<Eigen::Index>(p));
        for (MatrixXd& border : arrow.border) {
          border.row(static_cast<Eigen::Index>(p)).setZero();
        }
      }
    }
    MatrixXd schur = arrow.shape;
    for (std::size_t c = 0; c < data.channels; ++c) {
      for (std::size_t j = 0; j < terms; ++j) {
        if (held(shapes + c * terms + j)) {
          hold(arrow.channel[c], static_cast<Eigen::Index>(j));
          arrow.border[c].col(static_cast<Eigen::Index>(j)).setZero();
        }
      }
      for (const Eigen::Index j : undetermined(arrow.channel[c], arrow.channel[c].diagonal())) {
        out.standing[shapes + c * terms + static_cast<std::size_t>(j)] = Standing::kUndetermined;
        again = true;
      }
      if (again) {
        break;
      }
      inverse[c] = arrow.channel[c].inverse();
      schur.noalias() -= arrow.border[c] * inverse[c] * arrow.border[c].transpose();
    }
    if (again) {
      continue;
    }
    for (const Eigen::Index p : undetermined(schur, arrow.shape.diagonal())) {
      out.standing[static_cast<std::size_t>(p)] = Standing::kUndetermined;
      again = true;
    }
    if (!again && shapes > 0) {
      shape_inverse = schur.inverse();
    }
  }

  // Each sample's pull on every parameter; their outer products sum to the covariance.
  const bool full = count <= kMostForCovariance;
  MatrixXd covariance =
      full ? MatrixXd::Zero(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(count)) : MatrixXd();
  VectorXd pull(static_cast<Eigen::Index>(count));
  VectorXd variance = VectorXd::Zero(static_cast<Eigen::Index>(count));
  const auto s_count = static_cast<Eigen::Index>(shapes);
  const auto t_count = static_cast<Eigen::Index>(terms);
  VectorXd s(s_count);
  VectorXd t(t_count);
  VectorXd shape_pull(s_count);
  MatrixXd channel_pull(t_count, static_cast<Eigen::Index>(data.channels));
  for (std::size_t k = 0; k < data.size(); ++k) {
    shape_pull.setZero();
    for (std::size_t c = 0; c < data.channels; ++c) {
      const double r = gradients.row(k, c, s, t);
      for (std::size_t p = 0; p < shapes; ++p) {
        s[static_cast<Eigen::Index>(p)] *= held(p) ? 0 : r;
      }
      for (std::size_t j = 0; j < terms; ++j) {
        t[static_cast<Eigen::Index>(j)] *= held(shapes + c * terms + j) ? 0 : r;
      }
      channel_pull.col(static_cast<Eigen::Index>(c)) = t;
      shape_pull += s;
      if (shapes > 0) {
        shape_pull.noalias() -= arrow.border[c] * (inverse[c] * t);
      }
    }
    if (shapes > 0) {
      pull.head(s_count).noalias() = shape_inverse * shape_pull;
    }
    for (std::size_t c = 0; c < data.channels; ++c) {
      const auto column = static_cast<Eigen::Index>(c);
      VectorXd own = channel_pull.col(column);
      if (shapes > 0) {
        own.noalias() -= arrow.border[c].transpose() * pull.head(s_count);
      }
      pull.segment(s_count + column * t_count, t_count).noalias() = inverse[c] * own;
    }
    variance += pull.cwiseAbs2();
    if (full) {
      covariance.noalias() += pull * pull.transpose();
    }
  }
  const double residuals = static_cast<double>(data.size() * data.channels);
  const double freedom = std::max(residuals - static_cast<double>(count), 1.0);
  variance *= residuals / freedom;
  for (std::size_t k = 0; k < count; ++k) {
    out.sigma[k] = out.standing[k] == Standing::kUndetermined
                       ? std::numeric_limits<double>::infinity()
                       : std::sqrt(variance[static_cast<Eigen::Index>(k)]);
  }
  if (full) {
    covariance *= residuals / freedom;
    out.covariance.assign(covariance.data(), covariance.data() + covariance.size());
  }
  return out;
}

}  // namespace scatter::reflectance
