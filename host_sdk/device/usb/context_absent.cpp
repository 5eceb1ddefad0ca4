// In place of context.cpp where libusb was missing at build time: says so, and what to do about it.
#include "host_sdk/device/usb/context.h"

#include <utility>

namespace scatter::device::usb {
namespace {

std::unexpected<Error> absent() {
  return fail(ErrorCode::kUnimplemented, "usb: this build has no libusb",
              "apt-get install libusb-1.0-0-dev, then configure and build again");
}

}  // namespace

struct Context::State {};
struct Subscription {};

Result<Context> Context::make(const ContextOptions& /*options*/) {
  return absent();
}

Context::Context(std::shared_ptr<State> state) noexcept : state_(std::move(state)) {}
Context::Context(Context&&) noexcept = default;
Context& Context::operator=(Context&&) noexcept = default;
Context::~Context() = default;

Result<std::unique_ptr<Transport>> Context::open(const Uri& /*uri*/, const Wait& /*wait*/) const {
  return absent();
}

void Context::add_scheme(TransportRegistry& registry) const {
  add_usb_scheme(registry);
}

Watch Context::watch(std::function<void(const Change&)> /*changed*/, bool /*present*/) const {
  return Watch();
}

Watch::Watch(std::shared_ptr<Subscription> subscription) noexcept : subscription_(std::move(subscription)) {}
Watch::Watch(Watch&&) noexcept = default;
Watch& Watch::operator=(Watch&&) noexcept = default;
Watch::~Watch() = default;

void add_usb_scheme(TransportRegistry& registry, const ContextOptions& /*options*/) {
  registry.add(
      {.name = "usb",
       .example = "usb: or usb:serial=SC42",
       .summary = "instrument on this computer's USB",
       .open = [](const Uri&, const Wait&) -> Result<std::unique_ptr<Transport>> { return absent(); }});
}

}  // namespace scatter::device::usb
