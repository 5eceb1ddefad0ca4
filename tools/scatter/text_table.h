// Columns of text that line up.
#pragma once

#include <string>
#include <vector>

namespace scatter::cli {

/// Rows of cells, two blanks between columns, one line each; counts code points, not bytes. The last
/// cell of a row may be long.
[[nodiscard]] std::string text_table(const std::vector<std::vector<std::string>>& rows,
                                     const std::string& indent = "");

/// Values with blanks between, each with `digits` decimals.
[[nodiscard]] std::string numbers(const std::vector<double>& values, int digits);

}  // namespace scatter::cli
