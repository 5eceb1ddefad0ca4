#include "host_sdk/reflectance/estimators/guided_predictor.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/scratch.h"

namespace scatter::reflectance {
namespace {

/// Lowest elevation at which models are asked: they have no value on the horizon.
constexpr double kGrazing = 1e-3;
/// A model below this is taken as this [1/sr]: exp(-tan^2) lobes vanish where surfaces do not.
constexpr double kLeastModel = 1e-12;
/// Values that no ratio was taken of may be this small [1/sr]: only their logarithm must exist.
constexpr float kLeastValue = 1e-12F;
/// How far a cubic may leave the range of its two nearest values, in parts of that range.
constexpr float kOvershoot = 0.25F;

/// Where a direction at one incidence is looked up at another; may be below the horizon.
class Counterpart {
 public:
  Counterpart(Alignment alignment, double theta_from, double theta_to) noexcept
      : alignment_(alignment),
        cos_(std::cos(theta_to - theta_from)),
        sin_(std::sin(theta_to - theta_from)),
        from_{std::sin(theta_from), 0, std::cos(theta_from)},
        to_{std::sin(theta_to), 0, std::cos(theta_to)},
        turned_(theta_to < 0) {}

  [[nodiscard]] Direction operator()(const Direction& o) const noexcept {
    Direction w = o;
    if (alignment_ == Alignment::kSpecular) {
      w = {o.x * cos_ - o.z * sin_, o.y, o.x * sin_ + o.z * cos_};
    } else if (alignment_ == Alignment::kHalf) {
      const Direction h{from_.x + o.x, o.y, from_.z + o.z};
      const double scale = 2 * dot(to_, h) / dot(h, h);
      w = {scale * h.x - to_.x, scale * h.y, scale * h.z - to_.z};
    }
    if (turned_) {
      w.x = -w.x;
      w.y = -w.y;
    }
    return w;
  }

 private:
  Alignment alignment_;
  double cos_;
  double sin_;
  Direction from_;
  Direction to_;
  bool turned_;
};

float blend(const std::vector<float>& table, const GuidedGrid::Cell& cell, std::size_t channels,
            std::size_t c) noexcept {
  const float low = table[cell.low * channels + c];
  const float low_next = table[cell.low_next * channels + c];
  const float high = table[cell.high * channels + c];
  const float high_next = table[cell.high_next * channels + c];
  const float a = low + cell.column_share * (low_next - low);
  const float b = high + cell.column_share * (high_next - high);
  return a + cell.row_share * (b - a);
}

}  // namespace

void log_model(const Guide& guide, double theta_i, std::span<const Direction> local_o,
               std::span<float> out) noexcept {
  if (!guide.model) {
    std::ranges::fill(out, 0.0F);
    return;
  }
  Scratch scratch;
  const std::span<Direction> asked = scratch.take<Direction>(local_o.size());
  const std::span<double> f = scratch.take<double>(out.size());
  for (std::size_t k = 0; k < local_o.size(); ++k) {
    asked[k] = local_o[k].z >= kGrazing ? local_o[k] : normalized({local_o[k].x, local_o[k].y, kGrazing});
  }
  guide.model->eval_batch(from_spherical(theta_i, 0), asked, f, {});
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k] = static_cast<float>(std::log(std::max(f[k], kLeastModel)));
  }
}

GuidedPredictor::GuidedPredictor(const GuidedData& data, std::vector<std::size_t> use,
                                 std::vector<Guide> guides, std::vector<GuidedCandidate> candidates)
    : data_(&data), guides_(std::move(guides)), candidates_(std::move(candidates)) {
  if (data.isotropic) {
    for (std::size_t u = use.size(); u-- > 0;) {
      if (data.theta_i[use[u]] > kSameAngle) {
        axis_.push_back({-data.theta_i[use[u]], use[u]});
      }
    }
  }
  for (const std::size_t u : use) {
    axis_.push_back({data.theta_i[u], u});
  }
  std::vector<Direction> nodes(data.grid.size());
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    nodes[node] = data.grid.direction(node);
  }
  const std::size_t n = data.channels;
  std::vector<float> model(nodes.size() * n);
  log_ratio_.resize(guides_.size());
  for (std::size_t g = 0; g < guides_.size(); ++g) {
    log_ratio_[g].resize(data.theta_i.size());
    if (std::ranges::none_of(candidates_, [&](const GuidedCandidate& candidate) {
          return candidate.guide == g && candidate.joint != Joint::kValue;
        })) {
      continue;
    }
    for (const std::size_t u : use) {
      log_model(guides_[g], data.theta_i[u], nodes, model);
      std::vector<float>& ratio = log_ratio_[g][u];
      ratio.resize(model.size());
      for (std::size_t k = 0; k < model.size(); ++k) {
        const double f = std::max(static_cast<double>(data.f_per_sr[u][k]), data.floor_per_sr[k % n]);
        ratio[k] = static_cast<float>(std::log(f)) - model[k];
      }
      // A value that was not measured stands for the ratio of the nearest one that was, not for its f.
      for (std::size_t i = 0; i < data.grid.columns; ++i) {
        std::size_t last = data.grid.rows;
        for (std::size_t j = 0; j < data.grid.rows; ++j) {
          const std::size_t node = j * data.grid.columns + i;
          if (data.measured[u][node] != 0) {
            last = j;
          } else if (last < data.grid.rows) {
            for (std::size_t c = 0; c < n; ++c) {
              ratio[node * n + c] = ratio[(last * data.grid.columns + i) * n + c];
            }
          }
        }
      }
    }
  }
}

std::size_t GuidedPredictor::first_above(double theta_i) const noexcept {
  std::size_t above = 1;
  while (above + 1 < axis_.size() && axis_[above].theta < theta_i) {
    ++above;
  }
  return above;
}

GuidedPredictor::Neighbors GuidedPredictor::neighbors(double theta_i) const noexcept {
  const std::size_t above = first_above(theta_i);
  const Knot& low = axis_[above - 1];
  const Knot& high = axis_[above];
  return {low.incidence, high.incidence,
          std::clamp((theta_i - low.theta) / (high.theta - low.theta), 0.0, 1.0)};
}

GuidedPredictor::Taps GuidedPredictor::taps_at(double theta_i) const noexcept {
  const std::size_t above = first_above(theta_i);
  const double theta = std::clamp(theta_i, axis_.front().theta, axis_.back().theta);
  Taps taps;
  const double share = (theta - axis_[above - 1].theta) / (axis_[above].theta - axis_[above - 1].theta);
  // The two neighbours first: they bound the cubic.
  taps.tap[taps.count++] = {axis_[above - 1], static_cast<float>(1 - share), 0};
  taps.tap[taps.count++] = {axis_[above], static_cast<float>(share), 0};
  if (above >= 2) {
    taps.tap[taps.count++] = {axis_[above - 2], 0, 0};
  }
  if (above + 1 < axis_.size()) {
    taps.tap[taps.count++] = {axis_[above + 1], 0, 0};
  }
  for (std::size_t a = 0; a < taps.count; ++a) {
    double weight = 1;
    for (std::size_t b = 0; b < taps.count; ++b) {
      if (a != b) {
        weight *= (theta - taps.tap[b].knot.theta) / (taps.tap[a].knot.theta - taps.tap[b].knot.theta);
      }
    }
    taps.tap[a].cubic = static_cast<float>(weight);
  }
  return taps;
}

void GuidedPredictor::predict(double theta_i, std::span<const Direction> local_o,
                              std::span<float> log_f) const noexcept {
  const std::size_t n = data_->channels;
  const std::size_t count = local_o.size();
  const Taps taps = taps_at(theta_i);
  Scratch scratch;
  std::array<std::array<std::span<GuidedGrid::Cell>, 4>, kAlignments> cells;
  for (const GuidedCandidate& candidate : candidates_) {
    const auto a = static_cast<std::size_t>(candidate.alignment);
    for (std::size_t t = 0; t < taps.count; ++t) {
      if ((t < 2 || candidate.joint == Joint::kLogCubic) && cells[a][t].empty()) {
        cells[a][t] = scratch.take<GuidedGrid::Cell>(count);
        const Counterpart counterpart(candidate.alignment, theta_i, taps.tap[t].knot.theta);
        for (std::size_t k = 0; k < count; ++k) {
          cells[a][t][k] = data_->grid.locate(counterpart(local_o[k]));
        }
      }
    }
  }
  const std::span<float> model = scratch.take<float>(count * n);
  std::size_t model_of = guides_.size();
  for (std::size_t q = 0; q < candidates_.size(); ++q) {
    const GuidedCandidate& candidate = candidates_[q];
    const auto& at = cells[static_cast<std::size_t>(candidate.alignment)];
    const std::span<float> out = log_f.subspan(q * count * n, count * n);
    if (candidate.joint == Joint::kValue) {
      for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t c = 0; c < n; ++c) {
          float f = 0;
          for (std::size_t t = 0; t < 2; ++t) {
            f += taps.tap[t].linear * blend(data_->f_per_sr[taps.tap[t].knot.incidence], at[t][k], n, c);
          }
          out[k * n + c] = std::log(std::max(f, kLeastValue));
        }
      }
      continue;
    }
    if (model_of != candidate.guide) {
      model_of = candidate.guide;
      log_model(guides_[model_of], theta_i, local_o, model);
    }
    const bool cubic = candidate.joint == Joint::kLogCubic && taps.count > 2;
    std::array<const std::vector<float>*, 4> table{};
    for (std::size_t t = 0; t < taps.count; ++t) {
      table[t] = &log_ratio_[candidate.guide][taps.tap[t].knot.incidence];
    }
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t c = 0; c < n; ++c) {
        const float low = blend(*table[0], at[0][k], n, c);
        const float high = blend(*table[1], at[1][k], n, c);
        float ratio = taps.tap[0].linear * low + taps.tap[1].linear * high;
        if (cubic) {
          float sum = taps.tap[0].cubic * low + taps.tap[1].cubic * high;
          for (std::size_t t = 2; t < taps.count; ++t) {
            sum += taps.tap[t].cubic * blend(*table[t], at[t][k], n, c);
          }
          const float least = std::min(low, high);
          const float most = std::max(low, high);
          const float margin = kOvershoot * (most - least);
          ratio = std::clamp(sum, least - margin, most + margin);
        }
        out[k * n + c] = ratio + model[k * n + c];
      }
    }
  }
}

}  // namespace scatter::reflectance
