// Counts while a frame passes through: saturation, brightest pixel, median of the scene.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "firmware/core/exposure_planner.h"
#include "firmware/core/scan_plan.h"
#include "protocol/descriptor.h"

namespace scatter::firmware {

class FrameTally {
 public:
  /// `hot_pixels`: factory object kHotPixels (u32 little endian, y * width + x, ascending), may be
  /// empty; must stay valid while frames pass.
  void configure(const ScanPlan& plan, const protocol::Descriptor& descriptor,
                 std::span<const std::byte> hot_pixels) noexcept;
  void begin_frame() noexcept;
  /// Rows in rising order, once each. Overwrites known hot pixels in `pixels` with 0: call after packing.
  void add_row(std::uint16_t row, std::span<std::uint16_t> pixels) noexcept;

  /// All saturated pixels, hot ones included.
  [[nodiscard]] std::uint32_t saturated_pixels() const noexcept { return saturated_ + hot_saturated_; }
  /// Brightest unsaturated pixel, hot ones left out [DN].
  [[nodiscard]] std::uint16_t max_dn() const noexcept { return max_dn_; }
  /// What auto exposure wants to know; the median is exact to one of 1024 levels of full range.
  [[nodiscard]] SceneBrightness scene() const noexcept;

 private:
  static constexpr std::size_t kLevels = 1024;
  static constexpr std::uint32_t kStride = 4;  // Every fourth pixel is enough for a median.

  void blank_hot_pixels(std::uint16_t row, std::span<std::uint16_t> pixels) noexcept;

  std::array<std::uint32_t, kLevels> histogram_{};
  std::span<const std::byte> hot_pixels_;
  std::size_t hot_cursor_ = 0;
  std::uint32_t saturated_ = 0;
  std::uint32_t hot_saturated_ = 0;
  std::uint32_t counted_ = 0;
  std::uint32_t shift_ = 0;
  std::uint32_t sensor_width_ = 0;
  std::uint16_t x_ = 0;
  std::uint16_t y_ = 0;
  std::uint16_t saturation_dn_ = 0;
  std::uint16_t max_dn_ = 0;
  bool want_median_ = false;
  float circle_x_ = 0;
  float circle_y_ = 0;
  float circle_r2_ = 0;  // 0 = no circle known: the whole window counts.
};

}  // namespace scatter::firmware
