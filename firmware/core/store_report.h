// What the store of calibrations and settings found at power-on, in numbers and in words.
#pragma once

#include <cstdint>

#include "firmware/core/text.h"
#include "protocol/messages.h"

namespace scatter::firmware {

struct StoreReport {
  enum class Condition : std::uint8_t {
    kWhole,         ///< Both copies were there, or the flash was empty.
    kRecovered,     ///< Something was damaged or missing; see the counts.
    kLaterVersion,  ///< A later firmware's store: left untouched.
    kUnusable,      ///< No flash, too small, or it cannot be written.
  };
  Condition condition = Condition::kUnusable;
  std::uint32_t damaged = 0;     ///< Records newer than the one in force that are not whole: changes that a
                                 ///< power cut interrupted, or lost to rot.
  std::uint8_t copy_used = 0;    ///< 1 or 2; 0: there was no whole record.
  std::uint8_t copy_mended = 0;  ///< 1 or 2: this one lacked the newest record and was written anew; 0: none.
  std::uint32_t bad_places = 0;  ///< Places that could not be erased or programmed since mount; passed over.
  std::uint8_t whole_copies = 0;  ///< Of the newest record, now.
};

/// kNone when there is nothing to tell.
[[nodiscard]] protocol::FaultCode fault_of(const StoreReport& report) noexcept;
/// What happened, for people.
[[nodiscard]] Text text_of(const StoreReport& report) noexcept;

}  // namespace scatter::firmware
