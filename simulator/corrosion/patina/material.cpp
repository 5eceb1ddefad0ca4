#include "simulator/corrosion/patina/material.h"

#include <fmt/format.h>

namespace scatter::corrosion {
namespace {

/// Colours of the layers where they are thick, from which K = S (1 - R)^2 / (2 R) follows.
constexpr std::array<double, 3> absorption(std::array<double, 3> thick_colour, double scattering) {
  std::array<double, 3> k{};
  for (std::size_t c = 0; c < 3; ++c) {
    k[c] = scattering * (1 - thick_colour[c]) * (1 - thick_colour[c]) / (2 * thick_colour[c]);
  }
  return k;
}

constexpr double kTarnishScattering = 0.6;
constexpr double kGreenScattering = 0.14;

constexpr std::array<PatinaMaterialData, 3> kData{
    PatinaMaterialData{"tarnish",
                       "cuprite",
                       absorption({0.16, 0.075, 0.05}, kTarnishScattering),
                       {kTarnishScattering, kTarnishScattering, kTarnishScattering},
                       0.8,
                       1.68,
                       0.35,
                       0.05},
    PatinaMaterialData{"sulphate",
                       "brochantite",
                       absorption({0.17, 0.36, 0.27}, kGreenScattering),
                       {kGreenScattering, kGreenScattering, kGreenScattering},
                       12,
                       4.01,
                       0.7,
                       0.3},
    PatinaMaterialData{"chloride",
                       "atacamite",
                       absorption({0.14, 0.34, 0.20}, kGreenScattering),
                       {kGreenScattering, kGreenScattering, kGreenScattering},
                       12,
                       4.00,
                       0.7,
                       0.35},
};

}  // namespace

const PatinaMaterialData& data_of(PatinaMaterial material) noexcept {
  return kData[static_cast<std::size_t>(material)];
}

Result<PatinaMaterial> patina_material_named(std::string_view name) {
  if (name == "sulfate") {
    return PatinaMaterial::kSulphate;
  }
  for (const PatinaMaterial material : kPatinaMaterials) {
    if (name == data_of(material).name) {
      return material;
    }
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("material \"{}\" is unknown", name),
              "use tarnish, sulphate or chloride");
}

}  // namespace scatter::corrosion
