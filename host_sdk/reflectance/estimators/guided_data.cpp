#include "host_sdk/reflectance/estimators/guided_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace scatter::reflectance {
namespace {

/// Closer to a node than this share of a step is that node: rounding must not pull in a neighbour.
constexpr double kSameNode = 1e-6;
/// The floor of logarithms: this part of the value that 1 % of the positive ones lie below.
constexpr double kFloorShare = 0.1;
constexpr double kFloorQuantile = 0.01;

/// Whole steps and the rest.
std::pair<std::size_t, double> split(double position) noexcept {
  const double nearest = std::round(position);
  if (std::abs(position - nearest) < kSameNode) {
    return {static_cast<std::size_t>(nearest), 0.0};
  }
  const double below = std::floor(position);
  return {static_cast<std::size_t>(below), position - below};
}

/// Values of nodes that were not measured: those of the nearest one along theta, else along phi.
bool fill(const GuidedGrid& grid, std::size_t channels, const std::vector<std::uint8_t>& measured,
          std::vector<float>& f) {
  std::vector<std::uint8_t> known = measured;
  const auto copy = [&](std::size_t to, std::size_t from) {
    std::copy_n(f.begin() + static_cast<std::ptrdiff_t>(from * channels), channels,
                f.begin() + static_cast<std::ptrdiff_t>(to * channels));
    known[to] = 1;
  };
  bool any = false;
  for (std::size_t i = 0; i < grid.columns; ++i) {
    for (std::size_t j = 0; j < grid.rows; ++j) {
      if (measured[j * grid.columns + i] != 0) {
        any = true;
        continue;
      }
      for (std::size_t step = 1; step < grid.rows; ++step) {
        // Towards the normal first: values there are the surer ones.
        if (j >= step && measured[(j - step) * grid.columns + i] != 0) {
          copy(j * grid.columns + i, (j - step) * grid.columns + i);
          break;
        }
        if (j + step < grid.rows && measured[(j + step) * grid.columns + i] != 0) {
          copy(j * grid.columns + i, (j + step) * grid.columns + i);
          break;
        }
      }
    }
  }
  const std::vector<std::uint8_t> in_column = known;
  for (std::size_t j = 0; any && j < grid.rows; ++j) {
    for (std::size_t i = 0; i < grid.columns; ++i) {
      for (std::size_t step = 1; known[j * grid.columns + i] == 0 && step <= grid.columns / 2; ++step) {
        for (const std::size_t from : {(i + step) % grid.columns, (i + grid.columns - step) % grid.columns}) {
          if (in_column[j * grid.columns + from] != 0) {
            copy(j * grid.columns + i, j * grid.columns + from);
            break;
          }
        }
      }
    }
  }
  return any;
}

}  // namespace

GuidedGrid::Cell GuidedGrid::locate(const Direction& w) const noexcept {
  const double last = static_cast<double>(rows - 1);
  const double position = std::min(theta_of(w) / theta_step, last);
  auto [row, row_share] = split(position);
  auto [column, column_share] = split(phi_of(w) / phi_step);
  column %= columns;
  const std::size_t next = column + 1 == columns ? 0 : column + 1;
  const std::size_t above = std::min(row + 1, rows - 1);
  return {.low = static_cast<std::uint32_t>(row * columns + column),
          .low_next = static_cast<std::uint32_t>(row * columns + next),
          .high = static_cast<std::uint32_t>(above * columns + column),
          .high_next = static_cast<std::uint32_t>(above * columns + next),
          .row_share = static_cast<float>(row_share),
          .column_share = static_cast<float>(column_share)};
}

Direction GuidedGrid::direction(std::size_t node) const noexcept {
  return from_spherical(static_cast<double>(node / columns) * theta_step,
                        static_cast<double>(node % columns) * phi_step);
}

double GuidedGrid::solid_angle_sr(std::size_t node) const noexcept {
  const double theta = static_cast<double>(node / columns) * theta_step;
  const double low = std::max(0.0, theta - theta_step / 2);
  const double high = std::min(kPi / 2, theta + theta_step / 2);
  return phi_step * 2 * std::sin((low + high) / 2) * std::sin((high - low) / 2);
}

Direction GuidedData::omega_i(std::size_t incidence) const noexcept {
  return from_spherical(theta_i[incidence], azimuth);
}

FitSamples GuidedData::samples(std::span<const std::size_t> incidences, std::size_t wanted) const {
  FitSamples all;
  all.channels = channels;
  for (const std::size_t k : incidences) {
    const std::size_t first = all.omega_o.size();
    for (std::size_t node = 0; node < grid.size(); ++node) {
      // The pole is one direction.
      if (measured[k][node] == 0 || (node < grid.columns && node > 0)) {
        continue;
      }
      const Direction o = grid.direction(node);
      if (!(o.z > 0)) {
        continue;
      }
      all.omega_o.push_back(o);
      all.solid_angle_sr.push_back(grid.solid_angle_sr(node) *
                                   (node == 0 ? static_cast<double>(grid.columns) : 1.0));
      for (std::size_t c = 0; c < channels; ++c) {
        all.f_per_sr.push_back(f_per_sr[k][node * channels + c]);
      }
    }
    all.incidences.push_back(
        {.theta_i = theta_i[k], .phi_i = 0, .first = first, .count = all.omega_o.size() - first});
  }
  return thinned(all, wanted);
}

Result<GuidedData> gather_guided(const Brdf& source, const GuidedGrid& grid, std::span<const double> theta_i,
                                 double azimuth, bool isotropic) {
  GuidedData data;
  data.grid = grid;
  data.type = source.type();
  data.channels = source.channels();
  data.theta_i.assign(theta_i.begin(), theta_i.end());
  data.azimuth = azimuth;
  data.isotropic = isotropic;
  const double side = data.type == ScatterType::kBrdf ? 1 : -1;
  const double cos_a = std::cos(azimuth);
  const double sin_a = std::sin(azimuth);
  std::vector<Direction> asked(grid.size());
  for (std::size_t node = 0; node < grid.size(); ++node) {
    const Direction o = grid.direction(node);
    asked[node] = {o.x * cos_a - o.y * sin_a, o.x * sin_a + o.y * cos_a, side * o.z};
  }
  std::vector<double> f(grid.size() * data.channels);
  std::vector<Origin> origin(grid.size());
  std::vector<std::vector<float>> positive(data.channels);
  for (std::size_t k = 0; k < data.theta_i.size(); ++k) {
    source.eval_batch(data.omega_i(k), asked, f, origin);
    std::vector<std::uint8_t> measured(grid.size());
    std::vector<float> values(f.begin(), f.end());
    for (std::size_t node = 0; node < grid.size(); ++node) {
      measured[node] = origin[node] == Origin::kMeasured || origin[node] == Origin::kInterpolated ? 1 : 0;
      for (std::size_t c = 0; measured[node] != 0 && c < data.channels; ++c) {
        if (values[node * data.channels + c] > 0) {
          positive[c].push_back(values[node * data.channels + c]);
        }
      }
    }
    if (!fill(grid, data.channels, measured, values)) {
      return fail(ErrorCode::kFailedPrecondition,
                  fmt::format("guided: no measured value at incidence {:.6g} deg", degrees(data.theta_i[k])),
                  "leave that incidence out, or interpolate without a guide");
    }
    data.f_per_sr.push_back(std::move(values));
    data.measured.push_back(std::move(measured));
  }
  for (std::size_t c = 0; c < data.channels; ++c) {
    if (positive[c].empty()) {
      return fail(ErrorCode::kFailedPrecondition, fmt::format("guided: channel {} has no positive value", c),
                  "leave that channel out, or interpolate without a guide");
    }
    const auto at = positive[c].begin() +
                    static_cast<std::ptrdiff_t>(kFloorQuantile * static_cast<double>(positive[c].size()));
    std::ranges::nth_element(positive[c], at);
    data.floor_per_sr.push_back(kFloorShare * static_cast<double>(*at));
  }
  return data;
}

}  // namespace scatter::reflectance
