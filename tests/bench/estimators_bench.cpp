// Chains of estimators: one incidence and many outgoing directions, as the writers ask.
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "host_sdk/reflectance/estimators/chain.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "tests/bench/bench.h"

namespace scatter::bench {
namespace {

using namespace reflectance;

constexpr double kDirectionsPerMillion = 1e-6;

/// What the instrument gives: four incidences, 1 deg, theta_o up to 75 deg.
std::shared_ptr<const GridBrdf> measured() {
  GridLayout layout;
  layout.theta_count = 76;
  const auto model = make_model("ggx:alpha=0.2/0.25/0.3,f0=0.04,albedo=0.3").value();
  return std::make_shared<const GridBrdf>(sample_on_grid(*model, layout).value());
}

/// The same as a list of samples.
std::shared_ptr<const ScatteredBrdf> scattered() {
  const auto grid = measured();
  ScatteredSamples samples;
  samples.channels = grid->channels();
  for (std::size_t p = 0; p < grid->content().parts.size(); ++p) {
    for (std::size_t n = 0; n < grid->content().parts[p].origin.size(); ++n) {
      samples.omega_i.push_back(grid->omega_i(p));
      samples.omega_o.push_back(grid->omega_o(n));
      for (std::size_t c = 0; c < samples.channels; ++c) {
        samples.f_per_sr.push_back(grid->content().parts[p].f_per_sr[c][n]);
      }
    }
  }
  return ScatteredBrdf::make(std::move(samples)).value();
}

/// Half degree steps over the hemisphere, row by row.
std::vector<Direction> hemisphere(double step_deg) {
  std::vector<Direction> out;
  for (double theta = step_deg / 2; theta < 90; theta += step_deg) {
    for (double phi = 0; phi < 360; phi += step_deg) {
      out.push_back(from_spherical(radians(theta), radians(phi)));
    }
  }
  return out;
}

/// A batch at an incidence between two measured ones, against asking one by one.
Figure against_single_calls(const std::string& name, const std::shared_ptr<const Brdf>& data,
                            const char* text, double step_deg) {
  const Chain chain = make_chain(data, text).value();
  const std::vector<Direction> omega_o = hemisphere(step_deg);
  const Direction omega_i = from_spherical(radians(33), 0.4);
  std::vector<double> f(omega_o.size() * chain.brdf->channels());
  std::vector<Origin> origin(omega_o.size());
  return run_contest(name, {.unit = "million directions/s",
                            .work = static_cast<double>(omega_o.size()) * kDirectionsPerMillion,
                            .ours =
                                [&] {
                                  chain.brdf->eval_batch(omega_i, omega_o, f, origin);
                                  keep(f[0]);
                                },
                            .peer = "one by one",
                            .theirs =
                                [&] {
                                  const std::size_t n = chain.brdf->channels();
                                  for (std::size_t k = 0; k < omega_o.size(); ++k) {
                                    origin[k] =
                                        chain.brdf->eval(omega_i, omega_o[k], std::span(f).subspan(k * n, n));
                                  }
                                  keep(f[0]);
                                },
                            .round_seconds = 0.05});
}

const Benchmark kGrid{"estimators.chain.grid", [] {
                        const auto data = measured();
                        return std::vector<Figure>{
                            against_single_calls("estimators.chain.grid.default", data, "default", 0.5),
                            against_single_calls("estimators.chain.grid.distorted", data,
                                                 "bezier,distorted,clamp:over=theta_i", 0.5)};
                      }};

const Benchmark kScattered{
    "estimators.chain.scattered", [] {
      const auto data = scattered();
      return std::vector<Figure>{
          against_single_calls("estimators.chain.scattered.default", data, "default", 1),
          against_single_calls("estimators.chain.scattered.neighbors", data,
                               "neighbors,bezier,specular,clamp:over=theta_i", 1)};
    }};

}  // namespace
}  // namespace scatter::bench
