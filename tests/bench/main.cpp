// scatter_bench [NAME] [--json FILE] [--list]: a table on standard output, and the same as JSON.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/bench/registry.h"

namespace {

using scatter::bench::Entry;
using scatter::bench::Figure;

void print_line(const Figure& figure) {
  fmt::print("{:<34} {:>12.4g} {:<12} {:>12.4g} {:>7.2f}  {}\n", figure.name, figure.value, figure.unit,
             figure.peer_value, figure.ratio, figure.peer);
  std::fflush(stdout);
}

bool write_json(const std::string& path, const std::vector<Figure>& figures) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Figure& figure : figures) {
    list.push_back({{"name", figure.name},
                    {"value", figure.value},
                    {"unit", figure.unit},
                    {"peer", figure.peer},
                    {"peer_value", figure.peer_value},
                    {"ratio", figure.ratio}});
  }
  std::ofstream file(path);
  file << list.dump(2) << '\n';
  file.close();
  return !file.fail();
}

}  // namespace

int main(int argc, char** argv) {
  std::string name;
  std::string json_path;
  bool list_only = false;
  CLI::App app("Benchmarks: ours against a peer. Ratio above 1 means that ours is better.", "scatter_bench");
  app.add_option("name", name, "run those whose name begins so; all by default");
  app.add_option("--json", json_path, "also write the figures to this file");
  app.add_flag("--list", list_only, "print the names and run nothing");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::vector<Entry> chosen;
  for (const Entry& entry : scatter::bench::registry()) {
    if (entry.name.starts_with(name)) {
      chosen.push_back(entry);
    }
  }
  std::sort(chosen.begin(), chosen.end(), [](const Entry& a, const Entry& b) { return a.name < b.name; });
  if (chosen.empty()) {
    fmt::print(stderr, "error: no benchmark's name begins with \"{}\"\nremedy: see scatter_bench --list\n",
               name);
    return 2;
  }
  if (list_only) {
    for (const Entry& entry : chosen) {
      fmt::print("{}\n", entry.name);
    }
    return 0;
  }
  fmt::print("{:<34} {:>12} {:<12} {:>12} {:>7}  {}\n", "name", "ours", "unit", "peer's", "ratio", "peer");
  std::vector<Figure> figures;
  for (const Entry& entry : chosen) {
    const std::vector<Figure> results = entry.run();
    for (const Figure& figure : results) {
      print_line(figure);
    }
    figures.insert(figures.end(), results.begin(), results.end());
  }
  if (!json_path.empty() && !write_json(json_path, figures)) {
    fmt::print(stderr,
               "error: {} could not be written\nremedy: name a file in a folder that exists and has space\n",
               json_path);
    return 1;
  }
  return 0;
}
