// Which instruments are there.
#pragma once

#include <string>
#include <vector>

#include "host_sdk/device/transport.h"
#include "host_sdk/device/wait.h"
#include "host_sdk/error/error.h"

namespace scatter::device {

struct Listing {
  enum class State { kFree, kInUse, kUnreachable };
  std::string uri;
  State state = State::kUnreachable;
  std::string product;  ///< When kFree.
  std::string serial;   ///< When kFree.
  std::string detail;   ///< Firmware version, who holds it, or what went wrong.
  std::string remedy;   ///< "" when kFree.
};

/// Looks at the URIs that the environment variable SCATTER_URIS names (separated by spaces).
/// A device that another host holds answers BUSY and is not disturbed.
/// Cost  at most wait.timeout per URI.
[[nodiscard]] std::vector<Listing> list_devices(const TransportRegistry& registry,
                                                const Wait& wait = {.timeout = std::chrono::seconds(1)});

}  // namespace scatter::device
