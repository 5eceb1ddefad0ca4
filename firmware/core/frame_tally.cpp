#include "firmware/core/frame_tally.h"

#include <algorithm>
#include <cmath>

#include "protocol/endian.h"

namespace scatter::firmware {

void FrameTally::configure(const ScanPlan& plan, const protocol::Descriptor& descriptor,
                           std::span<const std::byte> hot_pixels) noexcept {
  hot_pixels_ = hot_pixels;
  sensor_width_ = descriptor.sensor.width_px;
  x_ = plan.recipe().region_x;
  y_ = plan.recipe().region_y;
  saturation_dn_ = plan.saturation_dn();
  shift_ = plan.bits() > 10 ? plan.bits() - 10U : 0U;
  want_median_ = plan.recipe().exposure_mode == protocol::ExposureMode::kAuto;
  const protocol::Optics& o = descriptor.optics;
  const float t = o.theta_max_rad;
  const float radius = o.radius_px * t * (o.a1 + t * t * (o.a3 + t * t * o.a5));
  circle_x_ = o.center_x_px;
  circle_y_ = o.center_y_px;
  circle_r2_ = radius > 0 ? radius * radius : 0;
}

void FrameTally::begin_frame() noexcept {
  histogram_.fill(0);
  hot_cursor_ = 0;
  saturated_ = 0;
  hot_saturated_ = 0;
  counted_ = 0;
  max_dn_ = 0;
}

void FrameTally::blank_hot_pixels(std::uint16_t row, std::span<std::uint16_t> pixels) noexcept {
  const std::uint32_t first = (std::uint32_t{y_} + row) * sensor_width_ + x_;
  const std::uint32_t end = first + static_cast<std::uint32_t>(pixels.size());
  for (; hot_cursor_ + 4 <= hot_pixels_.size(); hot_cursor_ += 4) {
    const auto index = protocol::load_le<std::uint32_t>(hot_pixels_.data() + hot_cursor_);
    if (index >= end) {
      return;
    }
    if (index >= first) {
      std::uint16_t& pixel = pixels[index - first];
      hot_saturated_ += pixel >= saturation_dn_ ? 1U : 0U;
      pixel = 0;
    }
  }
}

void FrameTally::add_row(std::uint16_t row, std::span<std::uint16_t> pixels) noexcept {
  blank_hot_pixels(row, pixels);
  std::uint32_t saturated = 0;
  std::uint16_t max_dn = max_dn_;
  for (const std::uint16_t dn : pixels) {
    const bool over = dn >= saturation_dn_;
    saturated += over ? 1U : 0U;
    max_dn = std::max<std::uint16_t>(max_dn, over ? std::uint16_t{0} : dn);
  }
  saturated_ += saturated;
  max_dn_ = max_dn;
  if (!want_median_) {
    return;
  }
  auto begin = std::uint32_t{row} % kStride;  // Diagonal sampling: no column is always left out.
  auto end = static_cast<std::uint32_t>(pixels.size());
  if (circle_r2_ > 0) {
    const float dy = static_cast<float>(y_ + row) + 0.5F - circle_y_;
    const float half2 = circle_r2_ - dy * dy;
    if (!(half2 > 0)) {
      return;
    }
    const float half = std::sqrt(half2);
    const float left = circle_x_ - half - static_cast<float>(x_);
    const float right = circle_x_ + half - static_cast<float>(x_);
    if (!(right > 0)) {
      return;
    }
    begin += left > 0 ? static_cast<std::uint32_t>(std::min(left, 65535.0F)) : 0U;
    end = std::min(end, static_cast<std::uint32_t>(std::min(right, 65535.0F)));
  }
  for (std::uint32_t x = begin; x < end; x += kStride) {
    ++histogram_[std::min<std::size_t>(static_cast<std::size_t>(pixels[x]) >> shift_, kLevels - 1)];
    ++counted_;
  }
}

SceneBrightness FrameTally::scene() const noexcept {
  SceneBrightness scene{.saturated_pixels = saturated_, .max_dn = max_dn_, .median_dn = 0};
  std::uint32_t below = 0;
  for (std::size_t level = 0; level < kLevels && counted_ > 0; ++level) {
    below += histogram_[level];
    if (2 * below >= counted_) {
      // Middle of the level, in DN.
      const auto dn = (level << shift_) + ((std::size_t{1} << shift_) >> 1U);
      scene.median_dn = static_cast<std::uint16_t>(std::min<std::size_t>(dn, 0xFFFF));
      break;
    }
  }
  return scene;
}

}  // namespace scatter::firmware
