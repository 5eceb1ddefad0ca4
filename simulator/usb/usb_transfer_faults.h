// Which IN transfers of the bulk pipe break, and how: by seed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simulator/faults/fault_plan.h"
#include "simulator/faults/fault_random.h"

namespace scatter::simulator {

/// How often each fault struck.
struct UsbFaultCounts {
  std::uint64_t transfers = 0;  ///< IN transfers of the bulk pipe that had bytes or an end to carry.
  std::uint64_t stalls = 0;
  std::uint64_t shorts = 0;
  std::uint64_t babbles = 0;
};

/// The fate of transfer n since power-on follows from (seed, n) alone. Threads: one.
class UsbTransferFaults {
 public:
  enum class Fate : std::uint8_t { kWhole, kStall, kBabble, kShort };
  struct Verdict {
    Fate fate = Fate::kWhole;
    std::size_t keep = 0;  ///< kShort: bytes before the early end.
  };

  UsbTransferFaults(const UsbRates& rates, std::uint64_t seed) : rates_(rates), seed_(seed) {}

  /// Of the next transfer, which would carry `size` bytes.
  [[nodiscard]] Verdict next(std::size_t size) noexcept {
    const std::uint64_t index = counts_.transfers++;
    if (!rates_.any()) {
      return {};
    }
    if (fault_strikes(seed_, FaultKey::kUsbStall, index, rates_.stall)) {
      ++counts_.stalls;
      return {.fate = Fate::kStall};
    }
    if (fault_strikes(seed_, FaultKey::kUsbBabble, index, rates_.babble)) {
      ++counts_.babbles;
      return {.fate = Fate::kBabble};
    }
    if (size > 0 && fault_strikes(seed_, FaultKey::kUsbShort, index, rates_.short_read)) {
      const std::size_t keep = fault_draw(seed_, FaultKey::kUsbShort, index, 1)[0] % size;
      // Two empty ones in a row are left out, so that a rate of 1 still lets bytes through.
      if (keep > 0 || !last_was_empty_) {
        last_was_empty_ = keep == 0;
        ++counts_.shorts;
        return {.fate = Fate::kShort, .keep = keep};
      }
    }
    last_was_empty_ = false;
    return {};
  }
  [[nodiscard]] const UsbFaultCounts& counts() const noexcept { return counts_; }

 private:
  UsbRates rates_;
  std::uint64_t seed_;
  UsbFaultCounts counts_;
  bool last_was_empty_ = false;
};

}  // namespace scatter::simulator
