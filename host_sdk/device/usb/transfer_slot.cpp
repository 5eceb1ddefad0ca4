#include "host_sdk/device/usb/transfer_slot.h"

#include <fcntl.h>
#include <libusb.h>
#include <unistd.h>

#include <new>

#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

using protocol::usb::kTransferBytes;

constexpr auto kPage = std::align_val_t(4096);

/// A mapping that nothing stands behind would end the program at the first touch; the kernel only refuses.
bool backed(std::byte* memory) {
  const int zeros = ::open("/dev/zero", O_RDONLY | O_CLOEXEC);
  if (zeros < 0) {
    return false;
  }
  const bool whole = ::read(zeros, memory, kTransferBytes) == static_cast<ssize_t>(kTransferBytes);
  ::close(zeros);
  return whole;
}

std::byte* kernel_memory_of(libusb_device_handle* handle) {
  auto* const mapped = ::libusb_dev_mem_alloc(handle, kTransferBytes);
  if (mapped != nullptr && !backed(reinterpret_cast<std::byte*>(mapped))) {
    (void)::libusb_dev_mem_free(handle, mapped, kTransferBytes);
    return nullptr;
  }
  return reinterpret_cast<std::byte*>(mapped);
}

}  // namespace

bool TransferSlot::make(libusb_device_handle* handle, std::uint8_t endpoint, bool kernel_memory,
                        void (*completed)(libusb_transfer*), void* user) {
  handle_ = handle;
  transfer_ = ::libusb_alloc_transfer(0);
  memory_ = kernel_memory ? kernel_memory_of(handle) : nullptr;
  of_kernel_ = memory_ != nullptr;
  if (!of_kernel_) {
    memory_ = static_cast<std::byte*>(::operator new(kTransferBytes, kPage, std::nothrow));
  }
  if (transfer_ == nullptr || memory_ == nullptr) {
    return false;
  }
  ::libusb_fill_bulk_transfer(transfer_, handle, endpoint, reinterpret_cast<unsigned char*>(memory_),
                              static_cast<int>(kTransferBytes), completed, user, 0);
  return true;
}

void TransferSlot::free() noexcept {
  if (of_kernel_) {
    (void)::libusb_dev_mem_free(handle_, reinterpret_cast<unsigned char*>(memory_), kTransferBytes);
  } else if (memory_ != nullptr) {
    ::operator delete(memory_, kPage);
  }
  ::libusb_free_transfer(transfer_);
  transfer_ = nullptr;
  memory_ = nullptr;
  of_kernel_ = false;
}

}  // namespace scatter::device::usb
