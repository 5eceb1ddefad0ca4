// The factory set in the shared memory, which production (or the simulated bench) wrote.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/core/factory_set.h"
#include "firmware/ports/ports.h"
#include "protocol/descriptor.h"

namespace scatter::firmware::mps2_an500 {

/// Product that images of this board are signed for while no factory set says otherwise.
inline constexpr std::string_view kBoardProduct = "OpenScatter HS-1 (simulated)";

/// Without a whole factory set the board is "unprovisioned": it starts and answers, so that a host can see
/// what is wrong (the serial number says it), but it has a sensor of one pixel and no illumination, so that
/// no measurement can be configured, and takes no update, since no image is signed for that product.
class FactoryMemory final : public Factory {
 public:
  constexpr FactoryMemory() noexcept = default;
  /// Reads and checks the set. Once, before anything asks.
  void start() noexcept;
  [[nodiscard]] const protocol::Descriptor& descriptor() noexcept override { return descriptor_; }
  [[nodiscard]] std::span<const std::byte> object(protocol::ObjectId id) noexcept override;
  [[nodiscard]] bool provisioned() const noexcept { return set_.verdict == FactoryVerdict::kWhole; }

 private:
  protocol::Descriptor descriptor_;
  FactorySet set_;
};

}  // namespace scatter::firmware::mps2_an500
