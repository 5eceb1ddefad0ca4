#include "host_sdk/measurement/uncertainty.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace scatter::measurement {
namespace {

/// Share of the well at which a rate was sampled: the longest exposure that still fits.
double level(double rate, std::span<const float> exposures_s_v, double usable_e,
             double full_well_e) noexcept {
  double best = 0;
  for (const float t : exposures_s_v) {
    const double e = rate * static_cast<double>(t);
    if (e < usable_e || best == 0) {
      best = e;
    }
  }
  return best / full_well_e;
}

/// Central differences of one lane at a node [per rad] and the laplacian [per rad^2]. The step in
/// azimuth spans about one polar step of arc, so that noise does not grow towards the pole.
struct Derivatives {
  double theta = 0;
  double phi_arc = 0;  ///< (1 / sin theta) d/dphi
  double phi = 0;      ///< d/dphi
  double laplacian = 0;
};

class NodeField {
 public:
  NodeField(const NodeValues& nodes, const GridShape& grid) noexcept : nodes_(nodes), grid_(grid) {}

  [[nodiscard]] Derivatives at(std::size_t j, std::size_t i, std::size_t lane) const noexcept {
    Derivatives d;
    const double centre = value(j, i, lane, 0);
    const std::size_t up = std::min(j + 1, grid_.theta_count - 1);
    const double above = value(up, i, lane, centre);
    // Across the pole the neighbour lies on the opposite azimuth.
    const double below =
        j > 0 ? value(j - 1, i, lane, centre) : value(1, i + grid_.phi_count / 2, lane, centre);
    const double h = grid_.theta_step;
    d.theta = (above - below) / (2 * h);
    if (j == 0) {
      const double left = value(1, i + grid_.phi_count / 4, lane, centre);
      const double right = value(1, i + 3 * grid_.phi_count / 4, lane, centre);
      d.phi_arc = (left - right) / (2 * h);
      d.laplacian = (above + below + left + right - 4 * centre) / (h * h);
      return d;
    }
    const double sine = std::sin(static_cast<double>(j) * h);
    const auto stride =
        std::clamp<std::size_t>(static_cast<std::size_t>(std::lround(1.0 / sine)), 1, grid_.phi_count / 8);
    const double arc = static_cast<double>(stride) * grid_.phi_step;
    const double left = value(j, i + stride, lane, centre);
    const double right = value(j, i + grid_.phi_count - stride, lane, centre);
    d.phi = (left - right) / (2 * arc);
    d.phi_arc = d.phi / sine;
    const double cot = std::cos(static_cast<double>(j) * h) / sine;
    d.laplacian = (above + below - 2 * centre) / (h * h) + cot * d.theta +
                  (left + right - 2 * centre) / (arc * arc * sine * sine);
    return d;
  }

 private:
  [[nodiscard]] double value(std::size_t j, std::size_t i, std::size_t lane,
                             double otherwise) const noexcept {
    const std::size_t at = (j * grid_.phi_count + i % grid_.phi_count) * nodes_.lanes + lane;
    return std::isfinite(nodes_.variance[at]) ? static_cast<double>(nodes_.value[at]) : otherwise;
  }
  const NodeValues& nodes_;
  const GridShape& grid_;
};

}  // namespace

std::vector<float> systematic_uncertainty(const NodeValues& nodes, const GridShape& grid,
                                          const SampleFrame& frame, const RecordedScan& scan,
                                          const LaneSelection& selection) {
  const protocol::Descriptor& d = scan.descriptor;
  const SensorResponse response(d.sensor);
  const NodeField field(nodes, grid);
  const auto geometry = static_cast<double>(d.uncertainty.geometry_rad);
  const auto linearity = static_cast<double>(d.uncertainty.linearity);
  const auto theta_max = static_cast<double>(d.optics.theta_max_rad);
  std::vector<double> blur;
  for (const Lane& lane : selection.lanes) {
    const auto radius = static_cast<double>(d.illuminations[lane.illumination].angular_radius_rad);
    blur.push_back(radius * radius / 4);
  }

  std::vector<float> out(nodes.value.size(), 0.0F);
  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, grid.theta_count, 1), [&](const auto& range) {
        for (std::size_t j = range.begin(); j != range.end(); ++j) {
          for (std::size_t i = 0; i < grid.phi_count; ++i) {
            const std::size_t node = j * grid.phi_count + i;
            if (nodes.kind[node] == NodeKind::kEmpty) {
              continue;
            }
            const SensorPoint at = project(d.optics, frame.to_instrument(grid.direction(node)));
            const auto px =
                std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(at.x), 0, d.sensor.width_px - 1);
            const auto py =
                std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(at.y), 0, d.sensor.height_px - 1);
            const auto pixel = static_cast<std::size_t>(py * d.sensor.width_px + px);
            for (std::size_t l = 0; l < nodes.lanes; ++l) {
              const std::size_t k = node * nodes.lanes + l;
              if (!std::isfinite(nodes.variance[k])) {
                continue;
              }
              const Lane& lane = selection.lanes[l];
              const auto f = static_cast<double>(nodes.value[k]);
              const double span = lane.f_reference_per_sr - lane.f_black_per_sr;
              const double x = (f - lane.f_black_per_sr) / span;
              const double reference = x * lane.f_reference_per_sr * lane.u_reference;
              const double black = (1 - x) * lane.f_black_per_sr * lane.u_black;

              const auto w = static_cast<double>(lane.references->reference.rate[pixel]);
              const auto b = static_cast<double>(lane.references->black.rate[pixel]);
              const double s = b + (w - b) * x;
              const double sample_level =
                  level(s, lane.exposures_s_v, static_cast<double>(response.usable_e()),
                        static_cast<double>(response.full_well_e()));
              const double reference_level =
                  level(w, lane.references->reference_exposures, static_cast<double>(response.usable_e()),
                        static_cast<double>(response.full_well_e()));
              const double linear = f * linearity * std::abs(sample_level - reference_level);

              const Derivatives g = field.at(j, i, l);
              const double gradient2 = g.theta * g.theta + g.phi_arc * g.phi_arc;
              const double edge = static_cast<double>(j) * grid.theta_step / theta_max;
              // Camera centre and source head move the picture by an angle each, in both directions.
              const double pointing2 =
                  geometry * geometry * (2 * gradient2 + edge * edge * g.theta * g.theta + g.phi * g.phi);
              const double blurred = blur[l] / 2 * g.laplacian / 3;
              const auto fill = static_cast<double>(nodes.fill_spread[k]);
              out[k] = static_cast<float>(std::sqrt(reference * reference + black * black + linear * linear +
                                                    pointing2 + blurred * blurred + fill * fill));
            }
          }
        }
      });
  return out;
}

}  // namespace scatter::measurement
