// The model families that can be fitted, by name.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::reflectance {

/// What lies under the lobes. The coefficient is the albedo, one per channel, 0..1.
enum class FitBase : std::uint8_t { kLambert, kOrenNayar };

/// Lobes. One shape parameter each, shared by all channels, and one coefficient per channel:
///   kGgx, kBeckmann, kCookTorrance  alpha (0.001..1; Cook-Torrance: m) and F0 (0..1), Schlick Fresnel
///   kWard                           alpha (0.001..1) and k_s (0..1), no Fresnel
///   kLafortune                      exponent n (0.5..1e5) and k_s (0..1), no Fresnel
/// Of two lobes with Fresnel each also has a weight 0..1, shared by all channels.
enum class FitLobe : std::uint8_t { kGgx, kBeckmann, kCookTorrance, kWard, kLafortune };

/// Models that are no sum of base and lobes.
enum class FitWhole : std::uint8_t {
  kNone,
  kDisney,  ///< 2012, with base colour, metallic, roughness and specular.
  /// glTF 2.0 (specification, appendix B) with KHR_materials_ior and KHR_materials_specular: base
  /// colour, metallic, roughness, specular (factor) and f0 of the dielectric.
  kGltf,
  /// The same with specular = 1: what engines and converters that know metallic, roughness and F0
  /// have in common.
  kMetallicRoughness,
};

/// Base plus at most two lobes, or a whole model.
struct FitFamily {
  FitBase base = FitBase::kLambert;
  std::vector<FitLobe> lobes = {};
  FitWhole whole = FitWhole::kNone;  ///< Unless kNone, base and lobes do not apply.

  friend bool operator==(const FitFamily&, const FitFamily&) = default;
};

/// "ggx", "oren-nayar+ward", "ggx2", "lambert+ggx+ward", "lambert", "oren-nayar": an optional base
/// (Lambert when none is named) and up to two of ggx, beckmann, cook-torrance, ward, lafortune; a 2
/// behind a lobe doubles it. Or a whole model: "disney", "gltf", "metallic-roughness".
/// Errors    kInvalidArgument naming the word and what there is.
[[nodiscard]] Result<FitFamily> fit_family(std::string_view name);

/// Shortest name that fit_family reads back.
[[nodiscard]] std::string name(const FitFamily& family);

/// Those that `select_model` tries when nobody says otherwise, simplest first.
[[nodiscard]] std::vector<FitFamily> default_families();

}  // namespace scatter::reflectance
