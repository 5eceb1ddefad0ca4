// The verifier of firmware images, if this build has one.
#pragma once

#include "firmware/ports/ports.h"

namespace scatter::firmware::mps2_an500 {

/// Null in a build without cryptography (SCATTER_BOOTLOADER=OFF): such firmware takes no update.
[[nodiscard]] Verifier* image_verifier() noexcept;

}  // namespace scatter::firmware::mps2_an500
