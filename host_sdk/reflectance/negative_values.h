// Values below 0: a BRDF cannot have them, files do.
#pragma once

#include <cstddef>

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/scattered_samples.h"

namespace scatter::reflectance {

struct NegativeValues {
  std::size_t count = 0;    ///< Values below 0, all channels.
  std::size_t of = 0;       ///< Values looked at: those that are not invalid.
  double least = 0;         ///< Most negative one [1/sr]; of an AdaptiveBrdf as its table holds it.
  bool count_as_0 = false;  ///< `eval` answers 0 for them.
};

/// Of the values that a grid or an AdaptiveBrdf stores (its nodes that are not valid do not count). For
/// everything else, which stores no f, nothing is looked at (`of` is 0).
[[nodiscard]] NegativeValues negative_values(const Brdf& brdf);

/// Of all samples that are not kInvalid.
[[nodiscard]] NegativeValues negative_values(const ScatteredSamples& samples);

}  // namespace scatter::reflectance
