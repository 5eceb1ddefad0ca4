#include "firmware/core/scan_plan.h"

#include <algorithm>
#include <limits>

#include "firmware/core/row_packer.h"

namespace scatter::firmware {
namespace {

using protocol::ExposureMode;
using protocol::PixelFormat;
using protocol::Recipe;
using protocol::SensorInfo;
using protocol::Target;

// Probe of an auto run when the recipe names none: short enough not to saturate on a white tile.
constexpr std::uint32_t kDefaultProbeUs = 2'000;

/// What is wrong with the recipe's enumerations, window and lists; "" when nothing.
[[nodiscard]] std::string_view fault_of(const Recipe& r, const protocol::Descriptor& d) noexcept {
  const SensorInfo& s = d.sensor;
  if (r.exposure_mode > ExposureMode::kAuto) {
    return "exposure_mode must be 0 (fixed) or 1 (auto)";
  }
  if (r.pixel_format > PixelFormat::kMono12p) {
    return "pixel_format must be 0 (Mono16), 1 (Mono10p) or 2 (Mono12p)";
  }
  if (r.target > Target::kTranslucentReference) {
    return "target must be 0..4";
  }
  if (s.bits > packed_bits(r.pixel_format)) {
    return "pixel_format is too narrow for the sensor's bits";
  }
  if (r.repeats == 0) {
    return "repeats must be at least 1";
  }
  if (r.illuminations.empty() && r.off_frames == 0) {
    return "nothing to expose: give illuminations or off_frames";
  }
  for (const std::uint8_t index : r.illuminations) {
    if (index >= d.illuminations.size()) {
      return "an illumination index is past the descriptor's list";
    }
  }
  const auto in_range = [&](std::uint32_t us) { return us >= s.min_exposure_us && us <= s.max_exposure_us; };
  for (const std::uint32_t us : r.exposures_us) {
    if (!in_range(us)) {
      return "an exposure is outside the sensor's min_exposure_us..max_exposure_us";
    }
  }
  if (r.off_exposure_us != 0 && !in_range(r.off_exposure_us)) {
    return "off_exposure_us is outside the sensor's min_exposure_us..max_exposure_us";
  }
  const std::uint32_t width = r.region_width == 0 ? s.width_px : r.region_width;
  const std::uint32_t height = r.region_height == 0 ? s.height_px : r.region_height;
  if (r.region_x + width > s.width_px || r.region_y + height > s.height_px || width == 0 || height == 0) {
    return "the region does not lie on the sensor";
  }
  if (width > kMaxRowPixels) {
    return "the region is wider than 8192 pixels";
  }
  if (r.exposure_mode == ExposureMode::kFixed) {
    if (r.exposures_us.empty() && (!r.illuminations.empty() || r.off_exposure_us == 0)) {
      return "fixed exposure needs exposures_us";
    }
    return "";
  }
  if (r.live_preview != 0) {
    return "auto exposure needs every frame: not with live_preview";
  }
  if (r.test_pattern != 0) {
    return "auto exposure needs real pixels: not with test_pattern";
  }
  if (r.illuminations.empty()) {
    return "auto exposure needs illuminations";
  }
  if (r.max_brackets == 0 || r.max_brackets > protocol::kMaxExposures) {
    return "max_brackets must be 1..16";
  }
  return "";
}

[[nodiscard]] std::uint32_t clamp_u32(std::uint64_t value) noexcept {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(value, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

std::uint16_t saturation_level(const SensorInfo& sensor) noexcept {
  const float last_code = static_cast<float>((1UL << std::min<std::uint32_t>(sensor.bits, 16)) - 1UL);
  float level = last_code;
  if (sensor.gain_e_per_dn > 0 && sensor.full_well_e > 0) {
    level = std::min(level, sensor.black_level_dn + 0.98F * sensor.full_well_e / sensor.gain_e_per_dn);
  }
  return static_cast<std::uint16_t>(std::clamp(level, 1.0F, 65535.0F));
}

std::optional<ScanPlan> ScanPlan::make(const Recipe& recipe, const protocol::Descriptor& descriptor,
                                       std::string_view& reason) noexcept {
  reason = fault_of(recipe, descriptor);
  if (!reason.empty()) {
    return std::nullopt;
  }
  ScanPlan plan;
  plan.recipe_ = recipe;
  plan.adopt_sensor(descriptor.sensor);
  plan.schedule();
  if (recipe.exposure_mode == ExposureMode::kAuto) {
    // The least that a run can be: one shortest exposure per illumination and sweep, and the off frames.
    const std::uint64_t off_cost =
        std::uint64_t{recipe.off_frames} * (plan.readout_us_ + std::uint64_t{plan.first_off_exposure_us_});
    const std::uint64_t light_cost =
        std::uint64_t{recipe.illuminations.size()} *
        (plan.readout_us_ + std::uint64_t{std::max(plan.probe_exposure_us_, plan.min_exposure_us_)});
    if (recipe.repeats * (off_cost + light_cost) + kBudgetMarginUs > recipe.time_budget_us) {
      reason = "time_budget_us is too short for one exposure per illumination and sweep";
      return std::nullopt;
    }
  }
  return plan;
}

void ScanPlan::adopt_sensor(const SensorInfo& sensor) noexcept {
  width_ = recipe_.region_width == 0 ? sensor.width_px : recipe_.region_width;
  height_ = recipe_.region_height == 0 ? sensor.height_px : recipe_.region_height;
  frame_bytes_ = static_cast<std::uint32_t>(packed_bytes(recipe_.pixel_format, pixels()));
  readout_us_ = static_cast<std::uint32_t>(std::uint64_t{sensor.readout_us} * height_ / sensor.height_px);
  saturation_dn_ = saturation_level(sensor);
  black_dn_ = static_cast<std::uint16_t>(std::clamp(sensor.black_level_dn + 0.5F, 0.0F, 65535.0F));
  bits_ = sensor.bits;
  min_exposure_us_ = std::max<std::uint32_t>(sensor.min_exposure_us, 1);
  max_exposure_us_ = std::max(sensor.max_exposure_us, min_exposure_us_);
}

void ScanPlan::schedule() noexcept {
  const Recipe& r = recipe_;
  const std::uint32_t longest = r.exposures_us.empty() ? 0 : *std::ranges::max_element(r.exposures_us);
  if (r.exposure_mode == ExposureMode::kAuto) {
    probe_exposure_us_ = std::clamp(r.exposures_us.empty() ? kDefaultProbeUs : r.exposures_us[0],
                                    min_exposure_us_, max_exposure_us_);
    // One percent of the run is a fair guess before the sample's brightness is known.
    first_off_exposure_us_ = r.off_exposure_us != 0
                                 ? r.off_exposure_us
                                 : std::clamp(r.time_budget_us / 100, min_exposure_us_, max_exposure_us_);
    planned_frames_ =
        r.repeats * (r.off_frames + static_cast<std::uint32_t>(r.illuminations.size()) * r.max_brackets);
    planned_duration_us_ = r.time_budget_us;
    return;
  }
  first_off_exposure_us_ = r.off_exposure_us != 0 ? r.off_exposure_us : longest;
  const auto lights = static_cast<std::uint32_t>(r.illuminations.size());
  planned_frames_ = r.repeats * (r.off_frames + lights * static_cast<std::uint32_t>(r.exposures_us.size()));
  std::uint64_t sweep_us =
      std::uint64_t{r.off_frames} * (first_off_exposure_us_ + std::uint64_t{readout_us_});
  for (const std::uint32_t us : r.exposures_us) {
    sweep_us += lights * (us + std::uint64_t{readout_us_});
  }
  planned_duration_us_ = clamp_u32(sweep_us * r.repeats);
}

}  // namespace scatter::firmware
