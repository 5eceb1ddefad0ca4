// The files that a piece of weathered copper is written as.
#pragma once

#include <filesystem>
#include <stop_token>

#include "host_sdk/images/image.h"
#include "simulator/corrosion/patina/look.h"

namespace scatter::cli {

/// Writes height.exr [um above the metal's plane], tarnish.exr and patina.exr [um], albedo.exr (of the whole,
/// layers over metal), metalness.exr, roughness.exr, normal.png and preview.png into `folder`, which exists.
/// docs/patina.md says what is in each.
/// Returns   the preview, linear.
/// Errors    of the disk; kAborted when stopped between two files.
[[nodiscard]] Result<images::Image> write_patina(const corrosion::LayerStack& layers,
                                                 const corrosion::PatinaLookOptions& options,
                                                 const std::filesystem::path& folder,
                                                 const std::stop_token& stop);

/// Seen from straight above: a bright sky and a sun from the upper left; metal mirrors the sky, layers
/// scatter both. Relief is drawn `kReliefInPreview` times steeper than it is, which is far too little to be
/// seen. Shape     side x side, RGB, linear.
[[nodiscard]] images::Image patina_picture(const corrosion::Appearance& look, const corrosion::Rgb& metal);
inline constexpr float kReliefInPreview = 4;

}  // namespace scatter::cli
