#include "firmware/core/persistent_state.h"

#include <algorithm>
#include <array>

#include "protocol/codec.h"

namespace scatter::firmware {
namespace {

using protocol::CalibrationManifest;
using protocol::KeyValueSet;
using protocol::StatusCode;

static_assert(protocol::max_encoded_size<CalibrationManifest>() <= FlashLog::kMaxPayload);
static_assert(protocol::max_encoded_size<KeyValueSet>() <= FlashLog::kMaxPayload);

}  // namespace

void PersistentState::mount() noexcept {
  mounted_ = log_.mount(*this);
  ++counters_.boots;
  if (mounted_) {
    mounted_ = persist(kCounters, counters_) == StatusCode::kOk;
  }
}

void PersistentState::record(std::uint16_t kind, std::span<const std::byte> payload) noexcept {
  switch (kind) {
    case kManifest:
      if (const auto manifest = protocol::decode<CalibrationManifest>(payload)) {
        calibrations_.add(*manifest);
        counters_.commits = std::max(counters_.commits, manifest->sequence);
      }
      return;
    case kUndo:
      if (const auto undone = protocol::decode<Undo>(payload)) {
        calibrations_.undo(undone->kind);
      }
      return;
    case kRestore:
      calibrations_.clear();
      return;
    case kSetting:
      if (const auto setting = protocol::decode<KeyValueSet>(payload)) {
        settings_.set(setting->key.str(), setting->value.str());
      }
      return;
    case kCounters:
      if (const auto counters = protocol::decode<Counters>(payload)) {
        counters_ = *counters;
      }
      return;
    default:
      return;  // A later firmware's record: not ours to judge.
  }
}

template <typename T>
FlashLog::Append PersistentState::write(RecordKind kind, const T& value) noexcept {
  std::array<std::byte, FlashLog::kMaxPayload> bytes;
  const auto size = protocol::encode(value, bytes);
  return size ? log_.append(kind, std::span(bytes).first(*size)) : FlashLog::Append::kFailed;
}

template <typename T>
StatusCode PersistentState::persist(RecordKind kind, const T& value) noexcept {
  if (!mounted_) {
    return StatusCode::kResourceExhausted;
  }
  FlashLog::Append outcome = write(kind, value);
  if (outcome == FlashLog::Append::kFull && compact()) {
    outcome = write(kind, value);
  }
  switch (outcome) {
    case FlashLog::Append::kDone:
      return StatusCode::kOk;
    case FlashLog::Append::kFull:
      return StatusCode::kResourceExhausted;
    case FlashLog::Append::kFailed:
      break;
  }
  return StatusCode::kDataLoss;
}

bool PersistentState::compact() noexcept {
  if (!log_.begin_compaction()) {
    return false;
  }
  bool good = write(kCounters, counters_) == FlashLog::Append::kDone;
  calibrations_.each([&](const CalibrationManifest& manifest) {
    good = good && write(kManifest, manifest) == FlashLog::Append::kDone;
  });
  for (std::size_t i = 0; i < Settings::kWritable.size(); ++i) {
    KeyValueSet setting;
    setting.key = Settings::kWritable[i];
    setting.value = settings_.value(i);
    good = good && (setting.value.empty() || write(kSetting, setting) == FlashLog::Append::kDone);
  }
  if (good && log_.finish_compaction()) {
    return true;
  }
  log_.abandon_compaction();
  return false;
}

StatusCode PersistentState::commit(CalibrationManifest manifest) noexcept {
  manifest.sequence = counters_.commits + 1;
  const StatusCode status = persist(kManifest, manifest);
  if (status == StatusCode::kOk) {
    counters_.commits = manifest.sequence;
    calibrations_.add(manifest);
  }
  return status;
}

StatusCode PersistentState::undo(protocol::Target kind) noexcept {
  if (!calibrations_.can_undo(kind)) {
    return StatusCode::kNotFound;
  }
  const StatusCode status = persist(kUndo, Undo{.kind = kind});
  if (status == StatusCode::kOk) {
    calibrations_.undo(kind);
  }
  return status;
}

StatusCode PersistentState::restore_factory() noexcept {
  const StatusCode status = persist(kRestore, counters_);
  if (status == StatusCode::kOk) {
    calibrations_.clear();
  }
  return status;
}

StatusCode PersistentState::set(const KeyValueSet& setting) noexcept {
  const auto known = settings_.get(setting.key.str());
  if (!known) {
    return StatusCode::kNotFound;
  }
  if (known->read_only != 0) {
    return StatusCode::kPermissionDenied;
  }
  const StatusCode status = persist(kSetting, setting);
  if (status == StatusCode::kOk) {
    settings_.set(setting.key.str(), setting.value.str());
  }
  return status;
}

}  // namespace scatter::firmware
