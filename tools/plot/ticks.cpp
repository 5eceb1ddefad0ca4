#include "tools/plot/ticks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace scatter::plot {
namespace {

std::string superscript(int number) {
  static constexpr const char* kDigits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = number < 0 ? "⁻" : "";
  for (const char digit : std::to_string(std::abs(number))) {
    text += kDigits[digit - '0'];
  }
  return text;
}

double nice_step(double span, int wanted) {
  const double raw = span / std::max(1, wanted);
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw * 0.999) {
      return factor * power;
    }
  }
  return 10 * power;
}

}  // namespace

double Axis::place(double value) const noexcept {
  if (!log) {
    return (value - low) / (high - low);
  }
  return value > 0 ? std::log(value / low) / std::log(high / low) : -1e3;
}

Axis choose_axis(double smallest, double largest, Scale scale) {
  if (!std::isfinite(smallest) || !std::isfinite(largest) || largest < smallest) {
    return {0, 1, false};
  }
  const bool can_log = largest > 0 && std::isfinite(std::log(largest));
  const bool log =
      can_log && (scale == Scale::kLog || (scale == Scale::kAuto && smallest > 0 && largest > 5 * smallest));
  if (log) {
    constexpr double kDecades = 6;
    double low = std::max(smallest, largest * std::pow(10.0, -kDecades));
    if (!(low < largest / 1.5)) {
      low = largest / 10;
    }
    return {low, largest, true};
  }
  const double low = std::min(0.0, smallest);
  double high = std::max(0.0, largest);
  if (!(high > low)) {
    high = low + 1;
  }
  const double step = nice_step(high - low, 6);
  return {std::floor(low / step) * step, std::ceil(high / step - 1e-9) * step, false};
}

std::vector<Tick> ticks(const Axis& axis, int wanted) {
  std::vector<Tick> marks;
  if (!axis.log) {
    const double step = nice_step(axis.high - axis.low, wanted);
    for (double k = std::ceil(axis.low / step - 1e-9); k * step <= axis.high + 1e-9 * step; ++k) {
      marks.push_back({k * step, short_number(std::abs(k) < 0.5 ? 0 : k * step)});
    }
    return marks;
  }
  const double decades = std::log10(axis.high / axis.low);
  const int every = std::max(1, int(std::ceil(decades / std::max(1, wanted))));
  for (int e = int(std::floor(std::log10(axis.low))); e <= int(std::ceil(std::log10(axis.high))); ++e) {
    for (int digit = 1; digit <= 9; ++digit) {
      const double value = digit * std::pow(10.0, e);
      if (value < axis.low * (1 - 1e-9) || value > axis.high * (1 + 1e-9)) {
        continue;
      }
      const bool labelled =
          (digit == 1 && e % every == 0) || (decades <= 2.0 && (digit == 2 || digit == 5)) || decades <= 0.5;
      marks.push_back({value, labelled ? short_number(value) : std::string()});
    }
  }
  return marks;
}

std::string angle_text(double angle_rad) {
  const double angle_deg = std::round(angle_rad * (180e3 / std::numbers::pi)) / 1e3;
  return fmt::format("{:g}°", angle_deg == 0 ? 0 : angle_deg);  // no "-0"
}

std::string short_number(double value) {
  if (value == 0 || !std::isfinite(value)) {
    return value == 0 ? "0" : "–";
  }
  const double size = std::abs(value);
  if (size >= 0.999e-3 && size < 1e4) {
    return fmt::format("{:.4g}", value);
  }
  int exponent = int(std::floor(std::log10(size) + 1e-9));
  const double mantissa = value / std::pow(10.0, exponent);
  if (std::abs(mantissa - 1) < 1e-6) {
    return "10" + superscript(exponent);
  }
  return fmt::format("{:.3g}×10{}", mantissa, superscript(exponent));
}

}  // namespace scatter::plot
