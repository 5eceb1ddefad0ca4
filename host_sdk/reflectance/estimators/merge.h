// Several files of one sample, one per colour, made into one.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// One channel of the result.
struct MergeSource {
  std::shared_ptr<const Brdf> brdf;
  std::size_t channel = 0;  ///< Of brdf.
  std::string name;         ///< "red"; for messages and metadata.
};

struct Merged {
  std::shared_ptr<const Brdf> brdf;  ///< Of the sources' kind.
  std::size_t points = 0;            ///< Nodes or places in the result.
  std::size_t estimated = 0;  ///< Values (per source) that a source did not have and default_chain gave.
  std::size_t dropped = 0;    ///< Places of scattered samples that some source has no estimate for.
};

/// The union of all points of all sources; where a source has no point, its default_chain answers.
///
/// Kinds     all GridBrdf: incidences of all sources, the finest steps of any and the largest theta_o of any.
///           All SpecularGridBrdf: the union of each axis. All ScatteredBrdf: the union of their places.
/// Values    a source's own points come through unchanged.
/// Origin    of a point: the worst of its channels; an estimate is at least kInterpolated.
/// Uncertainty  kept when every source has them.
/// Metadata  what all sources agree on under its own key; the rest as "red.key"; plus "merged_from".
/// Wavelengths  of the chosen channels, when every source knows its own.
/// Errors    kInvalidArgument: fewer than two sources, a channel that is not there, different kinds or types;
///           kFailedPrecondition: no common place of scattered samples.
/// Source    thesis 6.1.2.
[[nodiscard]] Result<Merged> merge_channels(std::span<const MergeSource> sources);

}  // namespace scatter::reflectance
