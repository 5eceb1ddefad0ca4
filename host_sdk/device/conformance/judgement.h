// What a check finds while it runs.
#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

#include "host_sdk/device/conformance/conformance.h"

namespace scatter::conformance {

/// Collects complaints; the first four are kept, the rest counted.
class Judgement {
 public:
  void require(bool holds, std::string_view complaint) {
    if (!holds) {
      complain(std::string(complaint));
    }
  }
  template <typename Expected, typename Found>
  void equal(std::string_view what, const Expected& expected, const Found& found) {
    if (!(found == expected)) {
      complain(fmt::format("{} is {} when it should be {}", what, found, expected));
    }
  }
  void complain(const std::string& complaint);
  /// An error where none was allowed.
  void broken(std::string_view doing, const Error& error) {
    complain(fmt::format("{}: {}", doing, error.what));
  }
  /// `error` must have this code; `done` says that there was none.
  void refused(std::string_view what, bool done, ErrorCode found, ErrorCode expected);
  template <typename T>
  void refused(std::string_view what, const Result<T>& result, ErrorCode expected) {
    refused(what, result.has_value(), result ? ErrorCode::kInternal : result.error().code, expected);
  }

  void measured(std::string figures) { finding_.measured = std::move(figures); }
  /// Nothing is promised about the figure: it is reported.
  void only_measured() noexcept { only_measured_ = true; }
  void skip(std::string why);

  [[nodiscard]] bool good() const noexcept { return complaints_ == 0; }
  [[nodiscard]] Finding finding() const;

 private:
  Finding finding_;
  std::size_t complaints_ = 0;
  bool only_measured_ = false;
  bool skipped_ = false;
};

}  // namespace scatter::conformance
