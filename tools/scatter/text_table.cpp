#include "tools/scatter/text_table.h"

#include <fmt/format.h>

#include <algorithm>

namespace scatter::cli {
namespace {

std::size_t width_of(const std::string& text) {
  return std::size_t(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

}  // namespace

std::string text_table(const std::vector<std::vector<std::string>>& rows, const std::string& indent) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t k = 0; k + 1 < row.size(); ++k) {
      widths[k] = std::max(widths[k], width_of(row[k]));
    }
  }
  std::string text;
  for (const auto& row : rows) {
    text += indent;
    for (std::size_t k = 0; k < row.size(); ++k) {
      text += row[k];
      if (k + 1 < row.size()) {
        text.append(widths[k] - width_of(row[k]) + 2, ' ');
      }
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  }
  return text;
}

std::string numbers(const std::vector<double>& values, int digits) {
  std::string text;
  for (const double value : values) {
    text += fmt::format("{}{:.{}f}", text.empty() ? "" : " ", value, digits);
  }
  return text;
}

}  // namespace scatter::cli
