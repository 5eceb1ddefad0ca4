// The columns of a BiRD file as they stand there. Internal to the reader.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/reader_warnings.h"

namespace scatter::formats {

/// One variable. Numbers and states (words, Stokes vectors) never mix.
struct BirdColumn {
  std::string unit;
  std::vector<double> numbers;
  std::vector<std::uint8_t> states;  ///< Indices into BirdTable::states.
  std::string path;                  ///< Of the list in the file: "data.theta_i.values".
  std::string variable;              ///< B: the name of the column in the rows of `path`.
  std::size_t byte = 0;              ///< Where the list begins.
  std::size_t each = 1;              ///< C: rows that share one element,
  std::size_t count = 0;             ///< and elements, which come again and again; 0: no repeats.
  [[nodiscard]] std::size_t size() const noexcept { return numbers.size() + states.size(); }
  /// "data.theta_i.values[3] (list at byte 431)" of a row of the table.
  [[nodiscard]] std::string place(std::size_t row) const;
};

/// Generations B and C are brought into the shape of A: columns of equal length, named as in A.
struct BirdTable {
  std::map<std::string, BirdColumn> columns;
  std::vector<std::string> states;              ///< "p", "s", "u", "1 1 0 0"
  std::map<std::string, std::string> metadata;  ///< "bird.PATH", and ours.
  ReaderWarnings warnings;
};

/// Errors  as decode_bird_samples, most with the byte: syntax, nesting, keywords twice, columns of unequal
/// length.
[[nodiscard]] Result<BirdTable> read_bird_table(std::string_view text, std::string_view name);

}  // namespace scatter::formats
