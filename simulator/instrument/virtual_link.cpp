#include "simulator/instrument/virtual_link.h"

#include <algorithm>

namespace scatter::simulator {

void ByteQueue::drop_front(std::size_t count) {
  read_ += count;
  if (read_ == bytes_.size()) {
    clear();
  } else if (read_ > bytes_.size() / 2 && read_ > 4096) {
    bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(read_));
    read_ = 0;
  }
}

VirtualLink::VirtualLink(VirtualClock& clock, const FaultPlan& plan, std::uint64_t seed)
    : clock_(clock),
      lanes_{Lane{.queue = {}, .faults = {plan, seed, Direction::kToHost}},
             Lane{.queue = {}, .faults = {plan, seed, Direction::kToDevice}}} {}

std::size_t VirtualLink::read(std::span<std::byte> out) noexcept {
  ByteQueue& queue = lane(Direction::kToDevice).queue;
  const std::size_t count = std::min(out.size(), queue.size());
  std::copy_n(queue.view().begin(), count, out.begin());
  queue.drop_front(count);
  return count;
}

std::size_t VirtualLink::write(std::span<const std::byte> bytes) noexcept {
  if (!attached_) {
    return bytes.size();  // Nobody listens: discarded, as the port's contract says.
  }
  Lane& to_host = lane(Direction::kToHost);
  const std::size_t used = std::min(to_host.queue.size(), kToHostCapacity);
  const std::size_t count = std::min(bytes.size(), kToHostCapacity - used);
  carry(to_host, bytes.first(count));
  return count;
}

void VirtualLink::attach() noexcept {
  detach();
  attached_ = true;
}

void VirtualLink::detach() noexcept {
  attached_ = false;
  for (Lane& each : lanes_) {
    each.queue.clear();
    each.faults.clear();
  }
}

void VirtualLink::device_gone() noexcept {
  attached_ = false;
  lane(Direction::kToDevice).queue.clear();
  for (Lane& each : lanes_) {
    each.faults.clear();
  }
}

std::size_t VirtualLink::host_write(std::span<const std::byte> bytes) {
  Lane& to_device = lane(Direction::kToDevice);
  const std::size_t count = std::min(bytes.size(), writable());
  carry(to_device, bytes.first(count));
  crossed(to_device, count);
  return count;
}

std::size_t VirtualLink::host_read(std::span<std::byte> out) {
  Lane& to_host = lane(Direction::kToHost);
  const std::size_t count = std::min(out.size(), readable());
  std::copy_n(to_host.queue.view().begin(), count, out.begin());
  to_host.queue.drop_front(count);
  crossed(to_host, count);
  return count;
}

std::size_t VirtualLink::readable() {
  Lane& to_host = lane(Direction::kToHost);
  return allowed(to_host, to_host.queue.size());
}

std::size_t VirtualLink::writable() {
  Lane& to_device = lane(Direction::kToDevice);
  const std::size_t used = std::min(to_device.queue.size(), kToDeviceCapacity);
  return attached_ ? allowed(to_device, kToDeviceCapacity - used) : 0;
}

void VirtualLink::tick() {
  for (Lane& each : lanes_) {
    if (each.faults.harms_frames() && attached_) {
      scratch_.clear();
      each.faults.release_due(clock_.since_power_on_us(), scratch_);
      each.queue.push(scratch_);
    }
  }
}

std::optional<std::uint64_t> VirtualLink::next_event_us() const noexcept {
  std::optional<std::uint64_t> next;
  for (const Lane& each : lanes_) {
    if (const auto time = each.faults.next_event_us(); time && (!next || *time < *next)) {
      next = time;
    }
  }
  return next;
}

std::size_t VirtualLink::allowed(Lane& lane, std::size_t wanted) {
  return lane.faults.allowed(wanted, clock_.since_power_on_us());
}

void VirtualLink::crossed(Lane& lane, std::size_t count) {
  if (lane.faults.crossed(count)) {
    detach();
  }
}

void VirtualLink::carry(Lane& lane, std::span<const std::byte> bytes) {
  if (!lane.faults.harms_frames()) {
    lane.queue.push(bytes);
    return;
  }
  scratch_.clear();
  lane.faults.carry(bytes, clock_.since_power_on_us(), scratch_);
  lane.queue.push(scratch_);
}

}  // namespace scatter::simulator
