// What an instrument of each profile says of itself: the descriptor it was certified with.
#pragma once

#include "protocol/descriptor.h"
#include "simulator/bench/bench.h"

namespace scatter::simulator {

/// Electrons per second of the white reference (the translucent one, from below) in the middle of
/// the image, for every illumination: 80 % of the full well in 2.5 ms.
inline constexpr double kReferenceRate_e_per_s = 3.2e6;
inline constexpr double kWhite_per_sr = 0.99 / reflectance::kPi;
inline constexpr double kBlack_per_sr = 0.012 / reflectance::kPi;
inline constexpr double kTranslucent_per_sr = 0.5 / reflectance::kPi;

/// Pixels of the sensor that one pixel of the frame sums, along each side.
[[nodiscard]] constexpr int binning(Profile profile) noexcept {
  return profile == Profile::kBinned ? 4 : 1;
}

/// The descriptor of an instrument without faults.
[[nodiscard]] protocol::Descriptor certified_descriptor(const BenchOptions& options, bool transmission);

}  // namespace scatter::simulator
