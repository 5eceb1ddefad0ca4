// Which image runs: test, confirm or revert, between two slots that run in place.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "firmware/ports/ports.h"

namespace scatter::firmware {

struct BootDecision {
  enum class Action : std::uint8_t {
    kRun,     ///< Jump to the body of `slot`, at ImageSlots::address(slot) + kImageBodyOffset.
    kRescue,  ///< No image can be started: run Rescue.
  };
  Action action = Action::kRescue;
  std::uint8_t slot = ImageSlots::kCount;  ///< kCount in rescue.
  bool trial = false;                      ///< It goes at the next boot unless it is confirmed.
  std::array<protocol::SlotVerdict, ImageSlots::kCount> verdicts{};
  std::uint32_t lowest_counter = 0;  ///< Images with a lower security counter are refused.
};

/// Chooses, in this order: an image that is ready and was not tried; the confirmed image with the highest
/// number; the other confirmed image; and, unless this boot follows a crash, any other whole image, so that a
/// device with one good image starts. Only images with a trusted signature, for this product, slot and
/// address, with the right body hash are ever chosen, and unconfirmed ones only at or above the lowest
/// counter.
///
/// Before it returns: half-written marks are completed, a trial is marked as tried, an image that was not
/// confirmed in time as reverted. So the next boot decides alike, whatever a power cut did to single cells.
/// Cost      up to two signature checks and the hashes of both bodies; not bounded by a watchdog period.
/// `reason`  of this boot. Threads: none.
[[nodiscard]] BootDecision decide(ImageSlots& slots, Verifier& verifier, std::string_view product,
                                  protocol::ResetReason reason) noexcept;

}  // namespace scatter::firmware
