// scatter corrode -o DIR: a sheet of metal corrodes; its maps, pictures and figures.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "tools/scatter/corroded_batch.h"
#include "tools/scatter/files.h"
#include "tools/scatter/progress.h"
#include "tools/scatter/verb.h"
#include "tools/scatter/whole_folder.h"

namespace scatter::cli {
namespace {

using nlohmann::ordered_json;

ordered_json to_json(const SheetFigures& figures) {
  return {{"age_years", figures.age_years},
          {"mass_loss_g_per_m2", figures.mass_loss_g_per_m2},
          {"target_g_per_m2", figures.target_g_per_m2},
          {"corroded_fraction", figures.corroded_fraction},
          {"state3_fraction", figures.state3_fraction},
          {"hole_fraction", figures.hole_fraction},
          {"events", figures.events},
          {"exhausted", figures.exhausted},
          {"hash", figures.hash}};
}

/// Of a single run its figures at the last age stand on top; more ages and seeds stand in lists.
ordered_json summary(const CorrodeOptions& options, const CorrodePlan& plan, const GrownSheets& grown) {
  ordered_json json = ordered_json::object();
  if (!plan.batch) {
    json = to_json(grown.figures.back());
  }
  json["seconds"] = grown.seconds;
  if (plan.series || plan.batch) {
    auto& sheets = json["sheets"] = ordered_json::array();
    for (const SheetFigures& figures : grown.figures) {
      ordered_json one = ordered_json::object();
      std::string folder;
      if (plan.batch) {
        one["seed"] = figures.seed;
        folder = fmt::format("seed-{}", figures.seed) + (plan.series ? "/" : "");
      }
      one.update(to_json(figures));
      one["folder"] = plan.series ? folder + age_folder(figures.age_years) : folder;
      sheets.push_back(std::move(one));
    }
  }
  json["options"] = cli::to_json(options, grown.used);
  if (plan.batch) {
    json["options"]["seed"] = plan.seeds;
  }
  std::vector<std::string> notes = plan.notes;
  notes.insert(notes.end(), grown.notes.begin(), grown.notes.end());
  json["notes"] = notes;
  return json;
}

/// One strip for the ages of one seed, or for the seeds, in the folder that holds them. Drawn one after the
/// other: cairo's font cache is shared.
Status write_strips(const CorrodePlan& plan, GrownSheets& grown, const std::filesystem::path& folder) {
  if (!plan.series && !plan.batch) {
    return {};
  }
  const std::size_t in_strip = plan.series ? plan.ages.size() : grown.figures.size();
  for (std::size_t at = 0; at < grown.figures.size(); at += in_strip) {
    std::vector<plot::StripTile> tiles;
    for (std::size_t n = at; n < at + in_strip; ++n) {
      tiles.push_back(std::move(grown.figures[n].tile));
    }
    const auto picture = plot::strip(tiles, "");
    if (!picture) {
      return std::unexpected(picture.error());
    }
    const auto place =
        plan.series && plan.batch ? folder / fmt::format("seed-{}", grown.figures[at].seed) : folder;
    if (const Status written = write_file(place / "strip.png", *picture); !written) {
      return written;
    }
  }
  return {};
}

std::string words(const SheetFigures& figures, bool with_seed) {
  return fmt::format(
      "{}{:g} years: {:.1f} g/m^2 lost of {:.1f}{}; rust on {:.2f} %, {:.2f} % only deepens, {:.3f} % "
      "holes\n",
      with_seed ? fmt::format("seed {}, ", figures.seed) : "", figures.age_years, figures.mass_loss_g_per_m2,
      figures.target_g_per_m2, figures.exhausted ? " (nothing more can corrode)" : "",
      100 * figures.corroded_fraction, 100 * figures.state3_fraction, 100 * figures.hole_fraction);
}

Result<Answer> run(const CorrodeOptions& options, const Context& context) {
  const auto chosen = plan(options);
  if (!chosen) {
    return std::unexpected(chosen.error());
  }
  auto folder = WholeFolder::make(options.output);
  if (!folder) {
    return std::unexpected(folder.error());
  }
  Progress bar;
  auto grown = grow_and_write(
      *chosen, folder->place(), [&bar](double share) { bar.show(share, "corroding"); }, context.stop);
  bar.clear();
  if (!grown) {
    return std::unexpected(grown.error());
  }
  Answer answer;
  answer.json = summary(options, *chosen, *grown);
  if (const Status written = write_file(folder->place() / "corrosion.json", answer.json.dump(2) + "\n");
      !written) {
    return std::unexpected(written.error());
  }
  if (const Status written = write_strips(*chosen, *grown, folder->place()); !written) {
    return std::unexpected(written.error());
  }
  if (context.stop.stop_requested()) {
    return stopped();
  }
  const auto files = folder->publish();
  if (!files) {
    return std::unexpected(files.error());
  }
  answer.json["files"] = *files;
  for (const auto& note : answer.json["notes"]) {
    answer.text += "note: " + note.get<std::string>() + "\n";
  }
  for (const SheetFigures& figures : grown->figures) {
    answer.text += words(figures, chosen->batch);
  }
  answer.text += fmt::format("grown in {:.2f} s\n", grown->seconds);
  for (const std::string& file : *files) {
    answer.text += file + "\n";
  }
  return answer;
}

}  // namespace

Verb add_corrode(CLI::App& root) {
  auto* app = root.add_subcommand(
      "corrode",
      "Let a sheet of metal corrode: maps of height, colour, normals and regimes, pictures, figures");
  auto options = std::make_shared<CorrodeOptions>();
  add_options(*app, *options);
  return {app, [options](const Context& context) { return run(*options, context); }};
}

}  // namespace scatter::cli
