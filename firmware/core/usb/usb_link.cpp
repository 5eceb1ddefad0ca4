#include "firmware/core/usb/usb_link.h"

#include "protocol/usb_identity.h"

namespace scatter::firmware {

std::size_t UsbLink::read(std::span<std::byte> out) noexcept {
  return attached_ ? controller_.read(protocol::usb::kBulkOut, out) : 0;
}

std::size_t UsbLink::write(std::span<const std::byte> bytes) noexcept {
  return attached_ ? controller_.write(protocol::usb::kBulkIn, bytes) : bytes.size();
}

void UsbLink::end_frame() noexcept {
  if (attached_) {
    controller_.end_transfer(protocol::usb::kBulkIn);
  }
}

bool UsbLink::drained() noexcept {
  return !attached_ || controller_.waiting(protocol::usb::kBulkIn) == 0;
}

bool UsbLink::connected() noexcept {
  told_ = told_ || !attached_;
  return attached_;
}

void UsbLink::open() noexcept {
  told_ = told_ && !attached_;
  attached_ = false;
  open_ = true;
}

void UsbLink::close() noexcept {
  told_ = told_ && !attached_;
  attached_ = false;
  open_ = false;
}

bool UsbLink::turn() noexcept {
  if (!open_ || attached_ || !told_) {
    return false;
  }
  attached_ = true;
  return true;
}

}  // namespace scatter::firmware
