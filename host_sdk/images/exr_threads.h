// How many threads OpenEXR packs and unpacks with. For images and formats.
#pragma once

namespace scatter::images {

/// OpenEXR has one pool of threads for the whole process and starts with none: the first call gives
/// it one per core, at most 16. Whoever has set a number before is left alone.
[[nodiscard]] int exr_threads();

}  // namespace scatter::images
