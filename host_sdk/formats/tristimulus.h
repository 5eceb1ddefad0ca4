// Linear BT.709 colour (ours) to CIE XYZ and back. Internal to formats.
#pragma once

#include <array>
#include <cstddef>

namespace scatter::formats {

/// Rows X, Y, Z over R, G, B; white D65, so that R = G = B = 1 is (0.9505, 1, 1.0888).
/// Source  ITU-R BT.709-6 item 1.4 primaries and white, SMPTE RP 177 normalisation, as rounded in
///         IEC 61966-2-1. The inverse is computed, so that there and back is exact.
inline constexpr std::array<std::array<double, 3>, 3> kXyzFromRgb{
    {{0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}}};

/// Inverse of a 3 x 3 matrix that has one (adjugate over determinant).
[[nodiscard]] constexpr std::array<std::array<double, 3>, 3> inverse(
    const std::array<std::array<double, 3>, 3>& m) noexcept {
  std::array<std::array<double, 3>, 3> out{};
  double determinant = 0;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t r1 = (r + 1) % 3;
      const std::size_t r2 = (r + 2) % 3;
      const std::size_t c1 = (c + 1) % 3;
      const std::size_t c2 = (c + 2) % 3;
      out[c][r] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
      determinant += r == 0 ? m[0][c] * out[c][0] : 0;
    }
  }
  for (auto& row : out) {
    for (double& value : row) {
      value /= determinant;
    }
  }
  return out;
}
inline constexpr std::array<std::array<double, 3>, 3> kRgbFromXyz = inverse(kXyzFromRgb);

/// Three planes of values at once: out[r] = sum of matrix[r][c] in[c], in place.
template <typename Plane>
void transform(const std::array<std::array<double, 3>, 3>& matrix, Plane& a, Plane& b, Plane& c) {
  using Value = Plane::value_type;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const std::array<double, 3> in{static_cast<double>(a[k]), static_cast<double>(b[k]),
                                   static_cast<double>(c[k])};
    const auto row = [&](std::size_t r) {
      return static_cast<Value>(matrix[r][0] * in[0] + matrix[r][1] * in[1] + matrix[r][2] * in[2]);
    };
    a[k] = row(0);
    b[k] = row(1);
    c[k] = row(2);
  }
}

}  // namespace scatter::formats
