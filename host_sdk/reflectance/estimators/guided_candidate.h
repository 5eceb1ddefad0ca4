// The single ways of interpolating between incidences from which the guided one is mixed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace scatter::reflectance {

/// Which outgoing directions of two incidences belong together.
enum class Alignment : std::uint8_t {
  kPlain,     ///< The same theta_o and phi_o - phi_i.
  kSpecular,  ///< The same angles about the mirror direction.
  kHalf,      ///< The same half vector: microfacets, flakes and lobes stay where they are.
};
inline constexpr std::size_t kAlignments = 3;

/// What is interpolated in theta_i.
enum class Joint : std::uint8_t {
  kValue,     ///< f itself, linear.
  kLog,       ///< ln(f / model), linear.
  kLogCubic,  ///< ln(f / model), Lagrange through four incidences, held near its two neighbours.
};

/// One way: the model (index into the guides; 0 is the constant 1), the alignment and the joint.
struct GuidedCandidate {
  std::size_t guide = 0;
  Alignment alignment = Alignment::kSpecular;
  Joint joint = Joint::kLog;
};

[[nodiscard]] constexpr std::string_view name(Alignment alignment) noexcept {
  switch (alignment) {
    case Alignment::kPlain:
      return "plain";
    case Alignment::kSpecular:
      return "specular";
    case Alignment::kHalf:
      return "half-vector";
  }
  return "unknown";
}

[[nodiscard]] constexpr std::string_view name(Joint joint) noexcept {
  switch (joint) {
    case Joint::kValue:
      return "linear";
    case Joint::kLog:
      return "log-linear";
    case Joint::kLogCubic:
      return "log-cubic";
  }
  return "unknown";
}

}  // namespace scatter::reflectance
