// Calibration sessions, stored manifests and settings.
#include <algorithm>

#include "firmware/core/dispatcher.h"

namespace scatter::firmware {

using protocol::StatusCode;
using protocol::Target;

namespace {

constexpr std::string_view kNoSession = "no such calibration session: begin one";

/// References need a certificate that belongs to this instrument; cap and sample do not.
[[nodiscard]] bool has_reference(const protocol::Descriptor& descriptor, Target target) noexcept {
  return target == Target::kSample || target == Target::kDarkCap ||
         std::ranges::any_of(descriptor.certificates,
                             [target](const auto& certificate) { return certificate.kind == target; });
}

[[nodiscard]] std::string_view text_of(StatusCode status) noexcept {
  switch (status) {
    case StatusCode::kOk:
      return "";
    case StatusCode::kResourceExhausted:
      return "there is no flash to write to";
    case StatusCode::kFailedPrecondition:
      return "the store is a later firmware's: update the firmware first";
    case StatusCode::kDataLoss:
      return "the flash refused the write";
    default:
      return "not stored";
  }
}

}  // namespace

void Dispatcher::calibration_begin(const Header& request) noexcept {
  if (acquisition_.active()) {
    reply_status(request, StatusCode::kFailedPrecondition, "a run is on: stop it first");
    return;
  }
  protocol::CalibrationBegun begun;
  begun.session = calibration_.begin();
  begun.reference_stage = stage_.present() ? 1 : 0;
  reply(request, begun);
}

void Dispatcher::calibration_step(const Header& request, const protocol::CalibrationStep& message) noexcept {
  if (!calibration_.is_open(message.session)) {
    reply_status(request, StatusCode::kFailedPrecondition, kNoSession);
    return;
  }
  if (message.target > Target::kTranslucentReference) {
    reply_status(request, StatusCode::kInvalidArgument, "target must be 0..4");
    return;
  }
  if (acquisition_.active()) {
    reply_status(request, StatusCode::kFailedPrecondition, "a run is on: stop it first");
    return;
  }
  if (!has_reference(descriptor_, message.target)) {
    reply_status(request, StatusCode::kNotFound,
                 (Text("no certified reference to do this: ") << placing_instruction(message.target)).str());
    return;
  }
  if (!stage_.present()) {
    Text text(placing_instruction(message.target));
    text << ", then continue";
    reply(request, protocol::CalibrationPlaced{.placed = 0, .instruction = text.str()});
    return;
  }
  if (!stage_is_free(request)) {
    return;
  }
  switch (stage_.move_to(message.target)) {
    case Stage::Move::kThere:
      reply(request, protocol::CalibrationPlaced{.placed = 1, .instruction = {}});
      return;
    case Stage::Move::kMoving:
      wait_for_stage(request, Waiting::kStep);
      return;
    case Stage::Move::kNoSuchTarget:
      reply_status(request, StatusCode::kNotFound, "the stage does not carry this target");
      return;
  }
}

void Dispatcher::calibration_commit(const Header& request,
                                    const protocol::CalibrationCommit& message) noexcept {
  if (!calibration_.is_open(message.session)) {
    reply_status(request, StatusCode::kFailedPrecondition, kNoSession);
    return;
  }
  if (!is_calibration_kind(message.manifest.kind)) {
    reply_status(request, StatusCode::kInvalidArgument, "manifest.kind must be 1..4");
    return;
  }
  if (message.manifest.id == protocol::CalibrationId{}) {
    reply_status(request, StatusCode::kInvalidArgument, "manifest.id is all zero, which means none");
    return;
  }
  const StatusCode status = state_.commit(stamped(message.manifest, moment()));
  reply_status(request, status, text_of(status));
  if (status != StatusCode::kOk) {
    events_.fault(protocol::FaultCode::kFlashWrite, Text("calibration not stored: ") << text_of(status));
  }
}

void Dispatcher::calibration_end(const Header& request, const protocol::CalibrationEnd& message) noexcept {
  if (!calibration_.is_open(message.session)) {
    reply_status(request, StatusCode::kFailedPrecondition, kNoSession);
    return;
  }
  if (!stage_is_free(request)) {
    return;
  }
  calibration_.end();
  if (stage_.present() && !acquisition_.active() && stage_.move_to(Target::kSample) == Stage::Move::kMoving) {
    wait_for_stage(request, Waiting::kEnd);
    return;
  }
  reply_status(request, StatusCode::kOk);
}

void Dispatcher::calibration_list(const Header& request) noexcept {
  protocol::CalibrationListed listed = state_.calibrations().list();
  // The oldest give way when the negotiated payload is small.
  while (protocol::encoded_size(listed) > max_payload_) {
    listed.manifests.resize(listed.manifests.size() - 1);
  }
  reply(request, listed);
}

void Dispatcher::calibration_query(const Header& request) noexcept {
  reply(request, judge_all(state_.calibrations(), moment(), descriptor_));
}

void Dispatcher::calibration_undo(const Header& request, const protocol::CalibrationUndo& message) noexcept {
  const StatusCode status = state_.undo(message.kind);
  reply_status(request, status,
               status == StatusCode::kNotFound ? "no earlier calibration of this kind" : text_of(status));
}

void Dispatcher::restore_factory(const Header& request) noexcept {
  const StatusCode status = state_.restore_factory();
  reply_status(request, status, text_of(status));
}

void Dispatcher::key_value_get(const Header& request, const protocol::KeyValueGet& message) noexcept {
  if (const auto found = state_.settings().get(message.key.str())) {
    reply(request, *found);
  } else {
    reply_status(request, StatusCode::kNotFound, Settings::kKnownKeys);
  }
}

void Dispatcher::key_value_set(const Header& request, const protocol::KeyValueSet& message) noexcept {
  const StatusCode status = state_.set(message);
  switch (status) {
    case StatusCode::kNotFound:
      reply_status(request, status, Settings::kKnownKeys);
      return;
    case StatusCode::kPermissionDenied:
      reply_status(request, status, "this key is read-only");
      return;
    default:
      reply_status(request, status, text_of(status));
      return;
  }
}

}  // namespace scatter::firmware
