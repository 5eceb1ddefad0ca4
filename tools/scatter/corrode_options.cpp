#include "tools/scatter/corrode_options.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "tools/scatter/corrode_maps.h"

namespace scatter::cli {
namespace {

using corrosion::Map;
using nlohmann::ordered_json;

constexpr std::size_t kMostSeeds = 100'000;

/// A check for CLI11 from a function that names what is allowed.
template <typename Named>
CLI::Validator one_of(const Named& named, const std::string& names) {
  return {[named](const std::string& text) {
            const auto found = named(text);
            return found ? std::string{} : found.error().what + "; " + found.error().remedy;
          },
          names};
}

std::optional<std::uint64_t> whole_number(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

Result<std::vector<std::uint64_t>> seeds_named(const std::string& text) {
  const auto wrong = [&text] {
    return fail(ErrorCode::kInvalidArgument, fmt::format("seeds are '{}'", text),
                fmt::format("give two ends as 1..8 or a list as 1,5,9, at most {} of them", kMostSeeds));
  };
  if (const auto dots = text.find(".."); dots != std::string::npos) {
    const auto first = whole_number(std::string_view(text).substr(0, dots));
    const auto last = whole_number(std::string_view(text).substr(dots + 2));
    if (!first || !last || *last < *first || *last - *first >= kMostSeeds) {
      return wrong();
    }
    std::vector<std::uint64_t> seeds;
    for (std::uint64_t k = 0; k <= *last - *first; ++k) {
      seeds.push_back(*first + k);
    }
    return seeds;
  }
  std::vector<std::uint64_t> seeds;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const auto seed = whole_number(std::string_view(text).substr(at, end - at));
    if (!seed || seeds.size() >= kMostSeeds || std::ranges::find(seeds, *seed) != seeds.end()) {
      return wrong();
    }
    seeds.push_back(*seed);
    at = end + 1;
  }
  return seeds;
}

/// Maps made of pictures describe one sheet: all of one size.
Status same_size(const std::vector<std::pair<const char*, const Map*>>& maps) {
  const std::pair<const char*, const Map*>* first = nullptr;
  for (const auto& map : maps) {
    if (map.second->values.size() == 1) {
      continue;
    }
    if (first == nullptr) {
      first = &map;
    } else if (map.second->width != first->second->width || map.second->height != first->second->height) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: the image has {} x {} pixels, expected {} x {} as that of {}", map.first,
                              map.second->width, map.second->height, first->second->width,
                              first->second->height, first->first),
                  "scale all maps to one size");
    }
  }
  return {};
}

Status take_ages(const CorrodeOptions& options, CorrodePlan& plan) {
  plan.series = !options.series.empty();
  plan.ages = plan.series ? options.series : std::vector<double>{options.growth.age_years};
  for (double& age : plan.ages) {
    if (!std::isfinite(age)) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: is {} years", plan.series ? "series" : "age", age), "give 0 to 100 years");
    }
    const double clamped = std::clamp(age, 0.0, corrosion::kLongestAgeYears);
    if (clamped != age) {
      plan.notes.push_back(fmt::format("age {} is taken as {} years", age, clamped));
      age = clamped;
    }
  }
  std::ranges::sort(plan.ages);
  plan.ages.erase(std::ranges::unique(plan.ages).begin(), plan.ages.end());
  plan.growth.age_years = plan.ages.back();
  return {};
}

Status take_appearance(const CorrodeOptions& options, CorrodePlan& plan) {
  auto& look = plan.appearance;
  look.rule = options.look == "height" ? corrosion::LookRule::kByHeight : corrosion::LookRule::kByState;
  look.metal_roughness = options.metal_roughness;
  for (std::size_t layer = 0; layer < 4; ++layer) {
    if (!options.layers[layer].empty()) {
      auto map = read_layer(fmt::format("layer{}", layer), options.layers[layer]);
      if (!map) {
        return std::unexpected(map.error());
      }
      look.layers[layer] = *std::move(map);
    }
  }
  std::ranges::copy(options.layer_depths_um, look.layer_depths_um.begin());
  std::ranges::copy(options.layer_limits, look.layer_limits.begin());
  if (Status done = take_map("bump", options.bump, look.bump); !done) {
    return done;
  }
  return corrosion::check(look);
}

/// Multiplies the exposure by what a cover and a nobler metal do.
Status take_masks(const CorrodeOptions& options, CorrodePlan& plan) {
  auto& growth = plan.growth;
  std::vector<std::pair<const char*, const Map*>> maps = {{"surface", &growth.surface},
                                                          {"material", &growth.material},
                                                          {"exposure", &growth.exposure},
                                                          {"opening", &growth.opening},
                                                          {"bump", &plan.appearance.bump}};
  Map cover{1, 1, {0.0F}};
  Map contact{1, 1, {0.0F}};
  maps.insert(maps.end(), {{"cover", &cover}, {"contact", &contact}});
  Status done = take_map("cover", options.cover, cover);
  done = done ? take_map("contact", options.contact, contact) : done;
  done = done ? same_size(maps) : done;
  const auto multiply = [&](const Result<Map>& factor) -> Status {
    if (!factor) {
      return std::unexpected(factor.error());
    }
    auto both = corrosion::product(growth.exposure, *factor);
    if (!both) {
      return std::unexpected(both.error());
    }
    growth.exposure = *std::move(both);
    return {};
  };
  if (done && !options.cover.empty()) {
    done = multiply(corrosion::aeration_exposure(cover, growth.extent_mm, growth.border, options.aeration));
  }
  if (done && !options.contact.empty()) {
    done = multiply(corrosion::galvanic_exposure(contact, growth.extent_mm, growth.border, options.galvanic));
  }
  return done;
}

void add_mask_options(CLI::App& app, CorrodeOptions& options) {
  constexpr const char* kGroup = "Covers and nobler metal";
  app.add_option("--cover", options.cover, "Where it is 0.5 or more a cover keeps air out: rusts beside it")
      ->group(kGroup);
  app.add_option("--contact", options.contact, "Where it is 0.5 or more lies a nobler metal: rusts beside it")
      ->group(kGroup);
  const auto number = [&app](const char* name, double& to, const char* help) {
    app.add_option(name, to, help)->capture_default_str()->group(kGroup);
  };
  number("--covered-exposure", options.aeration.covered, "Exposure under a cover, 0..1");
  number("--cover-gain", options.aeration.edge_gain, "What its edge has more than the open, 0..1000");
  number("--cover-reach-mm", options.aeration.reach_mm, "Distance over which that falls to 1 / e");
  number("--contact-gain", options.galvanic.contact_gain, "Gain at the contact for equal areas, 0..1000");
  number("--contact-reach-mm", options.galvanic.reach_mm, "Distance over which that falls to 1 / e");
}

void add_map_options(CLI::App& app, CorrodeOptions& options) {
  const auto map = [&app](const char* name, std::string& to, const char* help) {
    app.add_option(name, to, help)->group("Maps (FILE.exr, FILE.png or one number)");
  };
  map("--surface", options.surface, "0 dark = damaged, rusts first; 1 white = protected [0.5]");
  map("--material", options.material, "0 dark = poor metal, pits; 1 white = good, rust spreads [0.5]");
  map("--exposure", options.exposure, "Multiplies how readily a place rusts, >= 0 [1]");
  map("--opening", options.opening, "Below 0.5: a hole from the start [1]");
  map("--bump", options.bump, "Multiplies the height before normals are taken, 0..1 [1]");
}

void add_look_options(CLI::App& app, CorrodeOptions& options) {
  constexpr const char* kGroup = "Looks";
  for (std::size_t layer = 0; layer < 4; ++layer) {
    app.add_option(fmt::format("--layer{}", layer), options.layers[layer],
                   layer == 3   ? "Colour of intact metal: image or r/g/b, linear 0..1"
                   : layer == 0 ? "Colour of the deepest rust"
                                : "Colour of rust between")
        ->group(kGroup);
  }
  app.add_option("--look", options.look,
                 "What decides on colour and regime: state, or height as in the thesis")
      ->check(CLI::IsMember({"state", "height"}))
      ->default_str("state")
      ->group(kGroup);
  app.add_option("--layer-depths", options.layer_depths_um, "Depth at which layers 0, 1, 2 are reached [um]")
      ->delimiter(',')
      ->expected(3)
      ->default_str("700,180,5")
      ->group(kGroup);
  app.add_option("--layer-limits", options.layer_limits,
                 "With --look height: share of thickness left at layers 0, 1, 2, 3")
      ->delimiter(',')
      ->expected(4)
      ->default_str("0,0.333,0.667,1")
      ->group(kGroup);
  app.add_option("--metal-roughness", options.metal_roughness, "GGX alpha of intact metal")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str()
      ->group(kGroup);
  app.add_option("--map-set", options.map_set, "Also write a material for other programs: gltf or pbrt")
      ->check(CLI::IsMember({"gltf", "pbrt"}))
      ->group(kGroup);
}

void add_mode_options(CLI::App& app, corrosion::GrowthOptions& growth) {
  constexpr const char* kThesis = "Only --mode thesis";
  app.add_option("--bite", growth.events.bite,
                 "Share of the thickness lost per hit where the material is 0.5")
      ->capture_default_str()
      ->group(kThesis);
  app.add_flag("--conversion-removes", growth.events.conversion_removes,
               "A cell also loses metal when its last neighbour corrodes")
      ->group(kThesis);
  constexpr const char* kFront = "Only --mode physical";
  const auto front = [&app](const char* name, double& to, const char* help) {
    app.add_option(name, to, help)->capture_default_str()->group(kFront);
  };
  front("--depth-per-spread", growth.front.depth_per_spread,
        "Depth gained while rust spreads as far [mm/mm]");
  front("--skin-um", growth.front.skin_um, "Depth lost soon after rust arrives [um]");
  front("--front-sigma", growth.front.front_sigma, "How uneven the spreading is");
  front("--front-length-mm", growth.front.front_length_mm, "Over what length");
  front("--front-roughness", growth.front.front_roughness, "How smooth; small is ragged");
  front("--pit-sigma", growth.front.pit_sigma, "How uneven the deepening is");
  front("--pit-length-mm", growth.front.pit_length_mm, "Over what length");
  front("--pit-roughness", growth.front.pit_roughness, "How smooth; small is ragged");
  front("--finest-mm", growth.front.finest_mm, "Nothing varies on shorter scales");
}

}  // namespace

void add_options(CLI::App& app, CorrodeOptions& options) {
  auto& growth = options.growth;
  app.add_option("-o,--output", options.output, "Folder for the results")->required();
  auto* age = app.add_option("--age", growth.age_years, "Years, 0..100")->capture_default_str();
  app.add_option("--corrosivity", options.corrosivity, "Atmosphere: very-low, low, medium, high, very-high")
      ->check(one_of(corrosion::corrosivity_named, ""))
      ->capture_default_str();
  app.add_option("--law", options.law, "Loss over time: thesis or iso9224")
      ->check(one_of(corrosion::law_named, ""))
      ->capture_default_str();
  app.add_option("--starting-points", growth.starting_points, "Where rust begins, at least 1")
      ->check(CLI::Range(1, 268435456))
      ->capture_default_str();
  app.add_option("--late-points", options.late_points,
                 "More of them per 1000 g/m^2 lost [as many as starting points]");
  app.add_option("--size", growth.side, "Cells along each side, 8..16384")
      ->check(CLI::Range(8, 16384))
      ->capture_default_str();
  app.add_option("--extent-mm", growth.extent_mm, "Length of each side [mm]")->capture_default_str();
  app.add_option("--thickness-mm", growth.thickness_mm, "Of the sheet [mm]")->capture_default_str();
  auto* seed = app.add_option("--seed", growth.seed, "Another number, another sheet")->capture_default_str();
  app.add_option("--mode", options.mode, "How rust spreads: physical or thesis")
      ->check(CLI::IsMember({"physical", "thesis"}))
      ->capture_default_str();
  app.add_option("--border", options.border, "toroidal (tiles without a seam) or clamped")
      ->check(CLI::IsMember({"toroidal", "clamped"}))
      ->capture_default_str();
  app.add_option("--least-susceptibility", growth.least_susceptibility,
                 "What white surface is taken for, 0..1")
      ->capture_default_str();
  app.add_option("--reserve", growth.reserve, "Share of the metal that is never taken, 0..1")
      ->capture_default_str();
  app.add_option("--series", options.series,
                 "Several ages of one run, for example 1,5,10,15,20: a folder each, and "
                 "strip.png")
      ->delimiter(',')
      ->excludes(age);
  app.add_option("--seeds", options.seeds, "Several sheets on all cores, 1..8 or 1,5,9: a folder each")
      ->check(one_of(seeds_named, ""))
      ->excludes(seed);
  add_map_options(app, options);
  add_mask_options(app, options);
  add_look_options(app, options);
  add_mode_options(app, growth);
}

Result<CorrodePlan> plan(const CorrodeOptions& options) {
  CorrodePlan plan;
  plan.growth = options.growth;
  auto& growth = plan.growth;
  const auto corrosivity = corrosion::corrosivity_named(options.corrosivity);
  const auto law = corrosion::law_named(options.law);
  if (!corrosivity || !law) {
    return std::unexpected(corrosivity ? law.error() : corrosivity.error());
  }
  growth.corrosivity = *corrosivity;
  growth.law = *law;
  growth.mode = options.mode == "thesis" ? corrosion::Mode::kThesis : corrosion::Mode::kPhysical;
  growth.border = options.border == "clamped" ? corrosion::Border::kClamped : corrosion::Border::kToroidal;
  growth.late_points = options.late_points;
  plan.set = options.map_set == "gltf"   ? MapSet::kGltf
             : options.map_set == "pbrt" ? MapSet::kPbrt
                                         : MapSet::kNone;
  plan.batch = !options.seeds.empty();
  if (const auto seeds = plan.batch ? seeds_named(options.seeds) : std::vector<std::uint64_t>{growth.seed};
      seeds) {
    plan.seeds = *seeds;
  } else {
    return std::unexpected(seeds.error());
  }
  const auto read = [&]() -> Status {
    Status done = take_ages(options, plan);
    for (const auto& [parameter, text, to] : {std::tuple{"surface", &options.surface, &growth.surface},
                                              {"material", &options.material, &growth.material},
                                              {"exposure", &options.exposure, &growth.exposure},
                                              {"opening", &options.opening, &growth.opening}}) {
      done = done ? take_map(parameter, *text, *to) : done;
    }
    done = done ? take_appearance(options, plan) : done;
    return done ? take_masks(options, plan) : done;
  };
  if (const Status done = read(); !done) {
    return std::unexpected(done.error());
  }
  return plan;
}

ordered_json to_json(const CorrodeOptions& options, const corrosion::GrowthOptions& used) {
  ordered_json json = {{"mode", options.mode},
                       {"corrosivity", corrosion::name(used.corrosivity)},
                       {"law", corrosion::name(used.law)},
                       {"age_years", used.age_years},
                       {"starting_points", used.starting_points},
                       {"late_points_per_1000_g_per_m2", corrosion::late_points_of(used)},
                       {"size", used.side},
                       {"extent_mm", used.extent_mm},
                       {"thickness_mm", used.thickness_mm},
                       {"seed", used.seed},
                       {"border", options.border},
                       {"least_susceptibility", used.least_susceptibility},
                       {"reserve", used.reserve}};
  const std::pair<const char*, const std::string*> texts[] = {
      {"surface", &options.surface},  {"material", &options.material}, {"exposure", &options.exposure},
      {"opening", &options.opening},  {"bump", &options.bump},         {"cover", &options.cover},
      {"contact", &options.contact},  {"layer0", &options.layers[0]},  {"layer1", &options.layers[1]},
      {"layer2", &options.layers[2]}, {"layer3", &options.layers[3]}};
  for (const auto& [key, text] : texts) {
    if (!text->empty()) {
      json[key] = *text;
    }
  }
  if (!options.cover.empty()) {
    json["aeration"] = {{"covered", options.aeration.covered},
                        {"edge_gain", options.aeration.edge_gain},
                        {"reach_mm", options.aeration.reach_mm}};
  }
  if (!options.contact.empty()) {
    json["galvanic"] = {{"contact_gain", options.galvanic.contact_gain},
                        {"reach_mm", options.galvanic.reach_mm}};
  }
  json["look"] = options.look.empty() ? "state" : options.look;
  if (used.mode == corrosion::Mode::kThesis) {
    json["bite"] = used.events.bite;
    json["conversion_removes"] = used.events.conversion_removes;
  } else {
    const auto& front = used.front;
    json["depth_per_spread"] = front.depth_per_spread;
    json["skin_um"] = front.skin_um;
    json["front"] = {{"sigma", front.front_sigma},
                     {"length_mm", front.front_length_mm},
                     {"roughness", front.front_roughness}};
    json["pit"] = {
        {"sigma", front.pit_sigma}, {"length_mm", front.pit_length_mm}, {"roughness", front.pit_roughness}};
    json["finest_mm"] = front.finest_mm;
  }
  return json;
}

}  // namespace scatter::cli
