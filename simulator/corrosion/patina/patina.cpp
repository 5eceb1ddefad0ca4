#include "simulator/corrosion/patina/patina.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "simulator/corrosion/patina/draws.h"
#include "simulator/corrosion/patina/seed_field.h"

namespace scatter::corrosion {
namespace {

/// Steps are short where growth changes quickly: a quarter of a year at first, an eighth of the age later.
std::vector<double> calendar(double age_years) {
  std::vector<double> edges{0};
  while (edges.back() < age_years) {
    edges.push_back(edges.back() + std::max(0.25, 0.125 * edges.back()));
  }
  return edges;
}

Status check_number(double value, const char* parameter, double lowest, double highest) {
  if (value >= lowest && value <= highest) {
    return {};
  }
  return fail(ErrorCode::kInvalidArgument,
              fmt::format("{} is {}, expected {}..{}", parameter, value, lowest, highest),
              fmt::format("choose {} within the range", parameter));
}

Status check(const PatinaOptions& options) {
  for (const Status& status :
       {check_number(static_cast<double>(options.side), "side", 8, 8192),
        check_number(options.extent_mm, "extent_mm", 0.1, 10000),
        check_number(options.particle_um, "particle_um", 0.05, 20),
        check_number(options.grain_mm, "grain_mm", 0.001, 10),
        check_number(options.patch_mm, "patch_mm", 0.01, 10000),
        check_number(options.patch_sigma, "patch_sigma", 0, 2),
        check_number(options.metal_roughness, "metal_roughness", 0.01, 1),
        check(options.exposure, "exposure", 0, 10), check(options.wetness, "wetness", 0, 10),
        check(options.inclination_deg, "inclination_deg", 0, 180)}) {
    if (!status) {
      return status;
    }
  }
  if (!std::isfinite(options.age_years)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("age_years is {}, expected 0..100", options.age_years),
                "choose an age within the range");
  }
  return {};
}

/// Whole cells that make about one grain, dividing the side.
std::size_t cells_per_grain(const PatinaOptions& options) {
  const double wanted = options.grain_mm * static_cast<double>(options.side) / options.extent_mm;
  auto group =
      static_cast<std::size_t>(std::clamp(std::round(wanted), 1.0, static_cast<double>(options.side) / 4));
  while (options.side % group != 0) {
    --group;
  }
  return group;
}

double mean(std::span<const float> values) {
  double sum = 0;
  for (const float value : values) {
    sum += value;
  }
  return sum / static_cast<double>(values.size());
}

}  // namespace

Result<std::shared_ptr<const Patina>> Patina::grow(PatinaOptions options) {
  if (const Status status = check(options); !status) {
    return std::unexpected(status.error());
  }
  std::vector<std::string> notes;
  const double asked = options.age_years;
  options.age_years = std::clamp(asked, 0.0, kOldestPatinaYears);
  if (options.age_years != asked) {
    notes.push_back(fmt::format("age {} is taken as {} years", asked, options.age_years));
  }
  std::shared_ptr<Patina> patina(new Patina(std::move(options), std::move(notes)));
  patina->lay_out();
  return patina;
}

void Patina::lay_out() {
  const std::size_t group = cells_per_grain(options_);
  grains_ = options_.side / group;
  // A square of the grid smaller than a grain would carry the same particles higher, a larger one lower.
  const double square_mm = options_.extent_mm / static_cast<double>(grains_);
  const double grains_per_square =
      std::max(1.0, square_mm * square_mm / (options_.grain_mm * options_.grain_mm));
  particle_um_ = options_.particle_um / grains_per_square;

  const auto shares = [this](std::size_t side, std::vector<float>& loss, std::vector<float>* rain) {
    loss = on_grid(SeedField{.extent_mm = options_.extent_mm,
                             .spacing_mm = options_.patch_mm,
                             .sigma = options_.patch_sigma,
                             .seed = options_.seed},
                   side);
    const std::vector<float> exposure = on_grid(options_.exposure, side);
    const std::vector<float> wetness = on_grid(options_.wetness, side);
    const std::vector<float> inclination = on_grid(options_.inclination_deg, side);
    if (rain != nullptr) {
      rain->resize(loss.size());
    }
    for (std::size_t i = 0; i < loss.size(); ++i) {
      const float cosine = std::cos(inclination[i] * (std::numbers::pi_v<float> / 180));
      loss[i] *= exposure[i] * wetness[i] * 0.5F * (1 + cosine);
      if (rain != nullptr) {
        (*rain)[i] = exposure[i] * std::max(0.0F, cosine);
      }
    }
  };
  shares(options_.side, loss_share_, nullptr);
  shares(grains_, grain_loss_share_, &grain_rain_share_);

  const std::vector<double> edges = calendar(options_.age_years);
  double grown = 0;
  std::vector<float> before(grains_ * grains_, 0.0F);
  for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
    Step step{edges[k], edges[k + 1], grown, grown};
    grown += mean(gain_um(step, before));
    step.patina_um_at_end = grown;
    steps_.push_back(step);
  }
}

std::vector<float> Patina::patina_um(std::span<const float> loss_share, std::span<const float> rain_share,
                                     double years) const {
  const LossBalance balance = balance_of(options_.atmosphere);
  const auto loss = static_cast<float>(copper_loss_um(options_.atmosphere, years));
  const auto rain = static_cast<float>(data_of(options_.atmosphere).runoff_um_per_year * years);
  std::vector<float> thickness(loss_share.size());
  for (std::size_t i = 0; i < thickness.size(); ++i) {
    thickness[i] = balance.patina_um(loss * loss_share[i], rain * rain_share[i]);
  }
  return thickness;
}

std::vector<float> Patina::gain_um(const Step& step, std::vector<float>& before) const {
  std::vector<float> after = patina_um(grain_loss_share_, grain_rain_share_, step.end_years);
  std::vector<float> gain(after.size());
  for (std::size_t i = 0; i < gain.size(); ++i) {
    // Rain takes what would have formed, never what has: growth goes one way.
    gain[i] = std::max(0.0F, after[i] - before[i]);
  }
  before = std::move(after);
  return gain;
}

std::vector<float> Patina::tarnish_um(double years) const {
  const LossBalance balance = balance_of(options_.atmosphere);
  const auto loss = static_cast<float>(copper_loss_um(options_.atmosphere, years));
  std::vector<float> thickness(loss_share_.size());
  for (std::size_t i = 0; i < thickness.size(); ++i) {
    thickness[i] = balance.tarnish_um(loss * loss_share_[i]);
  }
  return thickness;
}

Layers Patina::expected(double age_years) const {
  const double age = std::clamp(age_years, 0.0, options_.age_years);
  Layers layers{.tarnish_um = mean(tarnish_um(age))};
  for (const Step& step : steps_) {
    if (age > step.begin_years) {
      const double share = std::min(1.0, (age - step.begin_years) / (step.end_years - step.begin_years));
      layers.patina_um = std::lerp(step.patina_um_at_begin, step.patina_um_at_end, share);
    }
  }
  return layers;
}

PatinaPiece Patina::piece(double age_years, std::span<const float> patina_um, std::uint64_t particles) const {
  // The options were checked: this cannot fail, nor can coating with what was computed here.
  PatinaPiece piece{.age_years = age_years,
                    .layers = *LayerStack::bare(options_.side, options_.extent_mm),
                    .particles = particles};
  const double loss = copper_loss_um(options_.atmosphere, age_years);
  const std::vector<float> tarnish = tarnish_um(age_years);
  piece.mean_tarnish_um = *piece.layers.coat(PatinaMaterial::kTarnish, tarnish);
  const Map grains{grains_, grains_, std::vector<float>(patina_um.begin(), patina_um.end())};
  piece.mean_patina_um =
      *piece.layers.coat(data_of(options_.atmosphere).patina, on_grid(grains, options_.side));
  piece.copper_loss_um = loss * mean(loss_share_);
  piece.coverage = coverage(piece.layers);
  return piece;
}

Status Patina::each(std::span<const double> ages_years, const std::function<void(const PatinaPiece&)>& visit,
                    const std::stop_token& stop) const {
  double last = -1e300;
  for (const double age : ages_years) {
    if (!std::isfinite(age) || age < last) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("age {} follows {}, expected rising ages", age, last),
                  "give finite ages in rising order");
    }
    last = age;
  }
  const auto squares = static_cast<double>(grains_ * grains_);
  std::vector<float> thickness(grains_ * grains_, 0.0F);
  Deposit deposit(grains_, grains_, options_.deposition);
  std::vector<float> lawful(grains_ * grains_, 0.0F);
  std::size_t next = 0;
  const auto show_until = [&](double limit_years, const std::function<void(double)>& grow_to) {
    while (next < ages_years.size() && std::clamp(ages_years[next], 0.0, options_.age_years) <= limit_years) {
      const double age = std::clamp(ages_years[next++], 0.0, options_.age_years);
      grow_to(age);
      if (stop.stop_requested()) {
        return;  // What is there is not yet the piece of this age.
      }
      if (options_.deposition != Deposition::kSteady) {
        std::ranges::transform(deposit.heights(), thickness.begin(),
                               [this](std::uint32_t h) { return static_cast<float>(h * particle_um_); });
      }
      visit(piece(age, thickness, deposit.particles()));
    }
  };
  show_until(0, [](double) {});
  for (std::size_t k = 0; k < steps_.size() && next < ages_years.size(); ++k) {
    const Step& step = steps_[k];
    const std::vector<float> gain = gain_um(step, lawful);
    if (options_.deposition == Deposition::kSteady) {
      const std::vector<float> grown = thickness;
      const auto grow_to = [&](double age) {
        const auto share =
            static_cast<float>(std::min(1.0, (age - step.begin_years) / (step.end_years - step.begin_years)));
        for (std::size_t i = 0; i < thickness.size(); ++i) {
          thickness[i] = grown[i] + share * gain[i];
        }
      };
      show_until(step.end_years, grow_to);
      grow_to(step.end_years);
    } else {
      const Result<FallPlaces> places = FallPlaces::make(gain);
      simulator::RandomStream stream(patina_key(options_.seed, PatinaDraw::kFalling, 0, k));
      const auto grow_to = [&](double age) {
        if (!places) {
          return;  // Nothing grows in this step.
        }
        const double share = std::min(1.0, (age - step.begin_years) / (step.end_years - step.begin_years));
        const double target = std::lerp(step.patina_um_at_begin, step.patina_um_at_end, share);
        const auto volume = static_cast<std::uint64_t>(std::llround(target / particle_um_ * squares));
        while (deposit.volume() < volume && !stop.stop_requested()) {
          for (int i = 0; i < 4096 && deposit.volume() < volume; ++i) {
            deposit.drop(places->draw(stream), stream);
          }
        }
      };
      show_until(step.end_years, grow_to);
      if (next < ages_years.size()) {
        grow_to(step.end_years);
      }
    }
    if (stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "the growth of the patina was stopped", "start it again");
    }
  }
  return {};
}

Result<PatinaPiece> Patina::at(double age_years, const std::stop_token& stop) const {
  Result<PatinaPiece> result = fail(ErrorCode::kInternal, "no age was shown", "report this as a defect");
  const std::array<double, 1> ages{age_years};
  if (const Status status = each(ages, [&](const PatinaPiece& piece) { result = piece; }, stop); !status) {
    return std::unexpected(status.error());
  }
  return result;
}

Appearance Patina::appearance(const PatinaPiece& piece) const {
  return corrosion::appearance(piece.layers, {.metal_roughness = options_.metal_roughness});
}

}  // namespace scatter::corrosion
