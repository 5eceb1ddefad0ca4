#include "firmware/core/calibration_session.h"

#include <algorithm>
#include <cstdlib>

namespace scatter::firmware {
namespace {

using protocol::CalibrationKindState;
using protocol::CalibrationManifest;
using protocol::CalibrationVerdict;
using protocol::Target;

[[nodiscard]] std::string_view name_of(Target kind) noexcept {
  switch (kind) {
    case Target::kSample:
      return "sample";
    case Target::kDarkCap:
      return "dark";
    case Target::kWhiteReference:
      return "white";
    case Target::kBlackReference:
      return "black";
    case Target::kTranslucentReference:
      return "translucent";
  }
  return "unknown";
}

[[nodiscard]] std::uint32_t age_of(const CalibrationManifest& manifest,
                                   const CalibrationMoment& now) noexcept {
  std::uint64_t age_s = kUnknownAge;
  if (manifest.boot_count == now.boot_count && manifest.device_time_us <= now.device_time_us) {
    age_s = (now.device_time_us - manifest.device_time_us) / 1'000'000;
  } else if (manifest.unix_time_s != 0 && now.unix_time_s >= manifest.unix_time_s) {
    age_s = now.unix_time_s - manifest.unix_time_s;
  }
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(age_s, kUnknownAge));
}

/// In 64 bits: manifests come from outside and may hold any temperature.
[[nodiscard]] std::int32_t change_of(std::int32_t before_mK, std::int32_t now_mK) noexcept {
  const std::int64_t change = std::int64_t{now_mK} - before_mK;
  return static_cast<std::int32_t>(std::clamp<std::int64_t>(change, -1'000'000'000, 1'000'000'000));
}

[[nodiscard]] Text action_for(Target kind, const protocol::Descriptor& d) noexcept {
  Text text;
  if (d.reference_stage != 0) {
    text << "run a " << name_of(kind) << " calibration; the stage places what it needs";
  } else {
    text << placing_instruction(kind) << ", then run a " << name_of(kind) << " calibration";
  }
  return text;
}

}  // namespace

std::string_view placing_instruction(Target target) noexcept {
  switch (target) {
    case Target::kSample:
      return "place the sample";
    case Target::kDarkCap:
      return "put the dark cap on";
    case Target::kWhiteReference:
      return "place the white reference";
    case Target::kBlackReference:
      return "place the black reference";
    case Target::kTranslucentReference:
      return "place the translucent standard";
  }
  return "";
}

CalibrationKindState judge(Target kind, const CalibrationManifest* manifest, const CalibrationMoment& now,
                           const protocol::Descriptor& descriptor) noexcept {
  CalibrationKindState state;
  state.kind = kind;
  state.verdict = CalibrationVerdict::kNeeded;
  if (manifest != nullptr) {
    state.id = manifest->id;
    state.age_s = age_of(*manifest, now);
    state.temperature_change_mK = change_of(manifest->sensor_temperature_mK, now.sensor_temperature_mK);
    if (kind != Target::kDarkCap) {
      // References depend on the LEDs as well: the larger change counts.
      const std::int32_t led = change_of(manifest->led_temperature_mK, now.led_temperature_mK);
      if (std::abs(led) > std::abs(state.temperature_change_mK)) {
        state.temperature_change_mK = led;
      }
    }
    const std::uint32_t lifetime =
        kind == Target::kDarkCap ? descriptor.dark_lifetime_s : descriptor.reference_lifetime_s;
    state.verdict = CalibrationVerdict::kValid;
    if (lifetime != 0 && state.age_s > lifetime) {
      state.verdict = CalibrationVerdict::kExpiredAge;
    } else if (std::abs(state.temperature_change_mK) > descriptor.calibration_span_mK) {
      state.verdict = CalibrationVerdict::kExpiredTemperature;
    }
  }
  if (state.verdict != CalibrationVerdict::kValid) {
    state.action = action_for(kind, descriptor).str();
  }
  return state;
}

protocol::CalibrationState judge_all(const CalibrationStore& store, const CalibrationMoment& now,
                                     const protocol::Descriptor& descriptor) noexcept {
  protocol::CalibrationState all;
  for (const Target kind :
       {Target::kDarkCap, Target::kWhiteReference, Target::kBlackReference, Target::kTranslucentReference}) {
    if (kind != Target::kTranslucentReference || descriptor.transmission_module != 0) {
      all.states.push_back(judge(kind, store.current(kind), now, descriptor));
    }
  }
  return all;
}

CalibrationManifest stamped(CalibrationManifest manifest, const CalibrationMoment& now) noexcept {
  manifest.device_time_us = now.device_time_us;
  manifest.boot_count = now.boot_count;
  manifest.sensor_temperature_mK = now.sensor_temperature_mK;
  manifest.led_temperature_mK = now.led_temperature_mK;
  if (manifest.unix_time_s == 0) {
    manifest.unix_time_s = now.unix_time_s;
  }
  return manifest;
}

}  // namespace scatter::firmware
