#include "firmware/boot/boot_decision.h"

#include "firmware/image/body_check.h"
#include "firmware/image/marks.h"
#include "firmware/image/slot_view.h"

namespace scatter::firmware {
namespace {

using protocol::ResetReason;
using protocol::SlotVerdict;

/// Both slots while the decision is made.
class Choice {
 public:
  Choice(ImageSlots& slots, Verifier& verifier, std::string_view product) noexcept : slots_(slots) {
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      views_[i] = view_slot(slots, i, verifier, product);
      if (views_[i].header_good) {
        // Before anything is concluded from it. When the unit takes no more the one copy has to do.
        (void)repair_marks(slots.slot(i), views_[i].marks);
      }
    }
    lowest_ = scatter::firmware::lowest_counter(views_);
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      if (views_[i].header_good) {
        judge(i, verifier);
      }
    }
  }

  [[nodiscard]] std::uint8_t ready() noexcept {
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      if (whole_[i] && views_[i].marks.last == MarkKind::kReady &&
          write_mark(slots_.slot(i), MarkKind::kTried)) {
        views_[i].verdict = SlotVerdict::kTrial;
        views_[i].marks.last = MarkKind::kTried;
        return i;
      }
    }
    return ImageSlots::kCount;
  }

  [[nodiscard]] std::uint8_t confirmed() const noexcept {
    std::uint8_t best = ImageSlots::kCount;
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      if (whole_[i] && views_[i].marks.last == MarkKind::kConfirmed &&
          (best == ImageSlots::kCount || views_[i].marks.number > views_[best].marks.number)) {
        best = i;
      }
    }
    return best;
  }

  /// A whole image that was tried before one that never got so far.
  [[nodiscard]] std::uint8_t last_resort() noexcept {
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      if (whole_[i] &&
          (views_[i].marks.last == MarkKind::kTried || views_[i].marks.last == MarkKind::kReverted)) {
        return i;
      }
    }
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      if (whole_[i]) {
        // It is started even when the mark cannot be written: there is nothing else to start.
        (void)write_mark(slots_.slot(i), MarkKind::kTried);
        views_[i].verdict = SlotVerdict::kTrial;
        return i;
      }
    }
    return ImageSlots::kCount;
  }

  void revert_all_but(std::uint8_t chosen) noexcept {
    for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
      if (i == chosen || !views_[i].header_good || views_[i].marks.last != MarkKind::kTried) {
        continue;
      }
      (void)write_mark(slots_.slot(i), MarkKind::kReverted);
      if (views_[i].verdict == SlotVerdict::kTrial) {
        views_[i].verdict = SlotVerdict::kReverted;
      }
    }
  }

  [[nodiscard]] SlotVerdict verdict(std::uint8_t i) const noexcept { return views_[i].verdict; }
  [[nodiscard]] std::uint32_t lowest_counter() const noexcept { return lowest_; }

 private:
  void judge(std::uint8_t i, Verifier& verifier) noexcept {
    SlotView& view = views_[i];
    if (view.marks.last != MarkKind::kConfirmed && view.header.security_counter < lowest_) {
      view.verdict = SlotVerdict::kRolledBack;
      return;
    }
    BodyCheck body;
    body.begin(slots_.slot(i), view.header, verifier);
    switch (body.run()) {
      case BodyCheck::Result::kGood:
        whole_[i] = true;
        return;
      case BodyCheck::Result::kUnreadable:
        view.verdict = SlotVerdict::kUnreadable;
        return;
      default:
        if (view.marks.last != MarkKind::kNone) {  // Else nobody said that it was complete.
          view.verdict = SlotVerdict::kBadBody;
        }
        return;
    }
  }

  ImageSlots& slots_;
  std::array<SlotView, ImageSlots::kCount> views_{};
  std::array<bool, ImageSlots::kCount> whole_{};  // Signed, allowed, and the body's hash is right.
  std::uint32_t lowest_ = 0;
};

}  // namespace

BootDecision decide(ImageSlots& slots, Verifier& verifier, std::string_view product,
                    ResetReason reason) noexcept {
  Choice choice(slots, verifier, product);
  BootDecision decision;
  decision.lowest_counter = choice.lowest_counter();
  decision.slot = choice.ready();
  decision.trial = decision.slot != ImageSlots::kCount;
  if (decision.slot == ImageSlots::kCount) {
    decision.slot = choice.confirmed();
  }
  // An unconfirmed image that crashes must not be started for ever: rescue mode is the way out.
  const bool crashed = reason == ResetReason::kWatchdog || reason == ResetReason::kFault;
  if (decision.slot == ImageSlots::kCount && !crashed) {
    decision.slot = choice.last_resort();
    decision.trial = decision.slot != ImageSlots::kCount;
  }
  if (decision.slot != ImageSlots::kCount) {
    decision.action = BootDecision::Action::kRun;
    choice.revert_all_but(decision.slot);
  }
  for (std::uint8_t i = 0; i < ImageSlots::kCount; ++i) {
    decision.verdicts[i] = choice.verdict(i);
  }
  return decision;
}

}  // namespace scatter::firmware
