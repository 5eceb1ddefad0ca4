#include "simulator/corrosion/corrosivity.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace scatter::corrosion {
namespace {

/// w = k t^n [g/m^2, years].
/// Source  Thesis table 2; corrosion.md 1.1.
struct PowerLaw {
  double k;
  double n;
};
constexpr std::array<PowerLaw, 5> kThesisLaws{
    {{5.5, 0.565}, {100.4, 0.441}, {274.6, 0.516}, {477.4, 0.638}, {954.8, 0.789}}};

/// Upper limits of the first year's attack, C1 to C5 [um].
/// Source  ISO 9223:2012, carbon steel; corrosion.md 3.2.
constexpr std::array<double, 5> kFirstYearUm{1.3, 25, 50, 80, 200};
/// Source  ISO 9224:2012, carbon steel, class B1.
constexpr double kIsoExponent = 0.523;
/// Where ISO 9224 turns from the power law to a straight line.
constexpr double kIsoPowerLawYears = 20;

constexpr std::array<std::string_view, 5> kCorrosivityNames{"very low", "low", "medium", "high", "very high"};
constexpr std::array<std::string_view, 2> kLawNames{"thesis", "iso9224"};

std::string plain(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c == '_' || c == '-') {
      c = ' ';
    } else if (c >= 'A' && c <= 'Z') {
      c = static_cast<char>(c - 'A' + 'a');
    }
  }
  return result;
}

double iso_rate(Corrosivity corrosivity) {
  return kFirstYearUm[static_cast<std::size_t>(corrosivity)] * kSteelGramsPerSquareMetrePerUm;
}

}  // namespace

std::string_view name(Corrosivity corrosivity) noexcept {
  return kCorrosivityNames[static_cast<std::size_t>(corrosivity)];
}

std::string_view name(Law law) noexcept {
  return kLawNames[static_cast<std::size_t>(law)];
}

Result<Corrosivity> corrosivity_named(std::string_view name) {
  const std::string wanted = plain(name);
  for (const Corrosivity corrosivity : kCorrosivities) {
    if (wanted == corrosion::name(corrosivity)) {
      return corrosivity;
    }
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("corrosivity: '{}' is no class", name),
              "use very low, low, medium, high or very high");
}

Result<Law> law_named(std::string_view name) {
  const std::string wanted = plain(name);
  for (const Law law : {Law::kThesis, Law::kIso9224}) {
    if (wanted == corrosion::name(law)) {
      return law;
    }
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("law: '{}' is no law", name), "use thesis or iso9224");
}

double mass_loss_g_per_m2(Corrosivity corrosivity, Law law, double years) noexcept {
  const double t = std::clamp(years, 0.0, kLongestAgeYears);
  if (law == Law::kThesis) {
    const auto [k, n] = kThesisLaws[static_cast<std::size_t>(corrosivity)];
    return k * std::pow(t, n);
  }
  const double rate = iso_rate(corrosivity);
  if (t <= kIsoPowerLawYears) {
    return rate * std::pow(t, kIsoExponent);
  }
  const double bend = std::pow(kIsoPowerLawYears, kIsoExponent);
  return rate * (bend + kIsoExponent * bend / kIsoPowerLawYears * (t - kIsoPowerLawYears));
}

double age_of_loss_years(Corrosivity corrosivity, Law law, double loss_g_per_m2) noexcept {
  if (!(loss_g_per_m2 > 0)) {
    return 0;
  }
  double years = 0;
  if (law == Law::kThesis) {
    const auto [k, n] = kThesisLaws[static_cast<std::size_t>(corrosivity)];
    years = std::pow(loss_g_per_m2 / k, 1 / n);
  } else {
    const double share = loss_g_per_m2 / iso_rate(corrosivity);
    const double bend = std::pow(kIsoPowerLawYears, kIsoExponent);
    years = share <= bend ? std::pow(share, 1 / kIsoExponent)
                          : kIsoPowerLawYears + (share / bend - 1) * kIsoPowerLawYears / kIsoExponent;
  }
  return std::min(years, kLongestAgeYears);
}

}  // namespace scatter::corrosion
