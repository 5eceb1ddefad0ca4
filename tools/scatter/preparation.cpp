#include "tools/scatter/preparation.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <utility>

#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/formats/sample_list_brdf.h"
#include "host_sdk/reflectance/estimators/blind_spots.h"
#include "host_sdk/reflectance/estimators/chain.h"
#include "host_sdk/reflectance/estimators/extent.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"
#include "host_sdk/reflectance/estimators/symmetry.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "simulator/samples/sample_brdf.h"
#include "simulator/samples/textured_spec.h"
#include "tools/scatter/grid_of.h"

namespace scatter::cli {
namespace {

using reflectance::Brdf;
using reflectance::GridBrdf;

std::map<std::string, std::string> metadata_of(const Brdf& brdf) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    return grid->content().metadata;
  }
  if (const auto* grid = dynamic_cast<const reflectance::SpecularGridBrdf*>(&brdf)) {
    return grid->content().metadata;
  }
  if (const auto* samples = dynamic_cast<const reflectance::ScatteredBrdf*>(&brdf)) {
    return samples->metadata();
  }
  return {};
}

/// Averaging and filling, one after the other, each on the result of the one before.
class GridSteps {
 public:
  explicit GridSteps(std::shared_ptr<const GridBrdf> grid) : grid_(std::move(grid)) {}

  Status run(const PreparationOptions& options, std::vector<std::string>& notes) {
    if (options.mirror) {
      auto done = reflectance::average_mirror_halves(*grid_);
      if (!done) {
        return std::unexpected(done.error());
      }
      notes.push_back(fmt::format("mirror halves averaged: {} nodes, {} of them had no value of their own",
                                  done->averaged + done->filled, done->filled));
      grid_ = std::make_shared<const GridBrdf>(std::move(done->grid));
    }
    if (options.reciprocal) {
      auto done = reflectance::average_reciprocal(*grid_, *grid_);
      if (!done) {
        return std::unexpected(done.error());
      }
      notes.push_back(fmt::format("exchanged directions averaged: {} nodes", done->averaged));
      grid_ = std::make_shared<const GridBrdf>(std::move(done->grid));
    }
    if (options.fill) {
      auto done = reflectance::fill_blind_spots(*grid_, grid_.get());
      if (!done) {
        return std::unexpected(done.error());
      }
      notes.push_back(
          fmt::format("blind spots filled: {} nodes by reciprocity, {} from their neighbours, {} left",
                      done->by_reciprocity, done->by_neighbors, done->left));
      grid_ = std::make_shared<const GridBrdf>(std::move(done->grid));
    }
    return {};
  }

  [[nodiscard]] std::shared_ptr<const GridBrdf> grid() const { return grid_; }

 private:
  std::shared_ptr<const GridBrdf> grid_;
};

}  // namespace

void add_preparation_options(CLI::App& app, PreparationOptions& options) {
  app.add_option(
      "--chain", options.chain,
      "Estimators beyond and between the data, for example bezier,guided,clamp; 'none' for the data "
      "alone (docs/interpolation.md)");
  app.add_flag("--mirror", options.mirror, "Average the halves beside the plane of incidence");
  app.add_flag("--reciprocal", options.reciprocal, "Average f(a to b) with f(b to a) where both are known");
  app.add_flag("--fill", options.fill, "Fill blind spots: by reciprocity, else from their neighbours");
}

Result<std::shared_ptr<const Brdf>> open_subject(const std::string& path_or_spec) {
  if (!simulator::is_textured_spec(path_or_spec)) {
    return formats::open_brdf(path_or_spec);
  }
  auto truth = simulator::SampleBrdf::make(path_or_spec);
  if (!truth) {
    return std::unexpected(truth.error());
  }
  return *truth;
}

Result<std::shared_ptr<const Brdf>> open_data(const std::string& path_or_spec) {
  auto opened = open_subject(path_or_spec);
  if (!opened) {
    return opened;
  }
  if (const auto* list = dynamic_cast<const formats::SampleListBrdf*>(opened->get())) {
    auto scattered = reflectance::ScatteredBrdf::make(list->samples());
    if (!scattered) {
      return std::unexpected(scattered.error());
    }
    return *scattered;
  }
  return opened;
}

std::string shown_name(const std::string& path_or_spec) {
  std::error_code error;
  return std::filesystem::exists(path_or_spec, error)
             ? std::filesystem::path(path_or_spec).filename().string()
             : path_or_spec;
}

Result<Prepared> prepare(std::shared_ptr<const Brdf> data, const PreparationOptions& options,
                         const std::string& default_chain) {
  Prepared prepared{.brdf = std::move(data), .metadata = {}, .theta_i = {}, .notes = {}};
  if (options.mirror || options.reciprocal || options.fill) {
    const bool was_grid = dynamic_cast<const GridBrdf*>(prepared.brdf.get()) != nullptr;
    auto metadata = metadata_of(*prepared.brdf);
    const auto grid = grid_of(*prepared.brdf, plot::incidences_of(*prepared.brdf));
    if (!grid) {
      return std::unexpected(grid.error());
    }
    if (!was_grid) {
      prepared.notes.emplace_back("put on a grid about the normal");
    }
    GridSteps steps(*grid);
    if (const auto done = steps.run(options, prepared.notes); !done) {
      return std::unexpected(done.error());
    }
    prepared.brdf = steps.grid();
    prepared.metadata = std::move(metadata);
  }
  for (auto& [key, value] : metadata_of(*prepared.brdf)) {
    prepared.metadata[key] = value;
  }
  prepared.theta_i = reflectance::extent_of(*prepared.brdf).theta_i;
  const std::string text = options.chain.value_or(default_chain);
  if (text.empty() || text == "none") {
    return prepared;
  }
  auto chain = reflectance::make_chain(prepared.brdf, text);
  if (!chain) {
    return std::unexpected(chain.error());
  }
  if (!chain->text.empty()) {
    prepared.brdf = chain->brdf;
    prepared.metadata["estimators"] = chain->text;
    prepared.notes.push_back("estimators: " + chain->text);
    for (const auto& [key, value] : chain->metadata) {
      prepared.metadata[key] = value;
      prepared.notes.push_back(fmt::format("{}: {}", key, value));
    }
  }
  return prepared;
}

}  // namespace scatter::cli
