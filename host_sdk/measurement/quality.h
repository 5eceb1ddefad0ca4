// What a measurement says of itself: one row per check, each with a value, a limit, a verdict and
// what to do about it (instrument.md section 6).
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace scatter::measurement {

enum class Verdict {
  kOk,
  kWarn,        ///< Usable; read the advice.
  kFail,        ///< Do not use before the cause is mended.
  kCannotTell,  ///< The data do not say (tilt of a Lambertian sample).
};

/// "ok", "warn", "fail", "cannot tell".
[[nodiscard]] std::string_view name(Verdict verdict) noexcept;

struct QualityItem {
  std::string name;  ///< Stable identifier with its unit, for example "tilt_x_deg".
  double value = 0;
  double limit = 0;  ///< The verdict turns at this value; 0 with kOk = for information.
  Verdict verdict = Verdict::kOk;
  std::string advice;  ///< What to do; for kOk may say what was found.
};

/// Worst verdict of all rows (kCannotTell counts as kOk).
[[nodiscard]] Verdict overall(const std::vector<QualityItem>& items) noexcept;

}  // namespace scatter::measurement
