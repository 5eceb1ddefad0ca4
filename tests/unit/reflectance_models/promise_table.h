// The table of docs/models.md that says which model promises what: the tests hold each row to it.
#pragma once

#include <array>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace scatter::reflectance::test {

inline constexpr std::array kAlbedoDegrees{0.0, 30.0, 60.0, 75.0, 85.0};

/// Nothing where the table refers elsewhere.
struct Promise {
  std::string spec;
  std::optional<bool> reciprocal;
  std::optional<bool> conserving;
  std::optional<bool> draws_lost;
  std::vector<double> albedo;  ///< Green, at kAlbedoDegrees.
};

inline std::vector<Promise> promise_table() {
  std::vector<Promise> out;
  std::ifstream file("docs/models.md");
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("| example |")) {
      inside = true;
    } else if (inside && !line.starts_with("|")) {
      break;
    } else if (inside && line.starts_with("| `")) {
      std::vector<std::string> cells;
      for (std::size_t at = 2; at < line.size();) {
        const std::size_t end = line.find(" |", at);
        cells.push_back(line.substr(at, end - at));
        at = end + 3;
      }
      const auto answer = [](const std::string& text) {
        return text == "yes" || text == "some"  ? std::optional(true)
               : text == "no" || text == "none" ? std::optional(false)
                                                : std::nullopt;
      };
      out.push_back({cells.at(0).substr(1, cells[0].size() - 2),
                     answer(cells.at(1)),
                     answer(cells.at(2)),
                     answer(cells.at(3)),
                     {}});
      for (std::size_t k = 0; k < kAlbedoDegrees.size(); ++k) {
        out.back().albedo.push_back(std::stod(cells.at(4 + k)));
      }
    }
  }
  return out;
}

}  // namespace scatter::reflectance::test
