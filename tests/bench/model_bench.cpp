// Analytic models: many directions in one call against one call each.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/bench/bench.h"

namespace scatter::bench {
namespace {

using namespace reflectance;

constexpr std::size_t kDirections = 4096;

struct Entry {
  const char* name;
  const char* spec;
};
constexpr std::array kModels{
    Entry{"lambertian", "lambertian:0.5"},
    Entry{"ggx", "ggx:alpha=0.2,f0=0.04,albedo=0.3"},
    Entry{"ggx_colours", "ggx:alpha=0.2/0.3/0.4,f0=0.04,albedo=0.3"},
    Entry{"ggx_aniso", "ggx:alpha=0.2,alpha_y=0.4,f0=0.04"},
    Entry{"dielectric", "ggx-dielectric:alpha=0.2,ior=1.5"},
    Entry{"conductor", "conductor:metal=copper,alpha=0.2"},
    Entry{"beckmann", "beckmann:alpha=0.2,albedo=0.3"},
    Entry{"cook_torrance", "cook-torrance:m=0.2,albedo=0.3"},
    Entry{"ward", "ward:alpha=0.2,ks=0.3,albedo=0.3"},
    Entry{"lafortune", "lafortune:n=30,ks=0.3,albedo=0.3"},
    Entry{"oren_nayar", "oren-nayar:albedo=0.5,sigma=0.4"},
    Entry{"disney", "disney:base=0.8/0.5/0.3,roughness=0.4,clearcoat=0.5,sheen=0.3"},
    Entry{"transmission", "ggx-transmission:alpha=0.2,ior=1.5"},
};

/// Every direction of one side, without a preferred one.
std::vector<Direction> spiral(double side) {
  std::vector<Direction> out;
  for (std::size_t k = 0; k < kDirections; ++k) {
    const double z = (static_cast<double>(k) + 0.5) / static_cast<double>(kDirections);
    Direction w = from_spherical(std::acos(z), 2.399963229728653 * static_cast<double>(k));
    w.z *= side;
    out.push_back(w);
  }
  return out;
}

std::vector<Figure> eval_models() {
  std::vector<Figure> figures;
  const Direction omega_i = from_spherical(radians(40), 0.3);
  for (const Entry& entry : kModels) {
    const auto model = make_sampled_model(entry.spec);
    if (!model) {
      continue;
    }
    const SampledBrdf& brdf = **model;
    const std::vector<Direction> omega_o = spiral(brdf.type() == ScatterType::kBtdf ? -1 : 1);
    std::vector<double> f(3 * kDirections);
    figures.push_back(run_contest(fmt::format("eval.model.{}", entry.name),
                                  {.unit = "M directions/s",
                                   .work = kDirections * 1e-6,
                                   .ours =
                                       [&] {
                                         brdf.eval_batch(omega_i, omega_o, f, {});
                                         keep(f.data());
                                       },
                                   .peer = "one call each",
                                   .theirs =
                                       [&] {
                                         for (std::size_t k = 0; k < kDirections; ++k) {
                                           (void)brdf.eval(omega_i, omega_o[k],
                                                           std::span(f).subspan(3 * k, 3));
                                         }
                                         keep(f.data());
                                       }}));
  }
  return figures;
}

std::vector<Figure> sample_models() {
  std::vector<Figure> figures;
  const Direction omega_i = from_spherical(radians(40), 0.3);
  std::vector<SampleInput> u;
  for (std::size_t k = 0; k < kDirections; ++k) {
    const auto x = static_cast<double>(k) + 0.5;
    u.push_back({std::fmod(x * 0.7548776662466927, 1.0), std::fmod(x * 0.5698402909980532, 1.0),
                 std::fmod(x * 0.6180339887498949, 1.0)});
  }
  std::vector<DrawnDirection> drawn(kDirections);
  std::vector<double> throughput(3 * kDirections);
  for (const Entry& entry : kModels) {
    const auto model = make_sampled_model(entry.spec);
    if (!model) {
      continue;
    }
    const SampledBrdf& brdf = **model;
    figures.push_back(run_contest(fmt::format("eval.model.sample.{}", entry.name),
                                  {.unit = "M draws/s",
                                   .work = kDirections * 1e-6,
                                   .ours =
                                       [&] {
                                         brdf.sample_batch(omega_i, u, drawn, throughput);
                                         keep(throughput.data());
                                       },
                                   .peer = "one call each",
                                   .theirs =
                                       [&] {
                                         for (std::size_t k = 0; k < kDirections; ++k) {
                                           drawn[k] = brdf.sample(omega_i, u[k],
                                                                  std::span(throughput).subspan(3 * k, 3));
                                         }
                                         keep(throughput.data());
                                       }}));
  }
  return figures;
}

const Benchmark kEvalModels{"eval.model", eval_models};
const Benchmark kSampleModels{"eval.model.sample", sample_models};

}  // namespace
}  // namespace scatter::bench
