#include "host_sdk/device/update_check.h"

#include "host_sdk/firmware_files/signing.h"

namespace scatter::device {

using firmware_files::Package;
using protocol::FaultCode;
using protocol::ResetReason;
using protocol::SlotVerdict;
using protocol::UpdatePhase;

Result<UpdatePlan> check_update(const Package& package, const protocol::HelloReply& hello,
                                std::string_view product, const protocol::UpdateState& state,
                                const UpdateTrust& trust) {
  if ((hello.capabilities & protocol::kCapabilityUpdate) == 0) {
    return fail(ErrorCode::kUnimplemented, "this instrument takes no updates over its link",
                "update it as its maker says");
  }
  if (package.product() != product) {
    return fail(ErrorCode::kInvalidArgument,
                "the firmware is for product \"" + package.product() + "\", the instrument is a \"" +
                    std::string(product) + "\"",
                "get the firmware for this instrument");
  }
  if (const auto signer = firmware_files::verify(package, trust.keys); !signer) {
    return std::unexpected(signer.error());
  }
  if (package.security_counter() < state.lowest_counter) {
    return fail(ErrorCode::kPermissionDenied,
                "the firmware's security counter is " + std::to_string(package.security_counter()) +
                    ", the instrument takes " + std::to_string(state.lowest_counter) + " or higher",
                "flash a newer release: older ones have weaknesses that were mended since");
  }
  UpdatePlan plan;
  plan.slot = state.running_slot == 0 ? 1 : 0;
  const std::uint32_t bytes = package.image(plan.slot).header.body_bytes;
  if (bytes > state.slot_bytes) {
    return fail(ErrorCode::kInvalidArgument,
                "the image has " + std::to_string(bytes) + " bytes, the slot takes " +
                    std::to_string(state.slot_bytes),
                "get the firmware for this instrument");
  }
  const bool runs = state.running_version.str() == package.version() &&
                    state.running_counter == package.security_counter() &&
                    (hello.capabilities & protocol::kCapabilityRescue) == 0;
  if (state.phase == UpdatePhase::kTrial) {
    plan.start = runs && !trust.same_version_too ? UpdateStart::kConfirm : UpdateStart::kRevert;
    return plan;
  }
  if (runs && !trust.same_version_too) {
    return fail(ErrorCode::kFailedPrecondition, "version " + package.version() + " runs already",
                "nothing needs to be done; --force sends it again");
  }
  return plan;
}

std::string_view words(SlotVerdict verdict) noexcept {
  switch (verdict) {
    case SlotVerdict::kEmpty:
      return "empty";
    case SlotVerdict::kReceiving:
      return "incomplete: an update was begun";
    case SlotVerdict::kReady:
      return "ready, tried at the next start";
    case SlotVerdict::kTrial:
      return "on trial, not confirmed";
    case SlotVerdict::kReverted:
      return "reverted: not confirmed in time";
    case SlotVerdict::kConfirmed:
      return "confirmed";
    case SlotVerdict::kBadHeader:
      return "unusable: header damaged or signature wrong";
    case SlotVerdict::kBadBody:
      return "unusable: the code is damaged";
    case SlotVerdict::kWrongProduct:
      return "unusable: for another product";
    case SlotVerdict::kRolledBack:
      return "unusable: older than the security counter allows";
    case SlotVerdict::kUnreadable:
      return "unreadable: the flash is worn or damaged";
  }
  return "unknown to this program";
}

std::string_view words(UpdatePhase phase) noexcept {
  switch (phase) {
    case UpdatePhase::kIdle:
      return "none under way";
    case UpdatePhase::kReceiving:
      return "an image is being received";
    case UpdatePhase::kReady:
      return "an image is ready and will be tried at the next start";
    case UpdatePhase::kTrial:
      return "the running image is on trial";
  }
  return "unknown to this program";
}

std::string_view words(ResetReason reason) noexcept {
  switch (reason) {
    case ResetReason::kPowerOn:
      return "power on";
    case ResetReason::kRequested:
      return "asked for";
    case ResetReason::kWatchdog:
      return "watchdog: the firmware hung";
    case ResetReason::kFault:
      return "fault: the firmware crashed";
    case ResetReason::kBrownOut:
      return "the supply voltage dropped";
  }
  return "unknown to this program";
}

std::string_view words(FaultCode fault) noexcept {
  switch (fault) {
    case FaultCode::kNone:
      return "none";
    case FaultCode::kSensorTimeout:
      return "the sensor did not answer in time";
    case FaultCode::kMonitorLow:
      return "the monitor saw too little light";
    case FaultCode::kTemperatureOutOfRange:
      return "temperature out of range";
    case FaultCode::kFlashWrite:
      return "flash cannot be written";
    case FaultCode::kCalibrationStoreRecovered:
      return "damaged records in the calibration store were passed over";
    case FaultCode::kStoreOfLaterVersion:
      return "the calibration store was written by a later firmware";
    case FaultCode::kFirmwareCrashed:
      return "the firmware crashed";
  }
  return "unknown to this program";
}

}  // namespace scatter::device
