// The mirror's (Dirac) share of a BRDF, which no file of values in 1/sr can hold. Internal to formats.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::formats {

/// Albedo of the Dirac component, largest channel.
struct DiracShare {
  double least = 0;  ///< Over the incidences [1].
  double most = 0;   ///< Likewise [1].
};

/// Nothing where there is none at any of these incidences.
[[nodiscard]] std::optional<DiracShare> dirac_share(const reflectance::Brdf& brdf,
                                                    std::span<const reflectance::Direction> omega_i);

/// Errors  kFailedPrecondition: a Dirac component and not one value beside it, so a file would be empty.
[[nodiscard]] Status check_not_dirac_alone(const reflectance::Brdf& brdf, std::string_view format);

}  // namespace scatter::formats
