#include "simulator/corrosion/event_picker.h"

#include <algorithm>

namespace scatter::corrosion {

WeightedPicker::WeightedPicker(const simulator::RandomKey& key, std::span<const std::uint16_t> weights)
    : key_(key), weights_(weights) {
  std::array<std::size_t, kLists> cells{};
  for (const std::uint16_t weight : weights) {
    if (weight != 0) {
      const auto list = static_cast<std::uint32_t>(std::bit_width(weight)) - 1;
      ++cells[list];
      largest_[list] = std::max<std::uint32_t>(largest_[list], weight);
      top_ = std::max(top_, list);
    }
  }
  lists_.reserve(kLists);
  for (const std::size_t count : cells) {
    lists_.emplace_back(count);
  }
  draw(0);
}

}  // namespace scatter::corrosion
