#include "simulator/emulator/serial_relay.h"

#include <algorithm>
#include <array>

namespace scatter::simulator {
namespace {

constexpr std::size_t kSerialFrameBytes = protocol::kFrameOverhead + protocol::kMaxSerialPayload;
// A frame of a kind not understood, without its payload.
using BareFrame = std::array<std::byte, protocol::kFrameOverhead>;

BareFrame bare(const protocol::FrameHeader& header) {
  BareFrame frame{};
  (void)protocol::write_frame(frame, header, {});
  return frame;
}

}  // namespace

SerialRelay::SerialRelay()
    : host_buffer_(kSerialFrameBytes),
      device_buffer_(kSerialFrameBytes),
      scratch_(protocol::serial_max_size(protocol::kMaxSerialPayload)),
      host_(host_buffer_, protocol::kMaxSerialPayload),
      device_(device_buffer_, protocol::kMaxSerialPayload) {}

void SerialRelay::attach() {
  host_.reset();
  device_.reset();
  to_device_.clear();
  to_host_.clear();
  attached_ = true;
}

void SerialRelay::detach() {
  to_device_.clear();
  to_host_.clear();
  attached_ = false;
}

void SerialRelay::device_gone() {
  to_device_.clear();
  attached_ = false;
}

std::size_t SerialRelay::writable() const noexcept {
  // Smallest frames grow most, by three bytes in 28; a held-back frame may come along.
  const std::size_t taken = to_device_.size() + kSerialFrameBytes;
  return attached_ && taken < kRoom ? (kRoom - taken) * 8 / 10 : 0;
}

void SerialRelay::from_host(std::span<const std::byte> bytes) {
  host_.push(
      bytes, [this](const protocol::Frame& frame) { send_to_device(frame.bytes()); },
      [this](const protocol::FrameHeader& header, protocol::ParseStatus) { send_to_device(bare(header)); });
}

void SerialRelay::host_was_silent() {
  host_.give_up([this](const protocol::Frame& frame) { send_to_device(frame.bytes()); });
}

void SerialRelay::send_to_device(std::span<const std::byte> frame) {
  const std::size_t size = protocol::write_serial(scratch_, frame, to_device_.size() == 0);
  to_device_.push(std::span<const std::byte>(scratch_).first(size));
}

std::size_t SerialRelay::host_read(std::span<std::byte> out) {
  const std::size_t count = std::min(out.size(), to_host_.size());
  std::ranges::copy(to_host_.view().first(count), out.begin());
  to_host_.drop_front(count);
  return count;
}

std::size_t SerialRelay::room_from_device() const noexcept {
  // COBS only shrinks on decoding; one held-back frame may come along.
  const std::size_t taken = to_host_.size() + kSerialFrameBytes;
  return taken < kRoom ? kRoom - taken : 0;
}

void SerialRelay::from_device(std::span<const std::byte> bytes) {
  const auto deliver = [this](std::span<const std::byte> frame) {
    if (attached_) {
      to_host_.push(frame);
    }
  };
  device_.push(
      bytes, [&](const protocol::Frame& frame) { deliver(frame.bytes()); },
      [&](const protocol::FrameHeader& header, protocol::ParseStatus) { deliver(bare(header)); });
}

}  // namespace scatter::simulator
