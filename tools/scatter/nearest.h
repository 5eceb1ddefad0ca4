// "Did you mean": the name that a mistyped word was most likely meant to be.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scatter::cli {

/// Levenshtein distance: fewest insertions, deletions and replacements of bytes.
[[nodiscard]] inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) {
    row[j] = j;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t above = row[j + 1];
      row[j + 1] = std::min({above + 1, row[j] + 1, diagonal + (a[i] == b[j] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row.back();
}

/// "'measure'" when one name is at most 3 edits (and less than its length) away, else all of them.
[[nodiscard]] inline std::string nearest_or_all(std::string_view word, std::span<const std::string> names) {
  const auto best = std::ranges::min_element(
      names, {}, [&](const std::string& candidate) { return edit_distance(word, candidate); });
  if (best != names.end() && edit_distance(word, *best) <= std::min<std::size_t>(3, best->size() - 1)) {
    return "'" + *best + "'";
  }
  std::string all = "one of";
  for (const std::string& candidate : names) {
    all += " " + candidate;
  }
  return all;
}

}  // namespace scatter::cli
