// Planes of a square sheet as images.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "host_sdk/images/image.h"

namespace scatter::cli {

/// One value per cell. Shape     values.size() == side * side, row major, first row at the top.
[[nodiscard]] inline images::Image grey_image(std::size_t side, std::vector<float> values) {
  return {.width = side, .height = side, .channels = 1, .values = std::move(values)};
}

/// Three values per cell: colours or vectors. Shape     side * side arrays of three floats, ordered alike.
template <typename Triples>
[[nodiscard]] images::Image triple_image(std::size_t side, const Triples& values) {
  images::Image image{.width = side, .height = side, .channels = 3, .values = {}};
  image.values.reserve(values.size() * 3);
  for (const auto& value : values) {
    image.values.insert(image.values.end(), value.begin(), value.end());
  }
  return image;
}

}  // namespace scatter::cli
