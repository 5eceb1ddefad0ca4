// The bulk endpoints of interface 0 as the carrier of frames.
#pragma once

#include <cstddef>
#include <span>

#include "firmware/ports/ports.h"
#include "firmware/ports/usb_controller.h"

namespace scatter::firmware {

/// A host is attached while alternate setting 1 of interface 0 is selected; UsbDevice says so. Each wire
/// frame ends a USB transfer. RAM: 12 B on a Cortex-M7. Threads: one, that of the main loop.
class UsbLink final : public Link {
 public:
  explicit UsbLink(UsbController& controller) noexcept : controller_(controller) {}

  [[nodiscard]] std::size_t read(std::span<std::byte> out) noexcept override;
  /// Without a host the bytes are discarded.
  [[nodiscard]] std::size_t write(std::span<const std::byte> bytes) noexcept override;
  void end_frame() noexcept override;
  [[nodiscard]] bool drained() noexcept override;
  /// For the core alone: having been told of a detach lets the next host in, so that each SET_INTERFACE ends
  /// run and session even when another one follows before the core's next turn.
  [[nodiscard]] bool connected() noexcept override;

  /// A host selected the setting with endpoints: pipes are new and empty. Attached from the turn after the
  /// core was told of the detach.
  void open() noexcept;
  void close() noexcept;
  /// Lets a waiting host in; true when it did so.
  bool turn() noexcept;

 private:
  UsbController& controller_;
  bool open_ = false;      // The setting with endpoints is selected.
  bool attached_ = false;  // What connected() says.
  bool told_ = true;       // The core knows that nobody is attached.
};

}  // namespace scatter::firmware
