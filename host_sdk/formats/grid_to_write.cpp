#include "host_sdk/formats/grid_to_write.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host_sdk/formats/sample_list_brdf.h"
#include "host_sdk/reflectance/adaptive_brdf.h"
#include "host_sdk/reflectance/half_difference_brdf.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::Direction;
using reflectance::GridBrdf;
using reflectance::GridLayout;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;
using reflectance::SpecularGridBrdf;

constexpr double kSameAngle = 1e-6;
constexpr double kHorizon = 1e-9;
constexpr std::size_t kMostNodes = 50'000'000;

/// Some channels of a BRDF that is no grid.
class SomeChannels final : public Brdf {
 public:
  SomeChannels(const Brdf& brdf, std::vector<std::size_t> chosen) : brdf_(brdf), chosen_(std::move(chosen)) {
    for (std::size_t k = 0; k < chosen_.size() && !brdf.wavelengths_nm().empty(); ++k) {
      wavelengths_nm_.push_back(brdf.wavelengths_nm()[chosen_[k]]);
    }
  }
  [[nodiscard]] ScatterType type() const noexcept override { return brdf_.type(); }
  [[nodiscard]] std::size_t channels() const noexcept override { return chosen_.size(); }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override { return wavelengths_nm_; }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override {
    std::vector<double> all(brdf_.channels());
    const Origin origin = brdf_.eval(omega_i, omega_o, all);
    choose(all, f_per_sr);
    return origin;
  }
  [[nodiscard]] bool dirac(const Direction& omega_i, std::span<double> weight) const noexcept override {
    std::vector<double> all(brdf_.channels());
    const bool some = brdf_.dirac(omega_i, all);
    if (some) {
      choose(all, weight);
    }
    return some;
  }
  [[nodiscard]] bool uncertainty(const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept override {
    std::vector<double> random(brdf_.channels());
    std::vector<double> systematic(brdf_.channels());
    if (!brdf_.uncertainty(omega_i, omega_o, random, systematic)) {
      return false;
    }
    choose(random, random_per_sr);
    choose(systematic, systematic_per_sr);
    return true;
  }
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept override {
    std::vector<double> all(brdf_.channels() * omega_o.size());
    brdf_.eval_batch(omega_i, omega_o, all, origin);
    for (std::size_t k = 0; k < omega_o.size(); ++k) {
      choose(std::span(all).subspan(k * brdf_.channels()), f_per_sr.subspan(k * chosen_.size()));
    }
  }

 private:
  void choose(std::span<const double> all, std::span<double> out) const noexcept {
    for (std::size_t c = 0; c < chosen_.size(); ++c) {
      out[c] = all[chosen_[c]];
    }
  }

  const Brdf& brdf_;
  std::vector<std::size_t> chosen_;
  std::vector<float> wavelengths_nm_;
};

template <typename T>
void keep_only(std::vector<T>& list, const std::vector<std::size_t>& chosen) {
  if (list.empty()) {
    return;
  }
  std::vector<T> out;
  for (const std::size_t index : chosen) {
    out.push_back(list[index]);
  }
  list = std::move(out);
}

template <typename T>
std::shared_ptr<const T> borrowed(const T& object) {
  return {std::shared_ptr<const void>(), &object};
}

template <typename T>
Result<std::shared_ptr<const T>> shared(Result<T> made) {
  if (!made) {
    return std::unexpected(std::move(made.error()));
  }
  return std::make_shared<const T>(std::move(*made));
}

template <typename T>
Result<std::shared_ptr<const Brdf>> as_brdf(Result<T> made) {
  if (!made) {
    return std::unexpected(std::move(made.error()));
  }
  return std::make_shared<const T>(std::move(*made));
}

std::unexpected<Error> no_grid() {
  return fail(ErrorCode::kFailedPrecondition, "the samples are scattered, the format needs a grid",
              "interpolate them by a chain of estimators first, or write BiRD, which takes lists");
}

/// Even steps that cover a range, as close as possible to the wanted one.
Result<std::size_t> steps_in(double range, double step, std::string_view name) {
  const double count = std::round(range / step);
  if (!(step > 0) || !(count >= 1 && count <= 100'000)) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{} step {} deg", name, reflectance::degrees(step)),
                "give a step of 0.01 deg or more");
  }
  return static_cast<std::size_t>(count);
}

/// Rotations of the sample, as azimuths of the light on it.
std::vector<double> rotations_of(const Brdf& brdf) {
  std::vector<double> rotations;
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    double last = 0;
    for (const auto& part : grid->content().parts) {
      double phi = std::fmod(part.phi_i, 2 * kPi);
      phi = phi < 0 ? phi + 2 * kPi : phi;
      if (rotations.empty() || part.rotation_rad - last > kSameAngle) {
        rotations.push_back(phi);
      }
      rotations.back() = phi;  // The steepest incidence has the best defined azimuth.
      last = part.rotation_rad;
    }
  } else if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    rotations = specular->content().rotation;
  }
  if (rotations.size() < 2) {
    return {0.0};
  }
  std::ranges::sort(rotations);
  return rotations;
}

/// Values along one azimuth: where there is none, the last one on the way from radial 0 goes on.
void hold_last(std::span<double> f, std::span<const Origin> origin, std::size_t channels) {
  const auto valid = [&](std::size_t k) { return origin[k] != Origin::kInvalid; };
  std::size_t last = 0;
  while (last < origin.size() && !valid(last)) {
    ++last;
  }
  if (last == origin.size()) {
    return;
  }
  for (std::size_t k = 0; k < origin.size(); ++k) {
    last = valid(k) ? k : last;
    for (std::size_t c = 0; c < channels; ++c) {
      f[k * channels + c] = f[last * channels + c];
    }
  }
}

class SpecularSampler {
 public:
  SpecularSampler(const Brdf& brdf, SpecularGridBrdf::Content& out) : brdf_(brdf), out_(out) {
    out_.type = brdf.type();
    out_.wavelengths_nm.assign(brdf.wavelengths_nm().begin(), brdf.wavelengths_nm().end());
  }

  void run() {
    const std::size_t nodes =
        out_.rotation.size() * out_.theta_i.size() * out_.azimuth.size() * out_.radial.size();
    out_.f_per_sr.assign(brdf_.channels(), std::vector<float>(nodes));
    out_.origin.resize(nodes);
    omega_o_.resize(out_.radial.size());
    f_.resize(out_.radial.size() * brdf_.channels());
    origin_.resize(out_.radial.size());
    std::size_t node = 0;
    for (const double phi : out_.rotation) {
      for (const double theta : out_.theta_i) {
        for (const double psi : out_.azimuth) {
          row(theta, phi, psi, node);
          node += out_.radial.size();
        }
      }
    }
    if (plain_) {
      out_.origin.clear();
    }
  }

 private:
  void row(double theta, double phi, double psi, std::size_t node) {
    const double side = out_.type == ScatterType::kBtdf ? -1 : 1;
    for (std::size_t k = 0; k < omega_o_.size(); ++k) {
      const Direction offset = reflectance::from_spherical(out_.radial[k], psi);
      const double x = offset.x * std::cos(theta) - offset.z * std::sin(theta);
      // On the horizon rounding must not decide, nor tell one half from the other.
      double z = offset.x * std::sin(theta) + offset.z * std::cos(theta);
      z = z < kHorizon ? std::min(z, 0.0) : z;
      omega_o_[k] = {x * std::cos(phi) - offset.y * std::sin(phi),
                     x * std::sin(phi) + offset.y * std::cos(phi), side * z};
    }
    brdf_.eval_batch(reflectance::from_spherical(theta, phi), omega_o_, f_, origin_);
    hold_last(f_, origin_, brdf_.channels());
    for (std::size_t k = 0; k < omega_o_.size(); ++k) {
      for (std::size_t c = 0; c < brdf_.channels(); ++c) {
        out_.f_per_sr[c][node + k] = static_cast<float>(f_[k * brdf_.channels() + c]);
      }
      const bool below = side * omega_o_[k].z <= 0;
      out_.origin[node + k] = below ? Origin::kExtrapolated : origin_[k];
      plain_ = plain_ && (below || origin_[k] == Origin::kMeasured);
    }
  }

  const Brdf& brdf_;
  SpecularGridBrdf::Content& out_;
  std::vector<Direction> omega_o_;
  std::vector<double> f_;
  std::vector<Origin> origin_;
  bool plain_ = true;  ///< All measured above the horizon, which a grid means without origins.
};

}  // namespace

Metadata metadata_of(const Brdf& brdf, const EncodeOptions& options) {
  Metadata metadata = options.metadata;
  const Metadata* own = nullptr;
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    own = &grid->content().metadata;
  } else if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    own = &specular->content().metadata;
  } else if (const auto* list = dynamic_cast<const SampleListBrdf*>(&brdf)) {
    own = &list->samples().metadata;
  } else if (const auto* adaptive = dynamic_cast<const reflectance::AdaptiveBrdf*>(&brdf)) {
    own = &adaptive->content().metadata;
  } else if (const auto* table = dynamic_cast<const reflectance::HalfDifferenceBrdf*>(&brdf)) {
    own = &table->content().metadata;
  }
  if (own != nullptr) {
    metadata.insert(own->begin(), own->end());
  }
  return metadata;
}

std::vector<GridLayout::Incidence> incidences_of(const Brdf& brdf, const EncodeOptions& options) {
  std::vector<GridLayout::Incidence> out;
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf); grid != nullptr && options.theta_i.empty()) {
    return GridLayout::of(*grid).incidences;
  }
  const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf);
  std::vector<double> theta_i = options.theta_i;
  if (theta_i.empty() && specular != nullptr) {
    theta_i = specular->content().theta_i;
  }
  for (int deg = 0; theta_i.size() < 9 && options.theta_i.empty() && specular == nullptr; deg += 10) {
    theta_i.push_back(radians(deg));
  }
  const std::vector<double> rotations = rotations_of(brdf);
  for (const double rotation : rotations) {
    for (const double theta : theta_i) {
      out.push_back({.rotation_rad = rotation, .theta_i = theta, .phi_i = rotation});
    }
  }
  return out;
}

Result<std::shared_ptr<const GridBrdf>> normal_grid(const Brdf& brdf, const EncodeOptions& options) {
  if (dynamic_cast<const SampleListBrdf*>(&brdf) != nullptr) {
    return no_grid();
  }
  const auto* grid = dynamic_cast<const GridBrdf*>(&brdf);
  if (grid != nullptr && options.theta_i.empty() && options.theta_step == 0 && options.phi_step == 0) {
    if (options.metadata.empty()) {
      return borrowed(*grid);
    }
    GridBrdf::Content content = grid->content();
    content.metadata = metadata_of(brdf, options);
    return shared(GridBrdf::make(std::move(content)));
  }
  GridLayout layout;
  layout.incidences = incidences_of(brdf, options);
  const auto theta_steps = steps_in(kPi / 2,
                                    options.theta_step > 0 ? options.theta_step
                                    : grid != nullptr      ? grid->content().theta_step
                                                           : layout.theta_step,
                                    "theta");
  const auto phi_steps = steps_in(2 * kPi,
                                  options.phi_step > 0 ? options.phi_step
                                  : grid != nullptr    ? grid->content().phi_step
                                                       : layout.theta_step,
                                  "phi");
  if (!theta_steps || !phi_steps) {
    return std::unexpected(theta_steps ? phi_steps.error() : theta_steps.error());
  }
  layout.theta_count = *theta_steps + 1;
  layout.phi_count = *phi_steps;
  layout.theta_step = kPi / 2 / static_cast<double>(*theta_steps);
  if (layout.theta_count * layout.phi_count * layout.incidences.size() > kMostNodes) {
    return fail(ErrorCode::kInvalidArgument, "more than 50 million nodes",
                "use wider steps or fewer incidences");
  }
  auto sampled = sample_on_grid(brdf, layout);
  if (!sampled) {
    return std::unexpected(std::move(sampled.error()));
  }
  GridBrdf::Content content = sampled->content();
  content.metadata = metadata_of(brdf, options);
  return shared(GridBrdf::make(std::move(content)));
}

Result<std::shared_ptr<const SpecularGridBrdf>> specular_grid(const Brdf& brdf,
                                                              const EncodeOptions& options) {
  if (dynamic_cast<const SampleListBrdf*>(&brdf) != nullptr) {
    return no_grid();
  }
  const auto* own = dynamic_cast<const SpecularGridBrdf*>(&brdf);
  if (own != nullptr && options.theta_i.empty() && options.theta_step == 0 && options.phi_step == 0) {
    if (options.metadata.empty()) {
      return borrowed(*own);
    }
    SpecularGridBrdf::Content content = own->content();
    content.metadata = metadata_of(brdf, options);
    return shared(SpecularGridBrdf::make(std::move(content)));
  }
  SpecularGridBrdf::Content content;
  content.rotation = rotations_of(brdf);
  const auto incidences = incidences_of(brdf, options);
  for (const auto& incidence : incidences) {
    if (incidence.rotation_rad - incidences.front().rotation_rad > kSameAngle) {
      break;
    }
    if (content.theta_i.empty() || incidence.theta_i - content.theta_i.back() > kSameAngle) {
      content.theta_i.push_back(incidence.theta_i);
    }
  }
  const double step = radians(1);
  const double radial_step = options.theta_step > 0 ? options.theta_step : step;
  const auto azimuths = steps_in(2 * kPi, options.phi_step > 0 ? options.phi_step : step, "azimuth");
  const auto radials = steps_in(kPi, radial_step, "radial");
  if (!azimuths || !radials) {
    return std::unexpected(azimuths ? radials.error() : azimuths.error());
  }
  for (std::size_t k = 0; k <= *azimuths; ++k) {
    content.azimuth.push_back(2 * kPi * static_cast<double>(k) / static_cast<double>(*azimuths));
  }
  const double steepest = content.theta_i.empty() ? 0 : content.theta_i.back();
  for (std::size_t k = 0; k <= *radials; ++k) {
    content.radial.push_back(kPi * static_cast<double>(k) / static_cast<double>(*radials));
    if (content.radial.back() >= kPi / 2 + steepest - kSameAngle) {
      break;
    }
  }
  if (content.rotation.size() * content.theta_i.size() * content.azimuth.size() * content.radial.size() >
      kMostNodes) {
    return fail(ErrorCode::kInvalidArgument, "more than 50 million nodes",
                "use wider steps or fewer incidences");
  }
  SpecularSampler(brdf, content).run();
  content.metadata = metadata_of(brdf, options);
  return shared(SpecularGridBrdf::make(std::move(content)));
}

Result<std::shared_ptr<const Brdf>> only_channels(const Brdf& brdf, const std::vector<std::size_t>& chosen) {
  for (const std::size_t channel : chosen) {
    if (channel >= brdf.channels()) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("channel {}, but the data have {}", channel, brdf.channels()),
                  fmt::format("choose a channel 0..{}", brdf.channels() - 1));
    }
  }
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    GridBrdf::Content content = grid->content();
    content.channels = chosen.size();
    keep_only(content.wavelengths_nm, chosen);
    for (auto& part : content.parts) {
      keep_only(part.f_per_sr, chosen);
      keep_only(part.random_per_sr, chosen);
      keep_only(part.systematic_per_sr, chosen);
    }
    return as_brdf(GridBrdf::make(std::move(content)));
  }
  if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    SpecularGridBrdf::Content content = specular->content();
    keep_only(content.wavelengths_nm, chosen);
    keep_only(content.f_per_sr, chosen);
    keep_only(content.sigma_per_sr, chosen);
    keep_only(content.stated_total, chosen);
    return as_brdf(SpecularGridBrdf::make(std::move(content)));
  }
  if (const auto* list = dynamic_cast<const SampleListBrdf*>(&brdf)) {
    reflectance::ScatteredSamples samples = list->samples();
    const std::size_t channels = std::exchange(samples.channels, chosen.size());
    keep_only(samples.wavelengths_nm, chosen);
    for (auto* values : {&samples.f_per_sr, &samples.random_per_sr, &samples.systematic_per_sr}) {
      std::vector<float> out;
      for (std::size_t s = 0; s < values->size(); s += channels) {
        for (const std::size_t channel : chosen) {
          out.push_back((*values)[s + channel]);
        }
      }
      *values = std::move(out);
    }
    return as_brdf(SampleListBrdf::make(std::move(samples)));
  }
  return std::make_shared<const SomeChannels>(brdf, chosen);
}

}  // namespace scatter::formats
