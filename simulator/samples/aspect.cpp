#include "simulator/samples/aspect.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "simulator/samples/facet_frame.h"

namespace scatter::simulator {
namespace {

using Vector = reflectance::Direction;

struct Node {
  double at;
  double weight;
};

/// Gauss-Hermite nodes for a standard normal variable, exact to degree 9.
/// Source  Abramowitz and Stegun 25.4.46, scaled.
constexpr std::array<Node, 5> kFewNodes{{{-2.85697001387280565, 0.0112574113277206889},
                                         {-1.35562617997426587, 0.222075922005612644},
                                         {0.0, 0.533333333333333333},
                                         {1.35562617997426587, 0.222075922005612644},
                                         {2.85697001387280565, 0.0112574113277206889}}};

/// Nodes for the facets' slopes, in units of their standard deviation. Few where the facets lean
/// less than a lobe is wide (alpha >= 0.05); the trapezium rule, which converges exponentially for
/// a Gaussian, where they lean more.
std::vector<Node> slope_nodes(double uneven_rad) {
  if (uneven_rad <= reflectance::radians(0.75)) {
    return {kFewNodes.begin(), kFewNodes.end()};
  }
  constexpr int kHalf = 5;
  constexpr double kStep = 0.7;
  std::vector<Node> nodes;
  double sum = 0;
  for (int k = -kHalf; k <= kHalf; ++k) {
    nodes.push_back({k * kStep, std::exp(-0.5 * k * k * kStep * kStep)});
    sum += nodes.back().weight;
  }
  for (Node& node : nodes) {
    node.weight /= sum;
  }
  return nodes;
}

Vector combine(const Vector& local, const std::array<Vector, 3>& axes) noexcept {
  return {local.x * axes[0].x + local.y * axes[1].x + local.z * axes[2].x,
          local.x * axes[0].y + local.y * axes[1].y + local.z * axes[2].y,
          local.x * axes[0].z + local.y * axes[1].z + local.z * axes[2].z};
}

/// Channel of `brdf` that stands for each LED: the nearest wavelength, else by position.
std::array<std::size_t, kColours> channels_for_colours(const reflectance::Brdf& brdf) noexcept {
  std::array<std::size_t, kColours> channel{};
  const auto wavelengths = brdf.wavelengths_nm();
  for (std::size_t colour = 0; colour < kColours; ++colour) {
    channel[colour] = std::min(colour, brdf.channels() - 1);
    if (wavelengths.size() == brdf.channels()) {
      const auto nearest = std::ranges::min_element(wavelengths, {}, [&](float wavelength) {
        return std::abs(wavelength - kColourWavelengthsNm[colour]);
      });
      channel[colour] = static_cast<std::size_t>(nearest - wavelengths.begin());
    }
  }
  return channel;
}

}  // namespace

Footprint Aspect::footprint(const Sample& sample, double spot_diameter_mm, const Vector& towards_source) {
  const Defects& defects = sample.defects();
  const FacetFrame base =
      facet_frame(reflectance::from_spherical(defects.tilt_rad, defects.tilt_azimuth_rad));
  return {.diameter_mm = spot_diameter_mm,
          .omega_i = {dot(towards_source, base[0]), dot(towards_source, base[1]),
                      std::abs(dot(towards_source, base[2]))}};
}

Aspect::Aspect(const Sample& sample, double spot_diameter_mm, const Vector& towards_source)
    : Aspect(sample, towards_source,
             {.brdf = sample.surface().lit(footprint(sample, spot_diameter_mm, towards_source))}) {}

std::vector<Aspect> Aspect::summands(const Sample& sample, double spot_diameter_mm,
                                     const Vector& towards_source) {
  std::vector<Aspect> aspects;
  for (Surface::Summand& lit :
       sample.surface().lit_apart(footprint(sample, spot_diameter_mm, towards_source))) {
    aspects.push_back(Aspect(sample, towards_source, std::move(lit)));
  }
  return aspects;
}

Aspect::Aspect(const Sample& sample, const Vector& towards_source, Surface::Summand lit)
    : brdf_(std::move(lit.brdf)), source_(towards_source), below_(towards_source.z < 0), broad_(lit.broad) {
  lit_ = below_ == sample.transmits();
  const Defects& defects = sample.defects();
  normal_ = reflectance::from_spherical(defects.tilt_rad, defects.tilt_azimuth_rad);
  const FacetFrame base = facet_frame(normal_);
  channel_ = channels_for_colours(*brdf_);
  if (defects.uneven_rad <= 0) {
    facets_.push_back({base, 1.0});
    return;
  }
  const std::vector<Node> nodes = slope_nodes(defects.uneven_rad);
  const double slope = std::tan(defects.uneven_rad);
  for (const Node& a : nodes) {
    for (const Node& b : nodes) {
      const Vector leaning = reflectance::normalized({-a.at * slope, -b.at * slope, 1.0});
      FacetFrame axes = facet_frame(leaning);
      for (Vector& axis : axes) {
        axis = combine(axis, base);
      }
      facets_.push_back({axes, a.weight * b.weight / leaning.z});
    }
  }
}

void Aspect::radiance(const Vector& towards_source, std::span<const Vector> towards_camera,
                      std::span<double> out) const noexcept {
  std::ranges::fill(out, 0.0);
  if (!lit_) {
    return;
  }
  const double side = below_ ? -1.0 : 1.0;
  const std::size_t channels = brdf_->channels();
  std::array<Vector, kBatch> omega_o;
  // Enough for three channels of a full batch; measured spectra go in smaller steps.
  std::array<double, kBatch * kColours> f;
  const std::size_t step = std::min(kBatch, f.size() / channels);
  for (const Facet& facet : facets_) {
    const Vector omega_i{dot(towards_source, facet.axes[0]), dot(towards_source, facet.axes[1]),
                         side * dot(towards_source, facet.axes[2])};
    if (omega_i.z <= 0) {
      continue;
    }
    for (std::size_t start = 0; start < towards_camera.size(); start += step) {
      const std::size_t count = std::min(step, towards_camera.size() - start);
      for (std::size_t k = 0; k < count; ++k) {
        const Vector& to = towards_camera[start + k];
        omega_o[k] = {dot(to, facet.axes[0]), dot(to, facet.axes[1]), side * dot(to, facet.axes[2])};
      }
      brdf_->eval_batch(omega_i, std::span(omega_o).first(count), std::span(f).first(count * channels), {});
      for (std::size_t k = 0; k < count; ++k) {
        const double across = dot(towards_camera[start + k], normal_);
        const double visible = facets_.size() == 1 ? 1.0 : std::max(side * omega_o[k].z, 0.0) / across;
        const double factor = across > 0 ? facet.weight * omega_i.z * visible : 0.0;
        for (std::size_t colour = 0; colour < kColours; ++colour) {
          out[(start + k) * kColours + colour] += factor * f[k * channels + channel_[colour]];
        }
      }
    }
  }
}

Vector Aspect::straight() const noexcept {
  // Thin films do not deviate what goes straight through, however they lean.
  if (below_) {
    return {-source_.x, -source_.y, -source_.z};
  }
  const double twice = 2 * dot(source_, normal_);
  return {twice * normal_.x - source_.x, twice * normal_.y - source_.y, twice * normal_.z - source_.z};
}

bool Aspect::regular(Regular& part) const noexcept {
  std::array<double, kMaxChannels> weight;
  const std::size_t channels = brdf_->channels();
  const FacetFrame base = facet_frame(normal_);
  const Vector omega_i{dot(source_, base[0]), dot(source_, base[1]), std::abs(dot(source_, base[2]))};
  if (!lit_ || !brdf_->dirac(omega_i, std::span(weight).first(channels))) {
    return false;
  }
  part.towards = straight();
  for (std::size_t colour = 0; colour < kColours; ++colour) {
    part.weight[colour] = weight[channel_[colour]];
  }
  return true;
}

}  // namespace scatter::simulator
