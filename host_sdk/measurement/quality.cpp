#include "host_sdk/measurement/quality.h"

namespace scatter::measurement {

std::string_view name(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kOk:
      return "ok";
    case Verdict::kWarn:
      return "warn";
    case Verdict::kFail:
      return "fail";
    case Verdict::kCannotTell:
      return "cannot tell";
  }
  return "fail";
}

Verdict overall(const std::vector<QualityItem>& items) noexcept {
  Verdict worst = Verdict::kOk;
  for (const QualityItem& item : items) {
    if (item.verdict == Verdict::kFail) {
      return Verdict::kFail;
    }
    if (item.verdict == Verdict::kWarn) {
      worst = Verdict::kWarn;
    }
  }
  return worst;
}

}  // namespace scatter::measurement
