// BiRD JSON: a flat list of values with their angles, in three generations (docs/formats.md).
//
// A (schema v1.0): {"metadata": {...}, "data": {"theta_i": {"unit", "values": []}, ...}}.
// B (2021): data.variables[] (name, unit) and data.values[][], one row per value.
// C (2018-19): {"head", "data": {"wavelengths", "theta_i", "phi_i", "theta_v", "phi_v", "pol",
// "data": [wavelength][sample]}}, degrees.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/scattered_samples.h"

namespace scatter::formats {

/// Values gathered by geometry, in the order of the file. Wavelengths are the channels. Of several
/// polarizations "u" counts where it is there, else the mean of all at a geometry (metadata
/// "polarization"). uBRDF is taken as systematic: a total does not average away. theta < 0 is the
/// other side: phi + 180. A geometry that lacks a channel is kInvalid (metadata "notes"). The file's
/// metadata become "bird.PATH", what our writer put there gets its own keys back.
/// Wavelengths are 100..1000000 nm. Metadata that schema v1.0 requires and generation A lacks are
/// told in the metadata "warnings".
/// Errors  kDataLoss: byte, or field, index and the byte where its list begins; expected, found.
///         kInvalidArgument: JSON, but no BiRD. kUnimplemented: metadata.type BTDF and the like.
/// Cost    memory in proportion to the text, about 30 bytes per value; nesting up to 64 levels.
[[nodiscard]] Result<reflectance::ScatteredSamples> decode_bird_samples(std::string_view text,
                                                                        std::string_view name);

/// The same as a GridBrdf where the angles of every incidence make a grid about the normal: gaps up
/// to 20 deg in theta and 45 deg in phi, half of the nodes there; between uneven nodes kInterpolated,
/// missing ones kInvalid. Else as a SampleListBrdf. One incidence angle with several azimuths means
/// that the sample was rotated.
[[nodiscard]] Result<std::shared_ptr<const reflectance::Brdf>> decode_bird(std::string_view text,
                                                                           std::string_view name);

/// Generation A: every valid node or sample, uncertainties, origins, and all metadata (in
/// metadata.adhoc_section). The time stamp is that of the metadata ("created" or
/// "bird.timestamp"), else 1970: writers look at no clock.
/// Errors  kInvalidArgument: BTDF, for which BiRD has no place.
[[nodiscard]] Result<std::string> encode_bird(const reflectance::Brdf& brdf,
                                              const EncodeOptions& options = {});

}  // namespace scatter::formats
