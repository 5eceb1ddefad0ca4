// A corroded sheet as people see it.
#pragma once

#include <cstddef>

#include "host_sdk/images/image.h"
#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::cli {

/// Seen from straight above under a low sun from the upper left and a bright sky: metal mirrors the sky, rust
/// scatters both, holes are dark. Relief by normals, cast shadows and the sky that hollows do not see. A
/// picture to judge the sheet by, not a measurement: the sky is made up, and there is no light from the sheet
/// to itself. Shape     side x side, RGB, linear.
[[nodiscard]] images::Image lit_picture(const corrosion::Sheet& sheet, const corrosion::Appearance& look);

/// Metal (176, 184, 192), rust (200, 90, 20) and holes (0, 0, 0) of 255, to be stored as they are.
[[nodiscard]] images::Image regime_picture(const corrosion::Appearance& look);

/// Share of the sky that each cell sees, 0..1, estimated from how far it lies below its surroundings at two
/// distances (0.4 and 1.6 times the thickness). Shape     side x side, grey.
[[nodiscard]] images::Image sky_share(const corrosion::Sheet& sheet);

/// Smaller by the mean over the area of each new pixel; an image that is small enough comes back as it is.
[[nodiscard]] images::Image scaled_down(const images::Image& image, std::size_t longest_side);

}  // namespace scatter::cli
