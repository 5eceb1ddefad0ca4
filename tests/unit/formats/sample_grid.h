// A small grid with every kind of content that the files must carry.
#pragma once

#include <cmath>
#include <cstdint>

#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats::test {

inline reflectance::GridBrdf sample_grid(std::size_t theta_count = 16, std::size_t phi_count = 24,
                                         std::size_t channels = 3) {
  using namespace reflectance;
  GridBrdf::Content content;
  content.channels = channels;
  content.theta_count = theta_count;
  content.phi_count = phi_count;
  content.theta_step = kPi / 2 / static_cast<double>(theta_count + 2);
  content.phi_step = 2 * kPi / static_cast<double>(phi_count);
  for (std::size_t c = 0; c < channels; ++c) {
    content.wavelengths_nm.push_back(630.0F - 80.5F * static_cast<float>(c));
  }
  content.metadata = {{"calibration_id", "0011"}, {"software", "test"}, {"quality", "{\"a\": [1, 2]}\nline"}};
  std::uint32_t state = 1;
  const auto next = [&state] {
    state = state * 1664525U + 1013904223U;
    return static_cast<float>(state >> 8) / 16777216.0F;
  };
  for (const double theta_i : {0.0, 20.031, 40.0}) {
    GridPart part;
    part.theta_i = radians(theta_i);
    part.phi_i = radians(theta_i == 40 ? 12.345 : 0);
    const std::size_t nodes = theta_count * phi_count;
    for (std::size_t c = 0; c < channels; ++c) {
      auto& f = part.f_per_sr.emplace_back(nodes);
      auto& random = part.random_per_sr.emplace_back(nodes);
      auto& systematic = part.systematic_per_sr.emplace_back(nodes);
      for (std::size_t n = 0; n < nodes; ++n) {
        f[n] = next() - 0.01F;
        random[n] = 0.01F * next();
        systematic[n] = 0.001F * next();
      }
    }
    for (std::size_t n = 0; n < nodes; ++n) {
      part.pixels.push_back(10 * next());
      part.origin.push_back(static_cast<Origin>(n % 4));
    }
    part.f_per_sr[0][4] = std::nanf("7");  // node 4 is invalid: its number means nothing, and is kept
    content.parts.push_back(std::move(part));
  }
  return GridBrdf::make(std::move(content)).value();
}

}  // namespace scatter::formats::test
