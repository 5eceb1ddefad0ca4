// usb_holder URI: opens an instrument, starts an endless run, prints "streaming" with its first frame, and
// takes frames until it is killed.
#include <cstdio>

#include "host_sdk/device/device.h"
#include "host_sdk/device/usb/context.h"

using namespace scatter;

namespace {

int fail_with(const Error& error) {
  std::printf("%s\n%s\n", error.what.c_str(), error.remedy.c_str());
  return 1;
}

}  // namespace

int main(int count, char** words) {
  const auto context = device::usb::Context::make();
  if (!context) {
    return fail_with(context.error());
  }
  device::TransportRegistry registry;
  context->add_scheme(registry);
  device::OpenOptions options;
  options.registry = &registry;
  auto device = device::Device::open(count > 1 ? words[1] : "usb:", options);
  if (!device) {
    return fail_with(device.error());
  }
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1000);
  recipe.repeats = 65535;
  recipe.region_width = recipe.region_height = 64;
  recipe.test_pattern = 1;
  if (const auto configured = device->configure(recipe); !configured) {
    return fail_with(configured.error());
  }
  auto stream = device->start();
  if (!stream) {
    return fail_with(stream.error());
  }
  for (bool first = true;; first = false) {
    const auto frame = stream->next();
    if (!frame) {
      return fail_with(frame.error());
    }
    if (first) {
      std::printf("streaming\n");
      std::fflush(stdout);
    }
  }
}
