// Where axis and legend marks stand, and what is written beside them.
#pragma once

#include <string>
#include <vector>

namespace scatter::plot {

enum class Scale { kAuto, kLog, kLinear };

/// An axis: values low..high (low < high; low > 0 when logarithmic).
struct Axis {
  double low = 0;
  double high = 1;
  bool log = false;

  /// Position of a value, 0 at low, 1 at high; not clamped. Logarithmic: values <= 0 give a large
  /// negative number.
  [[nodiscard]] double place(double value) const noexcept;
};

struct Tick {
  double value = 0;
  std::string label;  ///< Empty for a minor mark.
};

/// Axis for values in [smallest, largest]: kAuto is logarithmic when both are positive and their ratio
/// exceeds 5. A logarithmic axis spans at most 6 decades below the largest value; a linear one starts at
/// zero, or at a rounded negative number. Never empty, whatever the input.
[[nodiscard]] Axis choose_axis(double smallest, double largest, Scale scale);

/// About `wanted` labelled marks at 1, 2 or 5 times a power of ten (linear), or at the powers of ten
/// with minor marks between (logarithmic; labels at 2 and 5 as well when there are few decades).
[[nodiscard]] std::vector<Tick> ticks(const Axis& axis, int wanted);

/// "20°" of an angle in radians, to a thousandth of a degree.
[[nodiscard]] std::string angle_text(double angle_rad);

/// Short text of a number: 0.02, 150, 3×10⁻⁵.
[[nodiscard]] std::string short_number(double value);

}  // namespace scatter::plot
