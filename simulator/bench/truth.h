// The true instrument: what its descriptor says, and how it really differs from that.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "protocol/descriptor.h"
#include "simulator/bench/bench.h"
#include "simulator/bench/light.h"
#include "simulator/bench/optics.h"

namespace scatter::simulator {

using ColourValues = std::array<double, kColours>;

/// True parameters. Planes are per pixel, row major.
struct Truth {
  LensParameters lens;
  std::vector<Head> heads;            ///< In the order of the descriptor's head numbers.
  std::vector<double> gain;           ///< Per illumination: e-/s per unit of L/E_perp [sr] where V = 1.
  ColourValues white_per_sr{};        ///< BRDF.
  ColourValues black_per_sr{};        ///< BRDF; it transmits nothing.
  ColourValues translucent_per_sr{};  ///< BTDF.
  double linearity = 0;
  double drift_phase = 0;

  std::vector<float> sensitivity;    ///< V times pixel gain [1]; 0 at blind spots, outside the image.
  std::vector<float> stray_e_per_s;  ///< Stray light with an LED of nominal output on.
  std::vector<float> leak_e_per_s;   ///< Ambient light under a sample with translucent = 1.
  std::vector<float> dark_e_per_s;   ///< At the reference temperature.
  std::vector<float> offset_dn;      ///< Black level and DSNU.

  std::vector<std::byte> hot_pixels;  ///< As object kHotPixels.
  std::vector<std::byte> gain_map;    ///< As object kPrnuMap.
};

/// Draws everything that belongs to the instrument itself from its seed.
[[nodiscard]] Truth draw_truth(const protocol::Descriptor& descriptor, const BenchOptions& options);

}  // namespace scatter::simulator
