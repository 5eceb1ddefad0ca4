#include "host_sdk/reflectance/cell_table.h"

#include <algorithm>

namespace scatter::reflectance {

CellTable::CellTable(std::size_t channels, std::size_t blocks, std::size_t rows, std::size_t columns)
    : channels_(channels),
      rows_(rows),
      columns_(columns),
      blocks_(blocks),
      node_floats_(node_floats(channels)),
      values_(blocks * rows * columns * node_floats_, 0.0F) {
  for (std::size_t n = 0; n < blocks * rows * columns; ++n) {
    set_origin(n, Origin::kInvalid);
  }
}

void CellTable::copy_node(std::size_t from, std::size_t to) noexcept {
  std::copy_n(values_.begin() + static_cast<std::ptrdiff_t>(from * node_floats_), node_floats_,
              values_.begin() + static_cast<std::ptrdiff_t>(to * node_floats_));
}

void CellTable::close_cells() noexcept {
  for (std::size_t b = 0; b < blocks_; ++b) {
    for (std::size_t j = 0; j + 1 < rows_; ++j) {
      for (std::size_t i = 0; i + 1 < columns_; ++i) {
        // In ascending order, so that the three further nodes still hold their own codes.
        const std::size_t n = index(b, j, i);
        std::int32_t all = kNothing;
        std::int32_t any = 0;
        for (const std::size_t corner : {n, n + 1, n + columns_, n + columns_ + 1}) {
          const std::int32_t code = code_at(&values_[corner * node_floats_], node_floats_);
          all &= code;
          any |= code;
        }
        set_code(n, all == any ? any : any | kMixed);
      }
    }
  }
}

}  // namespace scatter::reflectance
