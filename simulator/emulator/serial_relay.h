// Carries wire frames between a host's socket (frames as they are) and a serial line (COBS).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/link_decoder.h"
#include "protocol/serial.h"
#include "simulator/instrument/virtual_link.h"

namespace scatter::simulator {

/// Decodes and encodes every frame anew; sequence, nonce and payload stay as they are. A damaged frame is
/// dropped and counted, as on a line. A whole frame of a kind that this version does not understand goes on
/// without its payload, so that the other side can refuse it.
///
/// Memory    bounded: kRoom per direction and two frames.
/// Threads   one.
class SerialRelay {
 public:
  /// Bytes that may wait in one direction; more is back-pressure.
  static constexpr std::size_t kRoom = 16 * 1024;

  SerialRelay();

  /// A host comes: what was on the way is gone, half a frame on the line is ended before the next one.
  void attach();
  /// The host leaves: what comes from the device is discarded until the next attach().
  void detach();
  /// The device restarted: nothing more goes to it; what it sent can still be read.
  void device_gone();
  [[nodiscard]] bool attached() const noexcept { return attached_; }

  // The host's side.
  [[nodiscard]] std::size_t writable() const noexcept;
  /// At most writable() bytes.
  void from_host(std::span<const std::byte> bytes);
  /// Nothing has come for longer than a frame takes: half a frame is given up, whole ones inside what it had
  /// claimed go on (SPEC 2.5).
  void host_was_silent();
  [[nodiscard]] std::size_t readable() const noexcept { return to_host_.size(); }
  [[nodiscard]] std::size_t host_read(std::span<std::byte> out);

  // The device's side.
  [[nodiscard]] std::span<const std::byte> to_device() const noexcept { return to_device_.view(); }
  void sent_to_device(std::size_t count) { to_device_.drop_front(count); }
  [[nodiscard]] std::size_t room_from_device() const noexcept;
  /// At most room_from_device() bytes.
  void from_device(std::span<const std::byte> bytes);

  struct Counters {
    protocol::LinkCounters from_host;
    protocol::LinkCounters from_device;
  };
  [[nodiscard]] Counters counters() const noexcept { return {host_.counters(), device_.counters()}; }

 private:
  void send_to_device(std::span<const std::byte> frame);

  std::vector<std::byte> host_buffer_;
  std::vector<std::byte> device_buffer_;
  std::vector<std::byte> scratch_;
  protocol::LinkDecoder host_;
  protocol::SerialDecoder device_;
  ByteQueue to_device_;
  ByteQueue to_host_;
  bool attached_ = false;
};

}  // namespace scatter::simulator
