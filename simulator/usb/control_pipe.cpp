#include "simulator/usb/control_pipe.h"

#include <algorithm>
#include <utility>

namespace scatter::simulator {
namespace {

bool to_host(const UsbTransfer& transfer) noexcept {
  return (transfer.setup[0] & 0x80U) != 0;
}

/// wLength
std::size_t data_length(const UsbTransfer& transfer) noexcept {
  return transfer.setup[6] | static_cast<std::size_t>(transfer.setup[7]) << 8U;
}

}  // namespace

void ControlPipe::submit(UsbTransfer transfer) {
  transfers_.push_back(std::move(transfer));
}

bool ControlPipe::cancel(std::uint64_t id) {
  const auto found = std::ranges::find(transfers_, id, &UsbTransfer::id);
  if (found == transfers_.end()) {
    return false;
  }
  if (found == transfers_.begin()) {
    finish(UsbOutcome::kCancelled, {}, 0);
    return true;
  }
  completions_.add_out(id, UsbOutcome::kCancelled, 0);
  transfers_.erase(found);
  return true;
}

void ControlPipe::end_all(UsbOutcome outcome) {
  while (!transfers_.empty()) {
    finish(outcome, {}, 0);
  }
}

std::optional<firmware::UsbEvent> ControlPipe::next_event() {
  if (transfers_.empty() || stage_ == Stage::kAnswer) {
    return std::nullopt;
  }
  const Stage was = std::exchange(stage_, Stage::kAnswer);
  if (was == Stage::kSetup) {
    received_ = 0;
    return firmware::UsbEvent{.kind = firmware::UsbEvent::Kind::kSetup, .setup = transfers_.front().setup};
  }
  return firmware::UsbEvent{.kind = firmware::UsbEvent::Kind::kControlData, .size = received_};
}

void ControlPipe::send(std::span<const std::byte> data) {
  if (!answerable()) {
    return;
  }
  const UsbTransfer& transfer = transfers_.front();
  if (!to_host(transfer)) {
    stall();  // Nobody asks for these bytes: the host finds no handshake in its own data stage.
    return;
  }
  const std::size_t count = std::min(data.size(), data_length(transfer));
  if (count > transfer.length) {
    finish(UsbOutcome::kBabble, {}, 0);
    return;
  }
  finish(UsbOutcome::kDone, {data.begin(), data.begin() + static_cast<std::ptrdiff_t>(count)}, count);
}

void ControlPipe::receive(std::span<std::byte> room) {
  if (!answerable()) {
    return;
  }
  const UsbTransfer& transfer = transfers_.front();
  if (to_host(transfer)) {
    stall();
    return;
  }
  received_ = std::min({room.size(), transfer.data.size(), data_length(transfer)});
  std::copy_n(transfer.data.begin(), received_, room.begin());
  stage_ = Stage::kData;
}

void ControlPipe::accept() {
  if (!answerable()) {
    return;
  }
  if (to_host(transfers_.front())) {
    finish(UsbOutcome::kDone, {}, 0);
  } else {
    finish(UsbOutcome::kDone, {}, received_);
  }
}

void ControlPipe::stall() {
  if (answerable()) {
    finish(UsbOutcome::kStalled, {}, 0);
  }
}

void ControlPipe::finish(UsbOutcome outcome, std::vector<std::byte> data, std::size_t actual) {
  const std::uint64_t id = transfers_.front().id;
  if (to_host(transfers_.front())) {
    completions_.add_in(id, outcome, std::move(data));
  } else {
    completions_.add_out(id, outcome, actual);
  }
  transfers_.pop_front();
  stage_ = Stage::kSetup;
}

}  // namespace scatter::simulator
