#include "firmware/core/exposure_planner.h"

#include <algorithm>

namespace scatter::firmware {
namespace {

constexpr float kTargetMedian = 0.65F;
constexpr float kLowestGoodMedian = 0.50F;  // Accepted when it saves a second exposure.
constexpr float kSafePeak = 0.92F;          // Leaves room for noise and LED drift.
constexpr float kBlownMedian = 0.90F;       // Above this the median says nothing about the scene.
constexpr float kLongEnough = 0.77F;        // Of the wanted exposure: not worth another frame.
constexpr float kTooLong = 1.5F;
constexpr float kFirstStep = 4.0F;  // Down from the longest; later steps use the widest ratio.
constexpr float kWidestStep = 8.0F;
constexpr float kFaintMedian = 0.004F;  // Below this the median is mostly noise...
constexpr float kFaintStep = 16.0F;     // ...so go up by this much only.

}  // namespace

void ExposurePlanner::begin(const ScanPlan& plan, const protocol::Descriptor& descriptor) noexcept {
  *this = ExposurePlanner{};
  const protocol::Recipe& recipe = plan.recipe();
  count_ = recipe.illuminations.size();
  for (std::size_t i = 0; i < count_; ++i) {
    heads_[i] = descriptor.illuminations[recipe.illuminations[i]].head;
  }
  max_brackets_ = recipe.max_brackets;
  sweeps_ = recipe.repeats;
  off_frames_ = recipe.off_frames;
  fixed_off_us_ = recipe.off_exposure_us;
  first_off_us_ = plan.first_off_exposure_us();
  probe_us_ = plan.probe_exposure_us();
  min_us_ = plan.min_exposure_us();
  max_us_ = plan.max_exposure_us();
  readout_us_ = plan.readout_us();
  budget_us_ = recipe.time_budget_us - std::min(recipe.time_budget_us, kBudgetMarginUs);
  black_dn_ = static_cast<float>(plan.black_dn());
  full_scale_dn_ = std::max(1.0F, static_cast<float>(plan.saturation_dn()) - black_dn_);
}

void ExposurePlanner::begin_illumination(std::size_t position) noexcept {
  position_ = position;
  taken_.clear();
  attempts_ = 0;
  current_us_ = 0;
  spent_before_ = spent_us_;
}

const ExposurePlanner::Exposures* ExposurePlanner::model() const noexcept {
  for (std::size_t back = position_; back > 0; --back) {
    if (heads_[back - 1] == heads_[position_] && !kept_[back - 1].empty()) {
      return &kept_[back - 1];
    }
  }
  return position_ > 0 && !kept_[position_ - 1].empty() ? &kept_[position_ - 1] : nullptr;
}

std::uint32_t ExposurePlanner::clamped(float exposure_us) const noexcept {
  // The comparison in float first: converting an out-of-range float is undefined.
  if (!(exposure_us > static_cast<float>(min_us_))) {
    return min_us_;
  }
  return exposure_us >= static_cast<float>(max_us_) ? max_us_ : static_cast<std::uint32_t>(exposure_us);
}

float ExposurePlanner::fair_longest_us(bool with_short) const noexcept {
  const auto sweeps = static_cast<float>(sweeps_);
  const auto readout = static_cast<float>(readout_us_);
  const float later_off = static_cast<float>(sweeps_ - 1) * static_cast<float>(off_frames_);
  // Time for this and the later illuminations in all sweeps.
  float available = static_cast<float>(budget_us_) - static_cast<float>(spent_before_) -
                    static_cast<float>(sweeps_ - 1) * static_cast<float>(repeat_us_);
  // LED-off frames of later sweeps follow the longest exposure, so each is one more unit to share with.
  float units = sweeps * static_cast<float>(count_ - position_);
  if (fixed_off_us_ != 0) {
    available -= later_off * (readout + static_cast<float>(fixed_off_us_));
  } else {
    units += later_off;
  }
  const float share = available / units;
  if (with_short) {
    const Exposures* guess = model();
    if (guess == nullptr || guess->size() < 2) {
      return (share - static_cast<float>(current_us_) - 2 * readout) / (1 + 1 / kFirstStep);
    }
    // As many shorter exposures as the one before needed, less those already taken.
    float shorter = 0;
    for (std::size_t i = 1; i < guess->size(); ++i) {
      shorter += readout + static_cast<float>((*guess)[i]);
    }
    const float others = std::max(shorter, static_cast<float>(current_us_));
    return share - others - readout;
  }
  // Without saturation the frames so far will not be repeated: they cost this sweep only.
  return share - static_cast<float>(current_us_) / sweeps - readout;
}

float ExposurePlanner::hard_limit_us() const noexcept {
  const auto sweeps = static_cast<float>(sweeps_);
  const auto readout = static_cast<float>(readout_us_);
  const float later = static_cast<float>(sweeps_ - 1);
  const float later_off = later * static_cast<float>(off_frames_);
  const float floor_us = readout + static_cast<float>(probe_us_);
  float rest = static_cast<float>(budget_us_) - static_cast<float>(spent_us_) - sweeps * readout -
               later * static_cast<float>(repeat_us_ + current_us_) - later_off * readout -
               static_cast<float>(count_ - position_ - 1) * sweeps * floor_us;
  if (fixed_off_us_ != 0) {
    return (rest - later_off * static_cast<float>(fixed_off_us_)) / sweeps;
  }
  const auto longest = static_cast<float>(longest_us_);
  const float both = rest / (sweeps + later_off);
  return both >= longest ? both : (rest - later_off * longest) / sweeps;
}

std::optional<std::uint32_t> ExposurePlanner::next() noexcept {
  if (attempts_ >= max_brackets_) {
    return std::nullopt;
  }
  const std::optional<std::uint32_t> exposure = wanted();
  if (!exposure) {
    return std::nullopt;
  }
  const float limit = hard_limit_us();
  if (attempts_ > 0 && limit < static_cast<float>(min_us_)) {
    return std::nullopt;
  }
  proposed_us_ = std::min(*exposure, clamped(limit));
  for (const Taken& t : taken_) {
    if (t.exposure_us == proposed_us_) {
      return std::nullopt;  // The limit leaves nothing new to learn.
    }
  }
  return proposed_us_;
}

std::optional<std::uint32_t> ExposurePlanner::wanted() const noexcept {
  if (taken_.empty()) {
    const Exposures* guess = model();
    if (guess == nullptr) {
      return clamped(std::min(static_cast<float>(probe_us_), fair_longest_us(false)));
    }
    return clamped(std::min(static_cast<float>((*guess)[0]), fair_longest_us(guess->size() > 1)));
  }
  if (const auto exposure = wanted_long()) {
    return exposure;
  }
  if (const auto exposure = wanted_short()) {
    return exposure;
  }
  return wanted_between();
}

std::optional<std::uint32_t> ExposurePlanner::wanted_long() const noexcept {
  const Taken* by_median = nullptr;  // Longest whose median is believable.
  const Taken* by_peak = nullptr;    // Longest without saturation.
  const Taken* shortest = &taken_[0];
  const Taken* longest = &taken_[0];
  for (const Taken& t : taken_) {
    if (t.median < kBlownMedian && (by_median == nullptr || t.exposure_us > by_median->exposure_us)) {
      by_median = &t;
    }
    if (!t.saturated && (by_peak == nullptr || t.exposure_us > by_peak->exposure_us)) {
      by_peak = &t;
    }
    shortest = t.exposure_us < shortest->exposure_us ? &t : shortest;
    longest = t.exposure_us > longest->exposure_us ? &t : longest;
  }
  if (by_median == nullptr) {
    if (shortest->exposure_us == min_us_) {
      return std::nullopt;
    }
    return clamped(static_cast<float>(shortest->exposure_us) / kWidestStep);
  }
  const auto at = static_cast<float>(by_median->exposure_us);
  const float per_us = std::max(by_median->median, 1e-4F) / at;
  float target = kTargetMedian / per_us;
  bool saturates = false;
  if (by_peak != nullptr && by_peak->peak > 0) {
    const float safe = kSafePeak * static_cast<float>(by_peak->exposure_us) / by_peak->peak;
    if (safe >= kLowestGoodMedian / per_us) {
      target = std::min(target, safe);
    }
    saturates = safe < target;
  } else {
    saturates = true;
  }
  if (by_median->median < kFaintMedian) {
    target = std::min(target, at * kFaintStep);
  }
  const float reachable = std::min(target, fair_longest_us(saturates));
  const auto held = static_cast<float>(longest->exposure_us);
  if (held < kLongEnough * static_cast<float>(clamped(reachable))) {
    return clamped(reachable);
  }
  bool fits = false;
  for (const Taken& t : taken_) {
    fits = fits || static_cast<float>(t.exposure_us) <= kTooLong * target;
  }
  // All are too long, or the fitting one is far too short with a blown one above it.
  const auto good = static_cast<float>(by_median->exposure_us);
  if (!fits || (longest->median >= kBlownMedian && good < target / kTooLong)) {
    return clamped(reachable);
  }
  return std::nullopt;
}

bool ExposurePlanner::deep_scene() const noexcept {
  const Exposures* guess = model();
  return guess != nullptr && static_cast<float>((*guess)[0]) >
                                 kWidestStep * kWidestStep * static_cast<float>((*guess)[guess->size() - 1]);
}

std::optional<std::uint32_t> ExposurePlanner::wanted_short() const noexcept {
  const Taken* shortest = &taken_[0];
  for (const Taken& t : taken_) {
    shortest = t.exposure_us < shortest->exposure_us ? &t : shortest;
  }
  if (!shortest->saturated || shortest->exposure_us == min_us_) {
    return std::nullopt;
  }
  const auto from = static_cast<float>(shortest->exposure_us);
  if (const Exposures* guess = model()) {
    const auto like = static_cast<float>((*guess)[guess->size() - 1]);
    if (like >= from / kWidestStep && like * kTooLong <= from) {
      return clamped(like);
    }
  }
  const bool gentle = taken_.size() == 1 && attempts_ + 1 < max_brackets_ && !deep_scene();
  return clamped(from / (gentle ? kFirstStep : kWidestStep));
}

std::optional<std::uint32_t> ExposurePlanner::wanted_between() const noexcept {
  for (const Taken& t : taken_) {
    if (!t.saturated) {
      continue;
    }
    std::uint32_t below = 0;  // Next shorter exposure.
    for (const Taken& other : taken_) {
      if (other.exposure_us < t.exposure_us) {
        below = std::max(below, other.exposure_us);
      }
    }
    const float ratio = below == 0 ? 1.0F : static_cast<float>(t.exposure_us) / static_cast<float>(below);
    if (ratio > kWidestStep * 1.05F) {
      const float step = ratio > kWidestStep * kFirstStep ? kWidestStep : kFirstStep;
      return clamped(static_cast<float>(t.exposure_us) / step);
    }
  }
  return std::nullopt;
}

void ExposurePlanner::record(const SceneBrightness& scene, std::uint32_t took_us) noexcept {
  const auto share = [this](std::uint16_t dn) {
    return std::clamp((static_cast<float>(dn) - black_dn_) / full_scale_dn_, 0.0F, 1.0F);
  };
  Taken taken;
  taken.exposure_us = proposed_us_;
  taken.saturated = scene.saturated_pixels > 0;
  taken.peak = share(scene.max_dn);
  taken.median = share(scene.median_dn);
  taken_.push_back(taken);
  longest_us_ = std::max(longest_us_, proposed_us_);
  ++attempts_;
  spent_us_ += took_us;
  current_us_ += cost_us(proposed_us_);
}

void ExposurePlanner::record_lost(std::uint32_t took_us) noexcept {
  ++attempts_;
  spent_us_ += took_us;
}

void ExposurePlanner::end_illumination() noexcept {
  // Longest first. By insertion: the few there are need no more, and std::sort recurses, which a small stack
  // forbids.
  const auto longer = [](const Taken& a, const Taken& b) { return a.exposure_us > b.exposure_us; };
  for (auto next = taken_.begin(); next != taken_.end(); ++next) {
    std::rotate(std::upper_bound(taken_.begin(), next, *next, longer), next, next + 1);
  }
  Exposures& kept = kept_[position_];
  kept.clear();
  for (std::size_t i = 0; i < taken_.size(); ++i) {
    const bool blown = taken_[i].median >= kBlownMedian;
    if (blown && i + 1 < taken_.size() && taken_[i + 1].median >= kTargetMedian / kTooLong) {
      continue;  // The next shorter one already fills the range.
    }
    kept.push_back(taken_[i].exposure_us);
    if (!taken_[i].saturated) {
      break;  // Anything shorter shows the same pixels with more noise.
    }
  }
  if (kept.empty()) {
    kept.push_back(proposed_us_);  // All frames were lost; the guess is the best there is.
  }
  for (const std::uint32_t exposure : kept) {
    repeat_us_ += cost_us(exposure);
  }
  current_us_ = 0;
}

std::uint32_t ExposurePlanner::off_exposure_us(std::uint16_t sweep) const noexcept {
  if (fixed_off_us_ != 0) {
    return fixed_off_us_;
  }
  if (sweep == 0) {
    return first_off_us_;
  }
  // Never past the budget, whatever was lost before.
  const std::uint64_t sweeps_left = sweeps_ - sweep;
  const std::uint64_t light = sweeps_left * repeat_us_;
  const std::uint64_t used = spent_us_ + light;
  const std::uint64_t rest = budget_us_ > used ? budget_us_ - used : 0;
  const std::uint64_t each = rest / (sweeps_left * std::max<std::uint32_t>(off_frames_, 1));
  const std::uint64_t exposure = each > readout_us_ ? each - readout_us_ : 0;
  return std::clamp(static_cast<std::uint32_t>(std::min<std::uint64_t>(exposure, longest_us_)), min_us_,
                    max_us_);
}

}  // namespace scatter::firmware
