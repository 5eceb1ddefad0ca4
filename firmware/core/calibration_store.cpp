#include "firmware/core/calibration_store.h"

#include <algorithm>

namespace scatter::firmware {

using protocol::CalibrationManifest;
using protocol::Target;

const CalibrationManifest* CalibrationStore::current(Target kind) const noexcept {
  if (!is_calibration_kind(kind) || kinds_[slot(kind)].empty()) {
    return nullptr;
  }
  const Manifests& manifests = kinds_[slot(kind)];
  return &manifests[manifests.size() - 1];
}

protocol::CalibrationId CalibrationStore::current_id(Target kind) const noexcept {
  const CalibrationManifest* manifest = current(kind);
  return manifest == nullptr ? protocol::CalibrationId{} : manifest->id;
}

void CalibrationStore::add(const CalibrationManifest& manifest) noexcept {
  if (!is_calibration_kind(manifest.kind)) {
    return;
  }
  Manifests& manifests = kinds_[slot(manifest.kind)];
  if (!manifests.push_back(manifest)) {
    std::copy(manifests.begin() + 1, manifests.end(), manifests.begin());
    manifests[manifests.size() - 1] = manifest;
  }
}

bool CalibrationStore::can_undo(Target kind) const noexcept {
  return is_calibration_kind(kind) && kinds_[slot(kind)].size() > 1;
}

bool CalibrationStore::undo(Target kind) noexcept {
  if (!can_undo(kind)) {
    return false;
  }
  Manifests& manifests = kinds_[slot(kind)];
  manifests.resize(manifests.size() - 1);
  return true;
}

void CalibrationStore::clear() noexcept {
  for (Manifests& manifests : kinds_) {
    manifests.clear();
  }
}

protocol::CalibrationListed CalibrationStore::list() const noexcept {
  protocol::CalibrationListed listed;
  each([&listed](const CalibrationManifest& manifest) { listed.manifests.push_back(manifest); });
  // Latest first. By insertion: std::sort recurses, which a small stack forbids.
  const auto later = [](const CalibrationManifest& a, const CalibrationManifest& b) {
    return a.sequence > b.sequence;
  };
  const auto first = listed.manifests.begin();
  for (auto next = first; next != listed.manifests.end(); ++next) {
    std::rotate(std::upper_bound(first, next, *next, later), next, next + 1);
  }
  return listed;
}

}  // namespace scatter::firmware
