// What schema v1.0 of BiRD asks of the metadata. Internal to the reader.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "host_sdk/formats/reader_warnings.h"
#include "host_sdk/formats/text_scanner.h"

namespace scatter::formats {

/// Collects the keys of "metadata" while a file is read.
class BirdMetadataCheck {
 public:
  void see_key(std::string_view key) {
    const auto it = std::ranges::find(kRequired, key);
    if (it != kRequired.end()) {
      seen_[static_cast<std::size_t>(it - kRequired.begin())] = true;
    }
  }
  void warn(std::string_view type, ReaderWarnings& warnings) const {
    std::string missing;
    for (std::size_t k = 0; k < kRequired.size(); ++k) {
      missing += seen_[k] ? "" : fmt::format("{}{}", missing.empty() ? "" : ", ", kRequired[k]);
    }
    if (!missing.empty()) {
      warnings.add(fmt::format("the metadata lack what BiRD's schema v1.0 requires: {}", missing));
    }
    if (!type.empty() && !same_word(type, "BRDF")) {
      warnings.add(fmt::format("metadata.type is '{}', expected BRDF", type.substr(0, 60)));
    }
  }
  /// "BTDF", "BSSRDF": another quantity, which must not pass for a BRDF.
  [[nodiscard]] static bool is_other_quantity(std::string_view type) noexcept {
    return type.size() <= 8 && type.size() >= 3 && !same_word(type, "BRDF") &&
           same_word(type.substr(type.size() - 2), "DF");
  }

 private:
  static constexpr std::array<std::string_view, 11> kRequired{
      "schema",          "id",       "type",   "timestamp",  "provenance", "description", "method",
      "instrumentation", "software", "sample", "environment"};
  std::array<bool, kRequired.size()> seen_{};
};

}  // namespace scatter::formats
