// scatter inspect FILE|SPEC: metadata, albedo, energy, reciprocity, coverage.
#include <CLI/CLI.hpp>
#include <memory>

#include "tools/scatter/file_description.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

Verb add_inspect(CLI::App& root) {
  auto* app = root.add_subcommand(
      "inspect",
      "Show what is in a file: metadata, albedo, energy, reciprocity, coverage; or in a recording");
  auto target = std::make_shared<std::string>();
  app->add_option("file", *target, "File, or a model such as ggx:alpha=0.2,f0=0.04,albedo=0.3")->required();
  return {app, [target](const Context&) { return describe_file(*target); }};
}

}  // namespace scatter::cli
