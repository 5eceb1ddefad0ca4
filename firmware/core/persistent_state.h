// What survives a power cycle: calibration manifests, settings, boot count. Each change is one record
// of the flash log; when a half is full the live records move to the other one.
#pragma once

#include <cstdint>

#include "firmware/core/calibration_store.h"
#include "firmware/core/flash_log.h"
#include "firmware/core/settings.h"

namespace scatter::firmware {

class PersistentState final : private FlashLog::Reader {
 public:
  PersistentState(Flash& flash, const protocol::Descriptor& descriptor) noexcept
      : log_(flash), settings_(descriptor) {}

  /// Reads the flash and counts this boot. Call once, before anything else.
  void mount() noexcept;
  /// False: the flash is unusable; everything lives in RAM only and changes answer kResourceExhausted.
  [[nodiscard]] bool mounted() const noexcept { return mounted_; }
  /// Damaged stretches stepped over by mount.
  [[nodiscard]] std::uint32_t recovered() const noexcept { return log_.recovered(); }
  [[nodiscard]] std::uint32_t boot_count() const noexcept { return counters_.boots; }

  [[nodiscard]] const CalibrationStore& calibrations() const noexcept { return calibrations_; }
  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }

  /// Changes take effect only when they are in flash: kOk, kResourceExhausted (log full or no flash) or
  /// kDataLoss (the flash refused). commit gives the manifest its sequence number.
  [[nodiscard]] protocol::StatusCode commit(protocol::CalibrationManifest manifest) noexcept;
  /// kNotFound when the kind has no previous manifest.
  [[nodiscard]] protocol::StatusCode undo(protocol::Target kind) noexcept;
  [[nodiscard]] protocol::StatusCode restore_factory() noexcept;
  /// kNotFound for an unknown key, kPermissionDenied for a read-only one.
  [[nodiscard]] protocol::StatusCode set(const protocol::KeyValueSet& setting) noexcept;

 private:
  // Numbers are part of the flash format.
  enum RecordKind : std::uint16_t { kManifest = 1, kUndo = 2, kRestore = 3, kSetting = 4, kCounters = 5 };
  struct Undo {
    protocol::Target kind = protocol::Target::kWhiteReference;
    static constexpr auto schema() { return protocol::fields(protocol::field("kind", &Undo::kind, "", "")); }
  };
  struct Counters {
    std::uint32_t boots = 0;
    std::uint32_t commits = 0;
    static constexpr auto schema() {
      return protocol::fields(protocol::field("boots", &Counters::boots, "", ""),
                              protocol::field("commits", &Counters::commits, "", ""));
    }
  };

  void record(std::uint16_t kind, std::span<const std::byte> payload) noexcept override;
  template <typename T>
  [[nodiscard]] FlashLog::Append write(RecordKind kind, const T& value) noexcept;
  template <typename T>
  [[nodiscard]] protocol::StatusCode persist(RecordKind kind, const T& value) noexcept;
  [[nodiscard]] bool compact() noexcept;

  FlashLog log_;
  CalibrationStore calibrations_;
  Settings settings_;
  Counters counters_;
  bool mounted_ = false;
};

}  // namespace scatter::firmware
