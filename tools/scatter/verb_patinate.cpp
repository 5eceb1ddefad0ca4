// scatter patinate -o DIR: a piece of copper weathers; its layers, maps, pictures and figures.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include "simulator/corrosion/patina/patina.h"
#include "simulator/corrosion/patina/script.h"
#include "tools/plot/strip.h"
#include "tools/scatter/corrode_maps.h"
#include "tools/scatter/files.h"
#include "tools/scatter/patina_files.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/sheet_picture.h"
#include "tools/scatter/verb.h"
#include "tools/scatter/whole_folder.h"

namespace scatter::cli {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kStripTile = 256;

struct PatinateOptions {
  corrosion::PatinaOptions growth;  ///< Without its maps.
  std::string atmosphere = "urban";
  std::string deposition = "ballistic";
  std::string exposure, wetness, inclination;
  std::string script;
  std::vector<double> series;
  std::string output;
};

/// Everything read and checked, except what Patina::grow checks.
struct PatinatePlan {
  corrosion::PatinaOptions growth;
  std::vector<corrosion::ScriptStep> script;
  std::vector<double> ages;  ///< Rising; one or more.
  bool series = false;
};

Result<PatinatePlan> plan(const PatinateOptions& options) {
  PatinatePlan plan{
      .growth = options.growth, .script = {}, .ages = options.series, .series = !options.series.empty()};
  const auto atmosphere = corrosion::atmosphere_named(options.atmosphere);
  if (!atmosphere) {
    return std::unexpected(atmosphere.error());
  }
  plan.growth.atmosphere = *atmosphere;
  const auto deposition = corrosion::deposition_named(options.deposition);
  if (!deposition) {
    return std::unexpected(deposition.error());
  }
  plan.growth.deposition = *deposition;
  for (const Status& status : {take_map("exposure", options.exposure, plan.growth.exposure),
                               take_map("wetness", options.wetness, plan.growth.wetness),
                               take_map("inclination", options.inclination, plan.growth.inclination_deg)}) {
    if (!status) {
      return std::unexpected(status.error());
    }
  }
  auto script = corrosion::script_from(options.script);
  if (!script) {
    return std::unexpected(script.error());
  }
  plan.script = *std::move(script);
  if (plan.ages.empty()) {
    plan.ages.push_back(plan.growth.age_years);
  }
  for (const double age : plan.ages) {
    if (!std::isfinite(age)) {
      return fail(ErrorCode::kInvalidArgument, fmt::format("age is {} years", age), "give 0 to 100 years");
    }
  }
  std::ranges::sort(plan.ages);
  const auto repeated = std::ranges::unique(plan.ages);
  plan.ages.erase(repeated.begin(), repeated.end());
  plan.growth.age_years = plan.ages.back();
  return plan;
}

/// What there is to say of the piece at one age.
struct Figures {
  double age_years = 0;
  double copper_loss_um = 0;
  double tarnish_um = 0;
  double patina_um = 0;
  corrosion::Coverage coverage{};
  std::uint64_t particles = 0;
};

ordered_json to_json(const Figures& figures) {
  return {{"age_years", figures.age_years},
          {"copper_loss_um", figures.copper_loss_um},
          {"tarnish_um", figures.tarnish_um},
          {"patina_um", figures.patina_um},
          {"bare_fraction", figures.coverage.bare},
          {"tarnish_fraction", figures.coverage.tarnish},
          {"patina_fraction", figures.coverage.patina},
          {"particles", figures.particles}};
}

ordered_json to_json(const PatinateOptions& options, const corrosion::PatinaOptions& used) {
  ordered_json json = {{"atmosphere", options.atmosphere},
                       {"age_years", used.age_years},
                       {"size", used.side},
                       {"extent_mm", used.extent_mm},
                       {"seed", used.seed},
                       {"deposition", options.deposition},
                       {"particle_um", used.particle_um},
                       {"grain_mm", used.grain_mm},
                       {"patch_mm", used.patch_mm},
                       {"patch_sigma", used.patch_sigma},
                       {"metal_roughness", used.metal_roughness}};
  for (const auto& [key, text] :
       {std::pair{"exposure", &options.exposure}, std::pair{"wetness", &options.wetness},
        std::pair{"inclination", &options.inclination}, std::pair{"script", &options.script}}) {
    if (!text->empty()) {
      json[key] = *text;
    }
  }
  return json;
}

plot::StripTile tile_of(const images::Image& preview, double age_years) {
  const images::Image small = scaled_down(preview, kStripTile);
  plot::StripTile tile{.width = small.width,
                       .height = small.height,
                       .rgb = {},
                       .caption = fmt::format("{:g} {}", age_years, age_years == 1 ? "year" : "years")};
  for (const float value : small.values) {
    tile.rgb.push_back(
        static_cast<std::uint8_t>(std::lround(255 * std::clamp(images::linear_to_srgb(value), 0.0F, 1.0F))));
  }
  return tile;
}

/// Ages one after the other, each written as soon as it is there.
class Run {
 public:
  Run(const PatinatePlan& plan, std::filesystem::path folder, const Context& context)
      : plan_(plan), folder_(std::move(folder)), stop_(context.stop) {}

  Result<std::vector<Figures>> all(const corrosion::Patina& patina) {
    const Status grown =
        patina.each(plan_.ages, [&](const corrosion::PatinaPiece& piece) { take_map(piece); }, stop_);
    bar_.clear();
    if (!done_) {
      return std::unexpected(done_.error());
    }
    if (!grown) {
      return std::unexpected(grown.error());
    }
    if (plan_.series) {
      const auto picture = plot::strip(tiles_, "");
      if (!picture) {
        return std::unexpected(picture.error());
      }
      if (const Status written = write_file(folder_ / "strip.png", *picture); !written) {
        return std::unexpected(written.error());
      }
    }
    return figures_;
  }

 private:
  void take_map(const corrosion::PatinaPiece& piece) {
    if (!done_) {
      return;
    }
    corrosion::LayerStack layers = piece.layers;
    done_ = apply(layers, plan_.script, plan_.growth.seed);
    const auto place = plan_.series ? folder_ / fmt::format("age-{:g}", piece.age_years) : folder_;
    if (done_) {
      done_ = prepare_folder(place);
    }
    if (!done_) {
      return;
    }
    const auto preview =
        write_patina(layers, {.metal_roughness = plan_.growth.metal_roughness}, place, stop_);
    if (!preview) {
      done_ = std::unexpected(preview.error());
      return;
    }
    using corrosion::PatinaMaterial;
    figures_.push_back(
        {.age_years = piece.age_years,
         .copper_loss_um = piece.copper_loss_um,
         .tarnish_um = layers.mean_um(PatinaMaterial::kTarnish),
         .patina_um = layers.mean_um(PatinaMaterial::kSulphate) + layers.mean_um(PatinaMaterial::kChloride),
         .coverage = corrosion::coverage(layers),
         .particles = piece.particles});
    if (plan_.series) {
      tiles_.push_back(tile_of(*preview, piece.age_years));
    }
    bar_.show(static_cast<double>(figures_.size()) / static_cast<double>(plan_.ages.size()), "weathering");
  }

  const PatinatePlan& plan_;
  std::filesystem::path folder_;
  std::stop_token stop_;
  Progress bar_;
  Status done_;
  std::vector<Figures> figures_;
  std::vector<plot::StripTile> tiles_;
};

Result<Answer> run(const PatinateOptions& options, const Context& context) {
  const auto chosen = plan(options);
  if (!chosen) {
    return std::unexpected(chosen.error());
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto patina = corrosion::Patina::grow(chosen->growth);
  if (!patina) {
    return std::unexpected(patina.error());
  }
  auto folder = WholeFolder::make(options.output);
  if (!folder) {
    return std::unexpected(folder.error());
  }
  const auto figures = Run(*chosen, folder->place(), context).all(**patina);
  if (!figures) {
    return std::unexpected(figures.error());
  }
  Answer answer;
  answer.json = to_json(figures->back());
  answer.json["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (chosen->series) {
    auto& ages = answer.json["ages"] = ordered_json::array();
    for (const Figures& one : *figures) {
      ages.push_back(to_json(one));
      ages.back()["folder"] = fmt::format("age-{:g}", one.age_years);
    }
  }
  answer.json["options"] = to_json(options, (*patina)->options());
  answer.json["notes"] = (*patina)->notes();
  if (const Status written = write_file(folder->place() / "patina.json", answer.json.dump(2) + "\n");
      !written) {
    return std::unexpected(written.error());
  }
  const auto files = folder->publish();
  if (!files) {
    return std::unexpected(files.error());
  }
  answer.json["files"] = *files;
  for (const std::string& note : (*patina)->notes()) {
    answer.text += "note: " + note + "\n";
  }
  for (const Figures& one : *figures) {
    answer.text += fmt::format(
        "{:g} years: {:.2f} um of copper lost; tarnish {:.2f} um, patina {:.2f} um; shows {:.1f} % bare, "
        "{:.1f} % "
        "tarnish, {:.1f} % patina\n",
        one.age_years, one.copper_loss_um, one.tarnish_um, one.patina_um, 100 * one.coverage.bare,
        100 * one.coverage.tarnish, 100 * one.coverage.patina);
  }
  for (const std::string& file : *files) {
    answer.text += file + "\n";
  }
  return answer;
}

void add_options(CLI::App& app, PatinateOptions& options) {
  auto& growth = options.growth;
  app.add_option("--atmosphere", options.atmosphere, "marine, urban or rural")->capture_default_str();
  app.add_option("--age", growth.age_years, "Years, 0..100")->capture_default_str();
  app.add_option("--series", options.series, "Several ages instead: 1,5,20; a folder each, and strip.png")
      ->delimiter(',');
  app.add_option("--size", growth.side, "Cells along each side, 8..8192")->capture_default_str();
  app.add_option("--extent-mm", growth.extent_mm, "Length of each side")->capture_default_str();
  app.add_option("--seed", growth.seed, "Another seed, another piece")->capture_default_str();
  app.add_option("--deposition", options.deposition,
                 "How patina thickens: steady, random, relaxed or ballistic")
      ->capture_default_str();
  app.add_option("--particle-um", growth.particle_um, "Height of a particle")->capture_default_str();
  app.add_option("--grain-mm", growth.grain_mm, "Width of a particle")->capture_default_str();
  app.add_option("--patch-mm", growth.patch_mm, "Distance of places of slow and fast growth")
      ->capture_default_str();
  app.add_option("--patch-sigma", growth.patch_sigma, "Their contrast, of the logarithm of the rate")
      ->capture_default_str();
  app.add_option("--metal-roughness", growth.metal_roughness, "GGX alpha of bare copper")
      ->capture_default_str();
  constexpr const char* kMaps = "Maps (FILE.exr, FILE.png or one number)";
  app.add_option("--exposure", options.exposure, "Multiplies loss and rain, 0..10 [1]")->group(kMaps);
  app.add_option("--wetness", options.wetness, "Multiplies loss, 0..10 [1]")->group(kMaps);
  app.add_option("--inclination", options.inclination, "Degrees from facing the sky, 0..180 [0]")
      ->group(kMaps);
  app.add_option("--script", options.script,
                 "Done to every age at the end: polish:level=5;erode:rate=0.5,years=4;... (docs/patina.md)");
  app.add_option("-o,--output", options.output, "Folder to write")->required();
}

}  // namespace

Verb add_patinate(CLI::App& root) {
  auto* app = root.add_subcommand(
      "patinate",
      "Let a piece of copper weather: maps of its layers, colour and roughness, pictures, figures");
  auto options = std::make_shared<PatinateOptions>();
  add_options(*app, *options);
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
