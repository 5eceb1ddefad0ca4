// Channels of the analytic models: three, at the wavelengths of the instrument's red, green and blue LEDs.
#pragma once

#include <array>
#include <cstddef>

namespace scatter::reflectance {

inline constexpr std::size_t kModelChannels = 3;
inline constexpr std::array<float, kModelChannels> kModelWavelengthsNm{630.0F, 525.0F, 465.0F};

/// One parameter value per channel.
using ChannelValues = std::array<double, kModelChannels>;

[[nodiscard]] constexpr ChannelValues uniform(double value) noexcept {
  return {value, value, value};
}

}  // namespace scatter::reflectance
