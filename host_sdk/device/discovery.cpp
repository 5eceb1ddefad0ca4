#include "host_sdk/device/discovery.h"

#include <cstdlib>
#include <sstream>

#include "host_sdk/device/device.h"

namespace scatter::device {

std::vector<Listing> list_devices(const TransportRegistry& registry, const Wait& wait) {
  std::vector<Listing> out;
  const char* named = std::getenv("SCATTER_URIS");
  std::istringstream words(named == nullptr ? "" : named);
  for (std::string uri; words >> uri;) {
    Listing one;
    one.uri = uri;
    const Result<Device> device = Device::open(
        uri, {.registry = &registry, .wait = wait, .host_name = "scatter list", .build_id = "", .nonce = {}});
    if (device) {
      one.state = Listing::State::kFree;
      one.product = std::string(device->hello().product.str());
      one.serial = std::string(device->hello().serial.str());
      one.detail = "firmware " + std::string(device->hello().build_id.str());
    } else {
      one.state =
          device.error().code == ErrorCode::kBusy ? Listing::State::kInUse : Listing::State::kUnreachable;
      one.detail = device.error().what;
      one.remedy = device.error().remedy;
    }
    out.push_back(std::move(one));
  }
  return out;
}

}  // namespace scatter::device
