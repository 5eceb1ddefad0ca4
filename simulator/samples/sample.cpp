#include "simulator/samples/sample.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>

#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "simulator/samples/textured_spec.h"

namespace scatter::simulator {
namespace {

using reflectance::radians;

constexpr std::string_view kRemedy =
    "write a sample as ggx:alpha=0.2,f0=0.04,albedo=0.3 or lambertian:0.5 or "
    "film:transmittance=0.6,haze=0.3 or corroded:age=25,corrosivity=medium or file:PATH, then defects such "
    "as +tilt=1.0@30 "
    "+translucent=0.1 +uneven=0.5 +soft=0.2";

std::unexpected<Error> refuse(std::string_view spec, std::string_view what) {
  return fail(ErrorCode::kInvalidArgument, fmt::format("sample '{}': {}", spec, what), std::string(kRemedy));
}

constexpr std::array<std::string_view, 4> kDefectNames{"tilt", "translucent", "uneven", "soft"};

/// Where the last "+name=" of a known defect starts; npos when there is none.
std::size_t last_defect(std::string_view spec) noexcept {
  std::size_t found = std::string_view::npos;
  for (const std::string_view name : kDefectNames) {
    const std::size_t at = spec.rfind(std::string("+").append(name).append("="));
    if (at != std::string_view::npos && (found == std::string_view::npos || at > found)) {
      found = at;
    }
  }
  return found;
}

/// Number within [low, high], the whole text.
std::optional<double> number(std::string_view text, double low, double high) noexcept {
  double value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc{} || end != text.data() + text.size() || !(value >= low && value <= high)) {
    return std::nullopt;
  }
  return value;
}

/// Reads one "name=value" into `defects`; empty text when good, else what is wrong.
std::string read_defect(std::string_view text, Defects& defects) {
  const std::size_t equals = text.find('=');
  const std::string_view name = text.substr(0, equals);
  const std::string_view value = text.substr(equals + 1);
  if (name == "tilt") {
    const std::size_t at = value.find('@');
    const auto tilt = number(value.substr(0, at), 0.0, 10.0);
    const auto azimuth =
        at == std::string_view::npos ? std::optional(0.0) : number(value.substr(at + 1), -360.0, 360.0);
    if (!tilt || !azimuth) {
      return fmt::format("tilt is '{}', expected degrees 0..10, '@', azimuth in degrees -360..360", value);
    }
    defects.tilt_rad = radians(*tilt);
    defects.tilt_azimuth_rad = radians(*azimuth);
    return {};
  }
  const bool degrees = name == "uneven";
  const auto amount = number(value, 0.0, degrees ? 10.0 : 1.0);
  if (!amount) {
    return fmt::format("{} is '{}', expected {}", name, value, degrees ? "degrees 0..10" : "a share 0..1");
  }
  (name == "uneven" ? defects.uneven_rad
   : name == "soft" ? defects.soft
                    : defects.translucent) = degrees ? radians(*amount) : *amount;
  return {};
}

}  // namespace

Result<std::shared_ptr<const Sample>> Sample::make(std::string_view spec) {
  Defects defects;
  std::string_view base = spec;
  std::array<bool, kDefectNames.size()> seen{};
  for (std::size_t at = last_defect(base); at != std::string_view::npos; at = last_defect(base)) {
    const std::string_view defect = base.substr(at + 1);
    const std::string problem = read_defect(defect, defects);
    if (!problem.empty()) {
      return refuse(spec, problem);
    }
    for (std::size_t k = 0; k < kDefectNames.size(); ++k) {
      if (defect.substr(0, defect.find('=')) == kDefectNames[k] && std::exchange(seen[k], true)) {
        return refuse(spec, fmt::format("{} is given twice", kDefectNames[k]));
      }
    }
    base = base.substr(0, at);
  }
  if (is_textured_spec(base)) {
    auto surface = make_textured_surface(base);
    if (!surface) {
      return std::unexpected(std::move(surface.error()));
    }
    return std::make_shared<const Sample>(std::move(*surface), defects, std::string(base));
  }
  const bool is_file = base.starts_with("file:");
  if (!is_file) {
    // A model's numbers hold no '+', so what follows one is a defect with a wrong name.
    if (const std::size_t plus = base.find('+'); plus != std::string_view::npos) {
      return refuse(spec, fmt::format("unknown defect '{}'; known are tilt, translucent, uneven, soft",
                                      base.substr(plus + 1, base.find('=', plus) - plus - 1)));
    }
    if (!reflectance::is_model_spec(base)) {
      return refuse(spec, base.empty() ? "no surface given" : "unknown kind of surface");
    }
  }
  auto brdf = is_file ? formats::open_brdf(base) : reflectance::make_model(base);
  if (!brdf) {
    return std::unexpected(std::move(brdf.error()));
  }
  if ((*brdf)->channels() == 0 || (*brdf)->channels() > kMaxChannels) {
    return refuse(spec, fmt::format("it has {} channels, expected 1..{}", (*brdf)->channels(), kMaxChannels));
  }
  return std::make_shared<const Sample>(std::make_shared<const UniformSurface>(std::move(*brdf)), defects,
                                        std::string(base));
}

std::shared_ptr<const Sample> Sample::moved(const Place& place) const {
  // Six decimals: finer than any cell, and short in the text.
  constexpr double kSteps = 1e6;
  const Place to{std::round(place.u * kSteps) / kSteps, std::round(place.v * kSteps) / kSteps};
  auto surface = surface_->moved(to);
  if (surface == nullptr) {
    return nullptr;
  }
  return std::make_shared<const Sample>(std::move(surface), defects_, spec_at(spec_, to));
}

double Sample::signal_share(double seconds) const noexcept {
  return 1.0 - defects_.soft * (1.0 - std::exp(-std::max(seconds, 0.0)));
}

}  // namespace scatter::simulator
