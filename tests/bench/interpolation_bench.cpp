// How far interpolation between incidences is from the truth, and what it costs: guided against the
// simple ways. The whole table goes to stderr, the mean errors become figures.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/reflectance/estimators/guided_brdf.h"
#include "host_sdk/reflectance/estimators/incidence_interpolator.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/bench/bench.h"

namespace scatter::bench {
namespace {

using reflectance::Brdf;
using reflectance::Direction;
using reflectance::from_spherical;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::GuidedBrdf;
using reflectance::IncidenceInterpolator;
using reflectance::IncidenceMode;
using reflectance::make_model;
using reflectance::Origin;
using reflectance::radians;

struct Accuracy {
  double mean = 0;
  double p99 = 0;
  double peak_ratio = 0;
};

std::vector<Direction> nodes_to_75() {
  std::vector<Direction> nodes;
  for (int row = 0; row <= 75; ++row) {
    for (int column = 0; column < 360; ++column) {
      nodes.push_back(from_spherical(radians(row), radians(column)));
    }
  }
  return nodes;
}

/// Channel 0, by solid angle, over the nodes where the truth is known and not 0.
Accuracy accuracy(const Brdf& estimate, const Brdf& truth, double theta_i) {
  const std::vector<Direction> nodes = nodes_to_75();
  const Direction omega_i = from_spherical(theta_i, 0);
  std::vector<double> f(nodes.size() * estimate.channels());
  std::vector<double> expected(nodes.size() * truth.channels());
  std::vector<Origin> origin(nodes.size());
  estimate.eval_batch(omega_i, nodes, f, {});
  truth.eval_batch(omega_i, nodes, expected, origin);
  std::vector<std::pair<double, double>> errors;
  Accuracy result;
  double total = 0;
  double peak = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const double row = static_cast<double>(k / 360);
    const double weight = std::cos(radians(std::max(0.0, row - 0.5))) - std::cos(radians(row + 0.5));
    const double value = expected[k * truth.channels()];
    const double found = f[k * estimate.channels()];
    if (!(value > 0) || origin[k] == Origin::kInvalid || origin[k] == Origin::kExtrapolated) {
      continue;
    }
    if (value > peak) {
      peak = value;
      result.peak_ratio = found / value;
    }
    errors.emplace_back(std::abs(found / value - 1), weight);
    result.mean += errors.back().first * weight;
    total += weight;
  }
  result.mean /= total;
  std::ranges::sort(errors);
  double reached = 0;
  for (const auto& [error, weight] : errors) {
    reached += weight;
    if (reached >= 0.99 * total) {
      result.p99 = error;
      break;
    }
  }
  return result;
}

/// One channel of a material at 0, 20, 40 and 60 deg, 1 deg grid to 75 deg, with relative noise.
std::shared_ptr<const Brdf> measured(const Brdf& truth, double noise) {
  std::mt19937 random(2024);
  std::normal_distribution<double> normal(0, 1);
  const std::vector<Direction> nodes = nodes_to_75();
  GridBrdf::Content content;
  content.channels = 1;
  std::vector<double> f(nodes.size() * truth.channels());
  for (const double theta_i : {0.0, 20.0, 40.0, 60.0}) {
    GridPart part;
    part.theta_i = radians(theta_i);
    part.origin.assign(nodes.size(), Origin::kMeasured);
    part.f_per_sr.assign(1, std::vector<float>(nodes.size()));
    truth.eval_batch(from_spherical(part.theta_i, 0), nodes, f, {});
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const double value = f[n * truth.channels()] * (1 + noise * normal(random));
      part.f_per_sr[0][n] = n > 0 && n < 360 ? part.f_per_sr[0][0] : static_cast<float>(value);
    }
    content.parts.push_back(std::move(part));
  }
  return std::make_shared<const GridBrdf>(GridBrdf::make(std::move(content)).value());
}

/// All ways on one material; a figure per incidence: ours against the best simple way.
void contest(const std::string& name, const Brdf& truth, const std::shared_ptr<const Brdf>& data,
             const std::vector<double>& theta_i_deg, std::vector<Figure>& figures) {
  const auto link = GuidedBrdf::make(data);
  if (!link) {
    fmt::print(stderr, "interpolation: {}: {}\n", name, link.error().what);
    return;
  }
  fmt::print(stderr, "{}: {}\n", name, (*link)->metadata().at("interpolation"));
  fmt::print(stderr, "  cross-validation error {}\n", (*link)->metadata().at("interpolation_error"));
  for (const double angle : theta_i_deg) {
    std::string line = fmt::format("  {:2.0f} deg", angle);
    double best = 0;
    std::string_view best_way;
    const auto show = [&](std::string_view way, const Brdf& brdf) {
      const Accuracy a = accuracy(brdf, truth, radians(angle));
      line += fmt::format(" | {} {:.4f} {:.3f} {:.2f}", way, a.mean, a.p99, a.peak_ratio);
      return a.mean;
    };
    for (const IncidenceMode mode : {IncidenceMode::kPlain, IncidenceMode::kSpecular,
                                     IncidenceMode::kSpecularSpline, IncidenceMode::kDistorted}) {
      const double mean = show(reflectance::name(mode), **IncidenceInterpolator::make(data, mode));
      if (best_way.empty() || mean < best) {
        best = mean;
        best_way = reflectance::name(mode);
      }
    }
    const double ours = show("guided", **link);
    fmt::print(stderr, "{}\n", line);
    figures.push_back(make_figure(fmt::format("interpolation.accuracy.{}.{:.0f}deg", name, angle), ours,
                                  "mean relative error", std::string(best_way), best, Better::kLower));
  }
}

/// A real file, or nothing, said aloud.
std::shared_ptr<const Brdf> real_brdf(const std::string& name) {
  const char* folder = std::getenv("SCATTER_REAL_DATA");
  const auto path = std::filesystem::path(folder != nullptr ? folder : "../shared/data") / name;
  if (!std::filesystem::exists(path)) {
    fmt::print(stderr, "interpolation: no real data ({})\n", name);
    return nullptr;
  }
  auto brdf = formats::open_brdf(path.string());
  return brdf ? *brdf : nullptr;
}

std::vector<Figure> run_accuracy() {
  std::vector<Figure> figures;
  fmt::print(stderr, "mean relative error, 99th percentile, peak ratio\n");
  const std::array<std::pair<const char*, const char*>, 3> ggx{
      {{"ggx0.1", "ggx:alpha=0.1,f0=0.04,albedo=0.2"},
       {"ggx0.3", "ggx:alpha=0.3,f0=0.04,albedo=0.2"},
       {"ggx0.6", "ggx:alpha=0.6,f0=0.04,albedo=0.2"}}};
  for (const auto& [name, spec] : ggx) {
    const auto truth = make_model(spec).value();
    contest(name, *truth, measured(*truth, 0), {10, 30, 50}, figures);
  }
  const std::array<std::pair<const char*, const char*>, 4> others{
      {{"beckmann_oren_nayar", "sum:oren-nayar:sigma=0.4,albedo=0.3,beckmann:alpha=0.2,f0=0.04"},
       {"ward", "ward:alpha=0.15,ks=0.1,albedo=0.2"},
       {"lafortune", "lafortune:n=30,ks=0.1,albedo=0.2"},
       {"two_lobe_ggx",
        "sum:ggx:alpha=0.1,f0=0.04,weight=0.6,ggx:alpha=0.4,f0=0.04,weight=0.4,lambertian:0.2"}}};
  for (const auto& [name, spec] : others) {
    if (const auto truth = make_model(spec)) {
      contest(name, **truth, measured(**truth, 0.003), {10, 30, 50}, figures);
    } else {
      fmt::print(stderr, "interpolation: {}: {}\n", name, truth.error().what);
    }
  }
  for (const char* name :
       {"aurora_white", "cc_ibiza_sunset", "chm_orange", "ilm_solo_m_68", "irid_flake_paint1"}) {
    if (const auto truth = real_brdf(fmt::format("rgl/{}_rgb.bsdf", name))) {
      contest(name, *truth, measured(*truth, 0), {10, 30, 50}, figures);
    }
  }
  return figures;
}

/// One incidence, 64,800 directions, as an export asks; against the grid's own specular-linear.
std::vector<Figure> run_eval() {
  const auto truth = make_model("ward:alpha=0.15,ks=0.1,albedo=0.2").value();
  const auto data = measured(*truth, 0.003);
  const auto link = GuidedBrdf::make(data).value();
  std::vector<Direction> o;
  for (int k = 0; k < 64800; ++k) {
    o.push_back(from_spherical(1.55 * (k % 180) / 180.0, radians(k / 180.0)));
  }
  std::vector<double> f(o.size());
  std::vector<Origin> origin(o.size());
  const Direction i = from_spherical(radians(30), 0);
  const auto evaluate = [&](const Brdf& brdf) {
    brdf.eval_batch(i, o, f, origin);
    keep(f[0]);
  };
  return {run_contest("interpolation.eval", {.unit = "directions/s",
                                             .work = 64800,
                                             .ours = [&] { evaluate(*link); },
                                             .peer = "specular-linear grid",
                                             .theirs = [&] { evaluate(*data); }})};
}

const Benchmark kAccuracy{"interpolation.accuracy", run_accuracy};
const Benchmark kEval{"interpolation.eval", run_eval};

}  // namespace
}  // namespace scatter::bench
