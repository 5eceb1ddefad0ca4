// One libusb transfer with the memory that it fills or sends. Internal to this folder.
#pragma once

#include <cstddef>
#include <cstdint>

struct libusb_device_handle;
struct libusb_transfer;  // NOLINT(readability-identifier-naming): theirs

namespace scatter::device::usb {

/// Memory of protocol::usb::kTransferBytes: the kernel's where the system gives such, so that what comes is
/// not copied on its way into the program; else the heap's, on a page of its own. Threads  one; while the
/// transfer is under way it is the kernel's.
class TransferSlot {
 public:
  TransferSlot() = default;
  TransferSlot(const TransferSlot&) = delete;
  TransferSlot& operator=(const TransferSlot&) = delete;
  ~TransferSlot() { free(); }

  /// `completed` gets the transfer back with `user` in user_data. False: no memory.
  [[nodiscard]] bool make(libusb_device_handle* handle, std::uint8_t endpoint, bool kernel_memory,
                          void (*completed)(libusb_transfer*), void* user);
  /// Not while it is under way, and before the handle is closed.
  void free() noexcept;

  [[nodiscard]] libusb_transfer* transfer() const noexcept { return transfer_; }
  [[nodiscard]] std::byte* memory() const noexcept { return memory_; }

 private:
  libusb_device_handle* handle_ = nullptr;
  libusb_transfer* transfer_ = nullptr;
  std::byte* memory_ = nullptr;
  bool of_kernel_ = false;
};

}  // namespace scatter::device::usb
