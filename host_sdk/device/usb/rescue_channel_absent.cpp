// Stands in for rescue_channel.cpp in builds without hidapi.
#include "host_sdk/device/usb/rescue_channel.h"

namespace scatter::device::usb {
namespace {

std::unexpected<Error> absent() {
  return fail(ErrorCode::kUnimplemented, "this program was built without hidapi",
              "install libhidapi-dev and build it again");
}

}  // namespace

struct RescueChannel::State {};

RescueChannel::RescueChannel(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
RescueChannel::RescueChannel(RescueChannel&&) noexcept = default;
RescueChannel& RescueChannel::operator=(RescueChannel&&) noexcept = default;
RescueChannel::~RescueChannel() = default;

Result<RescueChannel> RescueChannel::open(std::string_view /*serial*/, const Wait& /*wait*/) {
  return absent();
}
Result<RescueChannel> RescueChannel::open_at(std::string_view /*port*/, const Wait& /*wait*/) {
  return absent();
}
// None of these can be called: open() never gives a channel.
Result<protocol::RescueStatus> RescueChannel::status(const Wait& /*wait*/) {
  return absent();
}
Status RescueChannel::abort(const Wait& /*wait*/) {
  return absent();
}
Status RescueChannel::reboot(const Wait& /*wait*/) {
  return absent();
}
Result<protocol::FaultRecord> RescueChannel::fault_record(const Wait& /*wait*/) {
  return absent();
}
Status RescueChannel::wait_for_button(const Wait& /*wait*/) {
  return absent();
}
Status RescueChannel::wait_for_button(const protocol::RescueStatus& /*since*/, const Wait& /*wait*/) {
  return absent();
}

}  // namespace scatter::device::usb
