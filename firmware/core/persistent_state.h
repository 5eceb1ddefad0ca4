// What survives a power cycle: calibration manifests, settings, boot count. Each change writes all of it as
// one record of the record store, so that there is never a mixture of old and new.
//
// The payload is a list of entries: u16 kind, u16 length, then a message encoded by protocol/codec.h.
#pragma once

#include <cstdint>

#include "firmware/core/calibration_store.h"
#include "firmware/core/record_store.h"
#include "firmware/core/settings.h"

namespace scatter::firmware {

/// RAM: about 4.5 KiB.
class PersistentState final {
 public:
  PersistentState(Flash& flash, const protocol::Descriptor& descriptor) noexcept
      : store_(flash), settings_(descriptor) {}

  /// Reads the flash, then counts this boot, which writes both copies anew: what is true after this call
  /// stays true. Call once, before anything else.
  void mount() noexcept;
  /// False: nothing can be stored; what was found is served, the rest lives in RAM, and changes are refused.
  [[nodiscard]] bool mounted() const noexcept { return mounted_; }
  [[nodiscard]] const StoreReport& report() const noexcept { return report_; }
  [[nodiscard]] std::uint32_t boot_count() const noexcept { return counters_.boots; }

  [[nodiscard]] const CalibrationStore& calibrations() const noexcept { return calibrations_; }
  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }

  /// Changes take effect only when they are in flash: kOk; kResourceExhausted: there is no flash to write to;
  /// kFailedPrecondition: the store is a later firmware's; kDataLoss: the flash refused. commit gives the
  /// manifest its sequence number.
  [[nodiscard]] protocol::StatusCode commit(protocol::CalibrationManifest manifest) noexcept;
  /// kNotFound when the kind has no previous manifest.
  [[nodiscard]] protocol::StatusCode undo(protocol::Target kind) noexcept;
  [[nodiscard]] protocol::StatusCode restore_factory() noexcept;
  /// kNotFound for an unknown key, kPermissionDenied for a read-only one.
  [[nodiscard]] protocol::StatusCode set(const protocol::KeyValueSet& setting) noexcept;

 private:
  // Numbers are part of the flash format.
  enum EntryKind : std::uint16_t { kManifest = 1, kSetting = 4, kCounters = 5 };
  struct Counters {
    std::uint32_t boots = 0;
    std::uint32_t commits = 0;
    static constexpr auto schema() {
      return protocol::fields(protocol::field("boots", &Counters::boots, "", ""),
                              protocol::field("commits", &Counters::commits, "", ""));
    }
  };

  void read_entries(std::span<const std::byte> entries) noexcept;
  void read_entry(std::uint16_t kind, std::span<const std::byte> bytes) noexcept;
  /// Stores the settings and these calibrations and counters.
  [[nodiscard]] protocol::StatusCode store(const CalibrationStore& calibrations,
                                           const Counters& counters) noexcept;
  /// Stores changed_ and makes it the calibrations in force.
  [[nodiscard]] protocol::StatusCode store_changed(const Counters& counters) noexcept;

  RecordStore store_;
  CalibrationStore calibrations_;
  CalibrationStore changed_;  ///< Being stored, not in force yet.
  Settings settings_;
  Counters counters_;
  StoreReport report_;
  bool mounted_ = false;
};

}  // namespace scatter::firmware
