// What the guest's programs share: opening instruments and telling how they failed.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <optional>
#include <string>

#include "host_sdk/device/device.h"
#include "host_sdk/device/usb/context.h"
#include "host_sdk/error/error.h"

namespace scatter::vm {

/// "error DISCONNECTED: what; remedy", for the shell to look at. Returns the exit status of failure.
inline int report(const Error& error) {
  fmt::print("error {}: {}; {}\n", name(error.code), error.what, error.remedy);
  std::fflush(stdout);
  return 1;
}

/// One host program: USB and the built-in schemes.
class Host {
 public:
  [[nodiscard]] static Result<Host> make() {
    auto context = device::usb::Context::make();
    if (!context) {
      return std::unexpected(context.error());
    }
    return Host(std::move(*context));
  }
  [[nodiscard]] Result<device::Device> open(const std::string& uri) const {
    device::OpenOptions options;
    options.registry = &registry_;
    options.host_name = "vm";
    return device::Device::open(uri, options);
  }
  [[nodiscard]] const device::usb::Context& context() const { return context_; }

 private:
  explicit Host(device::usb::Context context) : context_(std::move(context)) {
    context_.add_scheme(registry_);
  }
  device::usb::Context context_;
  device::TransportRegistry registry_;
};

}  // namespace scatter::vm
