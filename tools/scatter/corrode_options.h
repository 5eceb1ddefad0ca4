// What `scatter corrode` may be asked for, and what the libraries need of it.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/exposure.h"
#include "simulator/corrosion/growth_options.h"
#include "tools/scatter/sheet_files.h"

namespace CLI {  // NOLINT(readability-identifier-naming): theirs
class App;
}

namespace scatter::cli {

/// As the person gives them; maps are files or numbers.
struct CorrodeOptions {
  corrosion::GrowthOptions growth;  ///< Without its maps.
  std::string mode = "physical";
  std::string corrosivity = "medium";
  std::string law = "thesis";
  std::string border = "toroidal";
  std::optional<double> late_points;
  std::string surface, material, exposure, opening, cover, contact, bump;
  corrosion::AerationOptions aeration;
  corrosion::GalvanicOptions galvanic;
  std::array<std::string, 4> layers;
  std::string look;  ///< Empty: by state.
  std::vector<float> layer_depths_um, layer_limits;
  float metal_roughness = 0.15F;
  std::vector<double> series;  ///< Ages; empty: only --age.
  std::string seeds;           ///< "1..8" or "1,5,9"; empty: only --seed.
  std::string map_set;
  std::string output;
};

void add_options(CLI::App& app, CorrodeOptions& options);

/// Everything read and checked, except what Growth::run checks.
struct CorrodePlan {
  corrosion::GrowthOptions growth;
  corrosion::AppearanceOptions appearance;
  MapSet set = MapSet::kNone;
  std::vector<double> ages;          ///< Rising; one or more.
  std::vector<std::uint64_t> seeds;  ///< One or more.
  bool series = false;               ///< A folder per age.
  bool batch = false;                ///< A folder per seed.
  std::vector<std::string> notes;
};

/// Reads the maps.
/// Errors    kInvalidArgument: parameter, what it is, what is expected; kNotFound and the like of files.
[[nodiscard]] Result<CorrodePlan> plan(const CorrodeOptions& options);

/// The options as they were used: key, value.
[[nodiscard]] nlohmann::ordered_json to_json(const CorrodeOptions& options,
                                             const corrosion::GrowthOptions& used);

}  // namespace scatter::cli
