// Node values of grids as interpolation reads them: every channel of a node side by side, and for
// every cell what its four nodes are worth.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// Blocks (one per incidence) of rows x columns nodes. The grids add what makes every cell whole:
/// the first column again after the last one where azimuths wrap, the last row again.
///
/// Memory   4 bytes times node_floats() per node: 16 for three channels, 8 for one.
class CellTable {
 public:
  /// How bad an origin is, such that the worst of several is their bitwise or: measured 0,
  /// interpolated 1, extrapolated 3, invalid 7. A cell's code is the or of its four nodes' codes, and
  /// kMixed where these are not alike.
  static constexpr std::int32_t kMixed = 8;
  static constexpr std::int32_t kBetween = 1;  ///< Interpolated or worse.
  static constexpr std::int32_t kOutside = 3;  ///< Extrapolated.
  static constexpr std::int32_t kNothing = 7;  ///< Invalid.

  CellTable() = default;
  /// All values 0 and invalid.
  CellTable(std::size_t channels, std::size_t blocks, std::size_t rows, std::size_t columns);

  [[nodiscard]] std::size_t channels() const noexcept { return channels_; }
  [[nodiscard]] std::size_t columns() const noexcept { return columns_; }
  [[nodiscard]] std::size_t nodes_per_block() const noexcept { return rows_ * columns_; }
  /// Floats from a node to the next: the channels, unused ones, and the code of the cell whose
  /// first node this is. A multiple of 4 unless there is one channel (then 2).
  [[nodiscard]] static constexpr std::size_t node_floats(std::size_t channels) noexcept {
    return channels == 1 ? 2 : (channels + 4) / 4 * 4;
  }
  [[nodiscard]] std::size_t node_floats() const noexcept { return node_floats_; }
  [[nodiscard]] const float* data() const noexcept { return values_.data(); }

  [[nodiscard]] std::size_t index(std::size_t block, std::size_t row, std::size_t column) const noexcept {
    return (block * rows_ + row) * columns_ + column;
  }
  void set(std::size_t index, std::size_t channel, float value) noexcept {
    values_[index * node_floats_ + channel] = value;
  }
  void set_origin(std::size_t index, Origin origin) noexcept { set_code(index, code_of(origin)); }
  void copy_node(std::size_t from, std::size_t to) noexcept;
  /// Turns the origins of nodes into the codes of cells; once, after all nodes are set.
  void close_cells() noexcept;

  [[nodiscard]] static constexpr std::int32_t code_of(Origin origin) noexcept {
    return origin == Origin::kInvalid ? kNothing : (1 << (static_cast<int>(origin) - 1)) - 1;
  }
  /// For a code without kMixed.
  [[nodiscard]] static constexpr Origin origin_of(std::int32_t code) noexcept {
    // In bytes, from code 0: measured, interpolated, -, extrapolated, -, -, -, invalid.
    constexpr std::uint64_t kOrigins = 0x0000000003030201;
    return static_cast<Origin>((kOrigins >> (8 * code)) & 0xff);
  }
  /// The code stored with a cell's first node; first points at that node's values.
  [[nodiscard]] static std::int32_t code_at(const float* first, std::size_t node_floats) noexcept {
    return std::bit_cast<std::int32_t>(first[node_floats - 1]) & (kMixed | kNothing);
  }

 private:
  void set_code(std::size_t index, std::int32_t code) noexcept {
    // As the last bits of a number near 2: arithmetic on the unused lane stays fast, as it would not on
    // denormal numbers.
    values_[(index + 1) * node_floats_ - 1] = std::bit_cast<float>(0x40000000 | code);
  }

  std::size_t channels_ = 0;
  std::size_t rows_ = 0;
  std::size_t columns_ = 0;
  std::size_t blocks_ = 0;
  std::size_t node_floats_ = 0;
  std::vector<float> values_;
};

}  // namespace scatter::reflectance
