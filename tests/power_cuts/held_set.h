// What the device should hold, kept by the rules of SPEC.md and by nothing of the firmware.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "firmware/core/persistent_state.h"
#include "protocol/messages.h"

namespace scatter::power_cuts {

/// What a host can ask for.
struct Answer {
  std::vector<protocol::CalibrationManifest> manifests;  ///< Newest first.
  std::array<std::uint8_t, 4> current{};  ///< First byte of the id in force per kind, 0 = none.
  std::string name;
  std::string location;
  friend bool operator==(const Answer&, const Answer&) = default;
};

inline Answer answer_of(const firmware::PersistentState& state) {
  Answer answer;
  const protocol::CalibrationListed listed = state.calibrations().list();
  answer.manifests.assign(listed.manifests.begin(), listed.manifests.end());
  for (std::size_t i = 0; i < answer.current.size(); ++i) {
    answer.current[i] = state.calibrations().current_id(static_cast<protocol::Target>(i + 1))[0];
  }
  answer.name = state.settings().get("name")->value.str();
  answer.location = state.settings().get("location")->value.str();
  return answer;
}

class HeldSet {
 public:
  void commit(protocol::CalibrationManifest manifest) {
    manifest.sequence = ++commits_;
    auto& kind = kinds_.at(static_cast<std::size_t>(manifest.kind) - 1);
    kind.push_back(manifest);
    if (kind.size() > 2) {
      kind.erase(kind.begin());
    }
  }
  void undo(protocol::Target kind) { kinds_.at(static_cast<std::size_t>(kind) - 1).pop_back(); }
  void restore() { kinds_ = {}; }
  void set(const std::string& key, const std::string& value) { (key == "name" ? name_ : location_) = value; }

  [[nodiscard]] Answer answer() const {
    Answer answer{.manifests = {}, .current = {}, .name = name_, .location = location_};
    for (std::size_t i = 0; i < kinds_.size(); ++i) {
      answer.manifests.insert(answer.manifests.end(), kinds_[i].begin(), kinds_[i].end());
      answer.current[i] = kinds_[i].empty() ? std::uint8_t{0} : kinds_[i].back().id[0];
    }
    std::ranges::sort(answer.manifests, [](const auto& a, const auto& b) { return a.sequence > b.sequence; });
    return answer;
  }

 private:
  std::array<std::vector<protocol::CalibrationManifest>, 4> kinds_;
  std::string name_;
  std::string location_;
  std::uint32_t commits_ = 0;
};

}  // namespace scatter::power_cuts
