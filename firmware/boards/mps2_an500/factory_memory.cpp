#include "firmware/boards/mps2_an500/factory_memory.h"

#include "firmware/backplane/shared_memory.h"

namespace scatter::firmware::mps2_an500 {
namespace {

[[nodiscard]] std::string_view name_of(FactoryVerdict verdict) noexcept {
  switch (verdict) {
    case FactoryVerdict::kAbsent:
      return "no factory set";
    case FactoryVerdict::kUnfinished:
      return "factory set unfinished";
    case FactoryVerdict::kLaterVersion:
      return "factory set too new";
    default:
      return "factory set damaged";
  }
}

}  // namespace

void FactoryMemory::start() noexcept {
  const auto* memory =
      reinterpret_cast<const std::byte*>(backplane::kSharedMemoryAddress + backplane::kFactoryOffset);
  set_ = read_factory_set({memory, backplane::kFactoryBytes}, descriptor_);
  if (provisioned()) {
    return;
  }
  descriptor_ = {};
  descriptor_.product = "unprovisioned";
  descriptor_.serial = name_of(set_.verdict);
  descriptor_.sensor.width_px = 1;
  descriptor_.sensor.height_px = 1;
  descriptor_.sensor.bits = 10;
  descriptor_.sensor.min_exposure_us = 1;
  descriptor_.sensor.max_exposure_us = 1;
}

std::span<const std::byte> FactoryMemory::object(protocol::ObjectId id) noexcept {
  switch (id) {
    case protocol::ObjectId::kHotPixels:
      return set_.objects.hot_pixels;
    case protocol::ObjectId::kPrnuMap:
      return set_.objects.prnu_map;
    default:
      return {};  // The core serves the descriptor itself.
  }
}

}  // namespace scatter::firmware::mps2_an500
