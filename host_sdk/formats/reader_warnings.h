// What a reader says of a file that it does not refuse. Internal to formats.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

namespace scatter::formats {

/// What surfaces scatter at most, with room for the noise and the extrapolation of a measurement.
inline constexpr double kLargestTotal = 1.2;

/// Wavelengths of light, from the ultraviolet to the far infrared [nm]. What is outside has another
/// unit, or is no wavelength.
[[nodiscard]] constexpr bool is_wavelength(double nm) noexcept {
  return nm >= 100 && nm <= 1e6;
}
inline constexpr std::string_view kWavelengthRange = "100..1000000 nm";
inline constexpr std::string_view kWavelengthRemedy = "state the wavelength in nanometres: 0.55 um is 550 nm";

/// Goes into the metadata "warnings", one line each, the first twenty of them.
class ReaderWarnings {
 public:
  [[nodiscard]] bool is_full() const noexcept { return lines_.size() >= kTold; }
  void add(std::string line) {
    if (is_full()) {
      ++more_;
    } else {
      lines_.push_back(std::move(line));
    }
  }
  /// Lines that came along with the data from an earlier file stay, and none is there twice.
  void put_into(std::map<std::string, std::string>& metadata) const {
    std::string text;
    const auto it = metadata.find("warnings");
    const std::string_view earlier = it == metadata.end() ? std::string_view() : it->second;
    for (const std::string& line : lines_) {
      if (earlier.find(line) == std::string_view::npos) {
        text += line + '\n';
      }
    }
    if (more_ > 0) {
      text += fmt::format("{} more of these\n", more_);
    }
    if (!text.empty()) {
      metadata["warnings"] += text;
    }
  }

 private:
  static constexpr std::size_t kTold = 20;
  std::vector<std::string> lines_;
  std::size_t more_ = 0;
};

}  // namespace scatter::formats
