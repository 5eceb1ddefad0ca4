#include "firmware/core/shot_sequence.h"

namespace scatter::firmware {

void ShotSequence::begin(const ScanPlan& plan, const protocol::Descriptor& descriptor) noexcept {
  recipe_ = plan.recipe();
  automatic_ = recipe_.exposure_mode == protocol::ExposureMode::kAuto;
  if (automatic_) {
    planner_.begin(plan, descriptor);
  }
  first_off_us_ = plan.first_off_exposure_us();
  off_ = false;
  open_ = false;
  sweep_ = 0;
  off_done_ = 0;
  position_ = 0;
  bracket_ = 0;
}

std::optional<Shot> ShotSequence::next() noexcept {
  for (; sweep_ < recipe_.repeats; ++sweep_, off_done_ = 0, position_ = 0, bracket_ = 0) {
    Shot shot;
    shot.sweep = sweep_;
    if (off_done_ < recipe_.off_frames) {
      off_ = true;
      if (off_done_ == 0) {
        // Fixed for the sweep: repeated LED-off frames must be alike.
        off_exposure_us_ = automatic_ ? planner_.off_exposure_us(sweep_) : first_off_us_;
      }
      shot.kind = recipe_.target == protocol::Target::kDarkCap ? protocol::FrameKind::kDark
                                                               : protocol::FrameKind::kAmbient;
      shot.bracket = static_cast<std::uint8_t>(off_done_);
      shot.exposure_us = off_exposure_us_;
      ++off_done_;
      return shot;
    }
    off_ = false;
    for (; position_ < recipe_.illuminations.size(); ++position_, bracket_ = 0, open_ = false) {
      if (const auto exposure = next_light()) {
        shot.illumination = recipe_.illuminations[position_];
        shot.bracket = bracket_++;
        shot.exposure_us = *exposure;
        return shot;
      }
    }
  }
  return std::nullopt;
}

std::optional<std::uint32_t> ShotSequence::next_light() noexcept {
  if (planning()) {
    if (!open_) {
      planner_.begin_illumination(position_);
      open_ = true;
    }
    const auto exposure = planner_.next();
    if (!exposure) {
      planner_.end_illumination();
    }
    return exposure;
  }
  const auto exposures = automatic_ ? planner_.exposures(position_) : recipe_.exposures_us.view();
  return bracket_ < exposures.size() ? std::optional(exposures[bracket_]) : std::nullopt;
}

void ShotSequence::record(const SceneBrightness& scene, std::uint32_t took_us) noexcept {
  if (!automatic_) {
    return;
  }
  if (off_ || !planning()) {
    planner_.record_other(took_us);
  } else {
    planner_.record(scene, took_us);
  }
}

void ShotSequence::record_lost(std::uint32_t took_us) noexcept {
  if (!automatic_) {
    return;
  }
  if (off_ || !planning()) {
    planner_.record_other(took_us);
  } else {
    planner_.record_lost(took_us);
  }
}

}  // namespace scatter::firmware
