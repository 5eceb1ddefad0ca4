#include "host_sdk/reflectance/models/metals.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

namespace scatter::reflectance {
namespace {

constexpr IndexSample kAluminium[] = {
#include "host_sdk/reflectance/models/data/aluminium.inc"
};
constexpr IndexSample kBrass[] = {
#include "host_sdk/reflectance/models/data/brass.inc"
};
constexpr IndexSample kChromium[] = {
#include "host_sdk/reflectance/models/data/chromium.inc"
};
constexpr IndexSample kCopper[] = {
#include "host_sdk/reflectance/models/data/copper.inc"
};
constexpr IndexSample kGold[] = {
#include "host_sdk/reflectance/models/data/gold.inc"
};
constexpr IndexSample kIron[] = {
#include "host_sdk/reflectance/models/data/iron.inc"
};
constexpr IndexSample kNickel[] = {
#include "host_sdk/reflectance/models/data/nickel.inc"
};
constexpr IndexSample kSilver[] = {
#include "host_sdk/reflectance/models/data/silver.inc"
};
constexpr IndexSample kTitanium[] = {
#include "host_sdk/reflectance/models/data/titanium.inc"
};
constexpr IndexSample kZinc[] = {
#include "host_sdk/reflectance/models/data/zinc.inc"
};

constexpr std::array kMetals{
    Metal{"aluminium", kAluminium, "Rakic 1995"},
    Metal{"brass", kBrass, "Querry 1985 (70 % copper, 30 % zinc)"},
    Metal{"chromium", kChromium, "Johnson and Christy 1974"},
    Metal{"copper", kCopper, "Johnson and Christy 1972"},
    Metal{"gold", kGold, "Johnson and Christy 1972"},
    Metal{"iron", kIron, "Johnson and Christy 1974"},
    Metal{"nickel", kNickel, "Johnson and Christy 1974"},
    Metal{"silver", kSilver, "Johnson and Christy 1972"},
    Metal{"titanium", kTitanium, "Johnson and Christy 1974"},
    Metal{"zinc", kZinc, "Werner, Glantschnig and Ambrosch-Draxl 2009"},
};

}  // namespace

std::span<const Metal> metals() noexcept {
  return kMetals;
}

Result<ComplexIndex> metal_index(std::string_view name, double wavelength_nm) {
  const auto metal = std::ranges::find(kMetals, name, &Metal::name);
  if (metal == kMetals.end()) {
    std::string known;
    for (const Metal& m : kMetals) {
      known += fmt::format("{}{}", known.empty() ? "" : ", ", m.name);
    }
    return fail(ErrorCode::kNotFound, fmt::format("no optical constants of metal '{}'", name),
                fmt::format("use one of {}, or give n and k", known));
  }
  const auto above = std::ranges::lower_bound(metal->samples, wavelength_nm, {}, &IndexSample::wavelength_nm);
  const IndexSample& first = metal->samples.front();
  const IndexSample& last = metal->samples.back();
  if (above == metal->samples.end() || !(wavelength_nm >= first.wavelength_nm)) {
    return fail(ErrorCode::kOutOfRange,
                fmt::format("{} at {} nm: the table covers {}..{} nm", name, wavelength_nm,
                            first.wavelength_nm, last.wavelength_nm),
                "ask for a wavelength inside the table");
  }
  if (above == metal->samples.begin()) {
    return ComplexIndex{first.n, first.k};
  }
  const IndexSample& b = *above;
  const IndexSample& a = *(above - 1);
  const double t = (wavelength_nm - a.wavelength_nm) / (b.wavelength_nm - a.wavelength_nm);
  return ComplexIndex{a.n + t * (b.n - a.n), a.k + t * (b.k - a.k)};
}

}  // namespace scatter::reflectance
