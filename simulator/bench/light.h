// The light of one source head, off the sample, as each pixel collects it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "simulator/bench/optics.h"
#include "simulator/samples/aspect.h"

namespace scatter::simulator {

/// Source head as the sample sees it: a uniform disc.
struct Head {
  reflectance::Direction towards;  ///< Its middle, instrument's frame.
  double angular_radius_rad = 0;
};

/// One value per pixel and colour; pixels beyond the image are 0.
/// Quantity  L_o / E_perp [1/sr], see Aspect, averaged over the source's disc and the pixel's area.
using LightImage = std::array<std::vector<float>, kColours>;

/// How finely `integrate` works.
enum class Fineness : std::uint8_t {
  kAdaptive,  ///< As the surface needs: relative error below 5e-4 for lobes of alpha >= 0.05.
  kFinest,    ///< 48 source points x 16 pixel points everywhere: slow, for tests.
};

/// Threads   uses oneTBB over rows; the result does not depend on the number of threads.
/// Cost      0.1 to 0.4 s of processor time for 480 x 480.
[[nodiscard]] LightImage integrate(const Lens& lens, std::size_t width, std::size_t height, const Head& head,
                                   const Aspect& aspect, Fineness fineness = Fineness::kAdaptive);

/// Mean of cos(theta_i) over the source's disc, on a surface whose normal is z or -z.
[[nodiscard]] double mean_cosine(const Head& head) noexcept;

}  // namespace scatter::simulator
