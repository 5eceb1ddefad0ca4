#include "firmware/core/persistent_state.h"

#include <algorithm>

#include "protocol/codec.h"
#include "protocol/endian.h"

namespace scatter::firmware {
namespace {

using protocol::CalibrationManifest;
using protocol::KeyValueSet;
using protocol::StatusCode;

constexpr std::size_t kEntryHeader = 4;

/// Puts entries one behind the other.
class EntryWriter {
 public:
  explicit EntryWriter(std::span<std::byte> out) noexcept : out_(out) {}

  template <typename T>
  void add(std::uint16_t kind, const T& value) noexcept {
    // Everything at its longest fits; see the assertion below.
    const std::span<std::byte> rest = out_.subspan(size_);
    const std::size_t length = protocol::encode(value, rest.subspan(kEntryHeader)).value_or(0);
    protocol::store_le(rest.data(), kind);
    protocol::store_le(rest.data() + 2, static_cast<std::uint16_t>(length));
    size_ += kEntryHeader + length;
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  std::span<std::byte> out_;
  std::size_t size_ = 0;
};

constexpr std::size_t kLongest =
    kEntryHeader + 8 +
    kCalibrationKinds * kManifestsPerKind *
        (kEntryHeader + protocol::max_encoded_size<CalibrationManifest>()) +
    Settings::kWritable.size() * (kEntryHeader + protocol::max_encoded_size<KeyValueSet>());
static_assert(kLongest <= RecordStore::kMaxPayload, "the store can never be full");

}  // namespace

void PersistentState::mount() noexcept {
  std::size_t length = 0;
  const bool usable = store_.mount(length);
  report_ = store_.report();
  read_entries(store_.payload().first(length));
  ++counters_.boots;
  if (!usable) {
    return;
  }
  mounted_ = true;
  mounted_ = store(calibrations_, counters_) == StatusCode::kOk;
  if (!mounted_) {
    report_.condition = StoreReport::Condition::kUnusable;
  }
}

void PersistentState::read_entries(std::span<const std::byte> entries) noexcept {
  while (entries.size() >= kEntryHeader) {
    const auto kind = protocol::load_le<std::uint16_t>(entries.data());
    const std::size_t length = protocol::load_le<std::uint16_t>(entries.data() + 2);
    entries = entries.subspan(kEntryHeader);
    if (length > entries.size()) {
      return;
    }
    read_entry(kind, entries.first(length));
    entries = entries.subspan(length);
  }
}

void PersistentState::read_entry(std::uint16_t kind, std::span<const std::byte> bytes) noexcept {
  switch (kind) {
    case kManifest:
      if (const auto manifest = protocol::decode<CalibrationManifest>(bytes)) {
        calibrations_.add(*manifest);
      }
      return;
    case kSetting:
      if (const auto setting = protocol::decode<KeyValueSet>(bytes)) {
        settings_.set(setting->key.str(), setting->value.str());
      }
      return;
    case kCounters:
      if (const auto counters = protocol::decode<Counters>(bytes)) {
        counters_ = *counters;
      }
      return;
    default:
      return;
  }
}

StatusCode PersistentState::store(const CalibrationStore& calibrations, const Counters& counters) noexcept {
  if (report_.condition == StoreReport::Condition::kLaterVersion) {
    return StatusCode::kFailedPrecondition;
  }
  if (!mounted_) {
    return StatusCode::kResourceExhausted;
  }
  EntryWriter entries(store_.payload());
  entries.add(kCounters, counters);
  calibrations.each([&](const CalibrationManifest& manifest) { entries.add(kManifest, manifest); });
  for (std::size_t i = 0; i < Settings::kWritable.size(); ++i) {
    if (!settings_.value(i).empty()) {
      KeyValueSet setting;
      setting.key = Settings::kWritable[i];
      setting.value = settings_.value(i);
      entries.add(kSetting, setting);
    }
  }
  const bool written = store_.write(entries.size());
  report_.bad_places = store_.report().bad_places;
  report_.whole_copies = store_.report().whole_copies;
  return written ? StatusCode::kOk : StatusCode::kDataLoss;
}

StatusCode PersistentState::store_changed(const Counters& counters) noexcept {
  const StatusCode status = store(changed_, counters);
  if (status == StatusCode::kOk) {
    calibrations_ = changed_;
    counters_ = counters;
  }
  return status;
}

StatusCode PersistentState::commit(CalibrationManifest manifest) noexcept {
  Counters counters = counters_;
  manifest.sequence = ++counters.commits;
  changed_ = calibrations_;
  changed_.add(manifest);
  return store_changed(counters);
}

StatusCode PersistentState::undo(protocol::Target kind) noexcept {
  if (!calibrations_.can_undo(kind)) {
    return StatusCode::kNotFound;
  }
  changed_ = calibrations_;
  changed_.undo(kind);
  return store_changed(counters_);
}

StatusCode PersistentState::restore_factory() noexcept {
  changed_.clear();
  return store_changed(counters_);
}

StatusCode PersistentState::set(const KeyValueSet& setting) noexcept {
  const auto known = settings_.get(setting.key.str());
  if (!known) {
    return StatusCode::kNotFound;
  }
  if (known->read_only != 0) {
    return StatusCode::kPermissionDenied;
  }
  settings_.set(setting.key.str(), setting.value.str());
  const StatusCode status = store(calibrations_, counters_);
  if (status != StatusCode::kOk) {
    settings_.set(known->key.str(), known->value.str());
  }
  return status;
}

}  // namespace scatter::firmware
