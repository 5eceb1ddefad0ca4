#include "simulator/samples/patina_spec.h"

#include <fmt/format.h>

#include <string>

#include "simulator/samples/spec_keys.h"
#include "simulator/samples/spec_sheet.h"

namespace scatter::simulator {
namespace {

constexpr std::uint64_t kMostSide = 8192;

/// Equal for samples that are the same piece.
std::string key_of(const PatinaSample& sample) {
  const corrosion::PatinaOptions& g = sample.growth;
  return fmt::format("patina {} {} {} {} {} {} {} {} {} {} {} {} {} {}", static_cast<int>(g.atmosphere),
                     g.age_years, g.side, g.extent_mm, g.seed, static_cast<int>(g.deposition), g.particle_um,
                     g.grain_mm, g.patch_mm, g.patch_sigma, simulator::key_of(g.exposure),
                     simulator::key_of(g.wetness), simulator::key_of(g.inclination_deg),
                     simulator::key_of(sample.optics));
}

Result<std::shared_ptr<const TexturedSheet>> grow(const PatinaSample& sample) {
  const auto patina = corrosion::Patina::grow(sample.growth);
  if (!patina) {
    return std::unexpected(patina.error());
  }
  const auto piece = (*patina)->at(sample.growth.age_years);
  if (!piece) {
    return std::unexpected(piece.error());
  }
  return TexturedSheet::make((*patina)->appearance(*piece), sample.growth.extent_mm, sample.optics);
}

}  // namespace

Result<PatinaSample> parse_patina(std::string_view spec) {
  PatinaSample sample;
  corrosion::PatinaOptions& g = sample.growth;
  SpecKeys keys(spec);
  if (const auto atmosphere = keys.text("atmosphere")) {
    const auto named = corrosion::atmosphere_named(*atmosphere);
    named ? static_cast<void>(g.atmosphere = *named) : keys.reject(named.error());
  }
  if (const auto deposition = keys.text("deposition")) {
    const auto named = corrosion::deposition_named(*deposition);
    named ? static_cast<void>(g.deposition = *named) : keys.reject(named.error());
  }
  keys.number("age", 0, corrosion::kOldestPatinaYears, g.age_years);
  keys.whole("seed", 0, ~std::uint64_t{0}, g.seed);
  keys.number("particle_um", 0.05, 20, g.particle_um);
  keys.number("grain_mm", 0.001, 10, g.grain_mm);
  keys.number("patch_mm", 0.01, 10000, g.patch_mm);
  keys.number("patch_sigma", 0, 2, g.patch_sigma);
  take_map(keys, "exposure", 10, g.exposure);
  take_map(keys, "wetness", 10, g.wetness);
  take_map(keys, "inclination", 180, g.inclination_deg);
  take_grid(keys, kMostSide, g.extent_mm, g.side);
  take_optics(keys, sample.optics);
  g.metal_roughness = static_cast<float>(sample.optics.metal_alpha);
  take_spot(keys, sample.place);
  if (const Status read = keys.finish(); !read) {
    return std::unexpected(read.error());
  }
  return sample;
}

Result<std::shared_ptr<const TexturedSheet>> patina_sheet(const PatinaSample& sample) {
  return shared_sheet(key_of(sample), [&] { return grow(sample); });
}

}  // namespace scatter::simulator
