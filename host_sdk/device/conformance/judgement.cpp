#include "host_sdk/device/conformance/judgement.h"

namespace scatter::conformance {

namespace {
constexpr std::size_t kKeptComplaints = 4;
}

void Judgement::complain(const std::string& complaint) {
  if (++complaints_ <= kKeptComplaints) {
    finding_.trouble += (finding_.trouble.empty() || skipped_ ? "" : "; ") + complaint;
  }
}

void Judgement::refused(std::string_view what, bool done, ErrorCode found, ErrorCode expected) {
  if (done) {
    complain(fmt::format("{} was accepted when it should be refused with {}", what, scatter::name(expected)));
  } else if (found != expected) {
    complain(fmt::format("{} was answered {} when it should be {}", what, scatter::name(found),
                         scatter::name(expected)));
  }
}

void Judgement::skip(std::string why) {
  if (complaints_ == 0) {
    skipped_ = true;
    finding_.trouble = std::move(why);
  }
}

Finding Judgement::finding() const {
  Finding out = finding_;
  if (complaints_ > 0) {
    out.verdict = Verdict::kFailed;
    if (complaints_ > kKeptComplaints) {
      out.trouble += fmt::format("; and {} more", complaints_ - kKeptComplaints);
    }
  } else if (skipped_) {
    out.verdict = Verdict::kSkipped;
  } else if (only_measured_) {
    out.verdict = Verdict::kMeasured;
  }
  return out;
}

}  // namespace scatter::conformance
