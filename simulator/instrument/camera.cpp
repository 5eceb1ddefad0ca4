#include "simulator/instrument/camera.h"

#include <algorithm>

#include "simulator/faults/fault_random.h"
#include "simulator/instrument/tmp105.h"

namespace scatter::simulator {

using protocol::Target;

Camera::Camera(VirtualClock& clock, Bench& bench, const FaultPlan& plan, std::uint64_t seed)
    : clock_(clock), bench_(bench), plan_(plan), seed_(seed) {}

bool Camera::exposing() const noexcept {
  return shot_ && clock_.since_power_on_us() < shot_->exposed_at_us;
}

bool Camera::trigger(const firmware::SensorSettings& settings) noexcept {
  const protocol::SensorInfo& sensor = bench_.descriptor().sensor;
  const bool window_fits = settings.width > 0 && settings.height > 0 &&
                           settings.x + settings.width <= sensor.width_px &&
                           settings.y + settings.height <= sensor.height_px;
  const bool exposure_fits =
      settings.exposure_us >= sensor.min_exposure_us && settings.exposure_us <= sensor.max_exposure_us;
  if (shot_ || !window_fits || !exposure_fits) {
    ++violations_.trigger_refused;
    return false;
  }
  const bool dead = std::ranges::find(plan_.dead_leds, lit_) != plan_.dead_leds.end();
  const std::uint64_t readout_us =
      (std::uint64_t{sensor.readout_us} * settings.height + sensor.height_px - 1) / sensor.height_px;
  Shot shot;
  shot.exposure = {.target = target_,
                   .illumination = dead ? Exposure::kNoLight : lit_,
                   .exposure_us = settings.exposure_us,
                   .scheduled_us = scheduled_us_,
                   .placed_us = placed_us_,
                   .index = exposures_,
                   .x = settings.x,
                   .y = settings.y,
                   .width = settings.width,
                   .height = settings.height};
  shot.exposed_at_us = clock_.since_power_on_us() + settings.exposure_us;
  shot.ready_at_us = shot.exposed_at_us + readout_us;
  shot.readout_fails = fault_strikes(seed_, FaultKey::kReadout, exposures_, plan_.readout);
  shot_ = shot;
  scheduled_us_ += settings.exposure_us + readout_us;
  ++exposures_;
  return true;
}

firmware::SensorState Camera::state() noexcept {
  if (!shot_) {
    return firmware::SensorState::kIdle;
  }
  return clock_.since_power_on_us() < shot_->ready_at_us ? firmware::SensorState::kExposing
                                                         : firmware::SensorState::kReady;
}

std::uint64_t Camera::ready_at_us() noexcept {
  return state() == firmware::SensorState::kExposing ? shot_->ready_at_us - clock_.booted_us() : 0;
}

void Camera::develop() noexcept {
  if (shot_ && !shot_->developed && !exposing()) {
    pixels_.resize(std::size_t{shot_->exposure.width} * shot_->exposure.height);
    // By the real clock a slow computer would otherwise keep the firmware from its watchdog.
    clock_.outside_time([this] { monitor_uv_ = bench_.expose(shot_->exposure, pixels_); });
    shot_->developed = true;
  }
}

bool Camera::read_rows(std::uint16_t first, std::uint16_t count, std::span<std::uint16_t> out) noexcept {
  if (state() != firmware::SensorState::kReady || first < shot_->next_row ||
      first + count > shot_->exposure.height || out.size() < std::size_t{count} * shot_->exposure.width) {
    ++violations_.rows_out_of_order;
    return false;
  }
  if (shot_->readout_fails) {
    return false;
  }
  develop();
  const std::size_t width = shot_->exposure.width;
  std::copy_n(pixels_.begin() + static_cast<std::ptrdiff_t>(first * width), count * width, out.begin());
  shot_->next_row = static_cast<std::uint16_t>(first + count);
  return true;
}

void Camera::release() noexcept {
  shot_.reset();
}

bool Camera::light(std::uint8_t illumination) noexcept {
  if (illumination != kNone && illumination >= bench_.descriptor().illuminations.size()) {
    return false;
  }
  if (illumination != lit_ && exposing()) {
    ++violations_.light_changed_in_exposure;
  }
  lit_ = illumination;
  return true;
}

std::uint32_t Camera::reading_uv() noexcept {
  develop();
  return monitor_uv_;
}

std::int32_t Camera::sensor_mK() noexcept {
  return tmp105_reading_mK(bench_.temperatures(scheduled_us_).sensor_mK);
}
std::int32_t Camera::led_board_mK() noexcept {
  return tmp105_reading_mK(bench_.temperatures(scheduled_us_).led_board_mK);
}

bool Camera::move_to(Target target) noexcept {
  if (static_cast<std::uint8_t>(target) > static_cast<std::uint8_t>(Target::kTranslucentReference)) {
    return false;
  }
  if (exposing()) {
    ++violations_.stage_moved_in_exposure;
  }
  if (target != target_) {
    target_ = target;
    settled_at_us_ = clock_.since_power_on_us() + kStageUs;
    scheduled_us_ += kStageUs;
    placed_us_ = scheduled_us_;
  }
  return true;
}

bool Camera::moving() noexcept {
  return clock_.since_power_on_us() < settled_at_us_;
}

std::uint64_t Camera::settled_at_us() noexcept {
  return moving() ? settled_at_us_ - clock_.booted_us() : 0;
}

void Camera::reset() noexcept {
  shot_.reset();
  lit_ = kNone;
}

}  // namespace scatter::simulator
