#include "simulator/corrosion/patina/atmosphere.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace scatter::corrosion {
namespace {

constexpr std::array<std::string_view, 3> kNames{"marine", "urban", "rural"};
/// 1 g/m^2 of copper (8.96 g/cm^3) is this thick.
constexpr double kUmPerGramPerSquareMetre = 1 / 8.96;
constexpr double kIso9224Exponent = 0.667;
constexpr double kStraightFromYears = 20;

constexpr std::array<AtmosphereData, 3> kData{
    AtmosphereData{1.0, kIso9224Exponent, 1.0 * kUmPerGramPerSquareMetre, 3.5, PatinaMaterial::kChloride},
    AtmosphereData{1.5, kIso9224Exponent, 1.35 * kUmPerGramPerSquareMetre, 3.5, PatinaMaterial::kSulphate},
    AtmosphereData{0.5, kIso9224Exponent, 0.8 * kUmPerGramPerSquareMetre, 3.5, PatinaMaterial::kSulphate},
};

}  // namespace

std::string_view name(Atmosphere atmosphere) noexcept {
  return kNames[static_cast<std::size_t>(atmosphere)];
}

Result<Atmosphere> atmosphere_named(std::string_view name) {
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) {
      return static_cast<Atmosphere>(i);
    }
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("atmosphere \"{}\" is unknown", name),
              "use marine, urban or rural");
}

const AtmosphereData& data_of(Atmosphere atmosphere) noexcept {
  return kData[static_cast<std::size_t>(atmosphere)];
}

double copper_loss_um(Atmosphere atmosphere, double years) noexcept {
  const AtmosphereData& data = data_of(atmosphere);
  const double curved = data.first_year_um * std::pow(std::min(years, kStraightFromYears), data.exponent);
  if (years <= kStraightFromYears) {
    return curved;
  }
  return curved * (1 + data.exponent * (years - kStraightFromYears) / kStraightFromYears);
}

LossBalance balance_of(Atmosphere atmosphere) noexcept {
  const AtmosphereData& data = data_of(atmosphere);
  const double tarnish_volume = data_of(PatinaMaterial::kTarnish).volume_per_copper;
  return {static_cast<float>(data.cuprite_um / tarnish_volume), static_cast<float>(tarnish_volume),
          static_cast<float>(data_of(data.patina).volume_per_copper)};
}

}  // namespace scatter::corrosion
