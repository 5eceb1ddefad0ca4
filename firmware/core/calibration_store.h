// The manifests that the device remembers: the current and the previous one of each kind. Pure table;
// persistent_state.h keeps it in flash.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/messages.h"

namespace scatter::firmware {

/// Manifests kept per kind.
inline constexpr std::size_t kManifestsPerKind = 2;
/// Dark cap, white, black, translucent.
inline constexpr std::size_t kCalibrationKinds = 4;

/// True for the targets that a calibration can have.
[[nodiscard]] constexpr bool is_calibration_kind(protocol::Target kind) noexcept {
  return kind >= protocol::Target::kDarkCap && kind <= protocol::Target::kTranslucentReference;
}

class CalibrationStore {
 public:
  /// Current manifest of a kind; null when none.
  [[nodiscard]] const protocol::CalibrationManifest* current(protocol::Target kind) const noexcept;
  /// Id of the current manifest; all zero when none.
  [[nodiscard]] protocol::CalibrationId current_id(protocol::Target kind) const noexcept;
  /// Adds a manifest; the oldest of its kind goes when there are more than kManifestsPerKind.
  void add(const protocol::CalibrationManifest& manifest) noexcept;
  /// The previous manifest becomes current. False when there is none.
  bool undo(protocol::Target kind) noexcept;
  [[nodiscard]] bool can_undo(protocol::Target kind) const noexcept;
  void clear() noexcept;
  /// All manifests, newest first.
  [[nodiscard]] protocol::CalibrationListed list() const noexcept;
  /// Calls visit(manifest), older before newer within a kind.
  template <typename Visit>
  void each(Visit&& visit) const noexcept {
    for (const auto& kind : kinds_) {
      for (const protocol::CalibrationManifest& manifest : kind) {
        visit(manifest);
      }
    }
  }

 private:
  using Manifests = protocol::BoundedArray<protocol::CalibrationManifest, kManifestsPerKind>;
  [[nodiscard]] static constexpr std::size_t slot(protocol::Target kind) noexcept {
    return static_cast<std::size_t>(kind) - 1;
  }

  std::array<Manifests, kCalibrationKinds> kinds_{};
};

}  // namespace scatter::firmware
