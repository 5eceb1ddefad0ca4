// The columns of a BiRD file as they stand there. Internal to the reader.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::formats {

/// One variable. Numbers and states (words, Stokes vectors) never mix.
struct BirdColumn {
  std::string unit;
  std::vector<double> numbers;
  std::vector<std::uint8_t> states;  ///< Indices into BirdTable::states.
  [[nodiscard]] std::size_t size() const noexcept { return numbers.size() + states.size(); }
};

/// Generations B and C are brought into the shape of A: columns of equal length, named as in A.
struct BirdTable {
  std::map<std::string, BirdColumn> columns;
  std::vector<std::string> states;              ///< "p", "s", "u", "1 1 0 0"
  std::map<std::string, std::string> metadata;  ///< "bird.PATH", and ours.
};

/// Errors  as decode_bird_samples: syntax, nesting, keywords twice, columns of unequal length.
[[nodiscard]] Result<BirdTable> read_bird_table(std::string_view text, std::string_view name);

}  // namespace scatter::formats
