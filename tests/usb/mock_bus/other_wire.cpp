#include "tests/usb/mock_bus/other_wire.h"

#include <algorithm>
#include <utility>

#include "protocol/messages.h"
#include "protocol/schema_description.h"
#include "protocol/session.h"
#include "protocol/usb_identity.h"

namespace scatter::mock_bus {

using simulator::UsbCompletion;
using simulator::UsbOutcome;
using simulator::UsbTransfer;

namespace {

/// USB 2.0, 9.4.3: GET_DESCRIPTOR of a configuration.
bool asks_configuration(const UsbTransfer& transfer) {
  return (transfer.endpoint & 0x7FU) == 0 && transfer.setup[0] == 0x80 && transfer.setup[1] == 6 &&
         transfer.setup[3] == 2;
}

/// Writes the wire major into both settings of interface 0 (USB 2.0, table 9-12).
void tell_major(Bytes& configuration, std::uint8_t major) {
  constexpr std::size_t kInterfaceBytes = 9;
  for (std::size_t k = 0; k + kInterfaceBytes <= configuration.size();) {
    const auto length = std::to_integer<std::size_t>(configuration[k]);
    if (length == kInterfaceBytes && configuration[k + 1] == std::byte{4} &&
        configuration[k + 2] == std::byte{protocol::usb::kStreamInterface} &&
        configuration[k + 5] == std::byte{protocol::usb::kStreamClass}) {
      configuration[k + 7] = std::byte{major};
    }
    k += std::max<std::size_t>(length, 1);
  }
}

}  // namespace

void OtherWire::submit(UsbTransfer transfer) {
  if (!inner().present() ||
      (transfer.endpoint != protocol::usb::kBulkIn && transfer.endpoint != protocol::usb::kBulkOut)) {
    if (asks_configuration(transfer)) {
      configurations_.insert(transfer.id);
    }
    inner().submit(std::move(transfer));
    return;
  }
  if (transfer.endpoint == protocol::usb::kBulkIn) {
    reads_.push_back(transfer.id);
  } else {
    decoder_.push(transfer.data, [this](const protocol::Frame& frame) { answer(frame); });
    end(transfer.id, UsbOutcome::kDone, transfer.data.size());
  }
  hand_out();
}

void OtherWire::answer(const protocol::Frame& frame) {
  const auto hello = frame.as<protocol::Hello>();
  if (!hello) {
    return;
  }
  const protocol::Offer offer{.min_wire_major = major_, .max_wire_major = major_};
  protocol::FrameHeader header;
  header.wire_major = manner_ == Manner::kRefuses ? std::uint8_t{1} : major_;
  header.session = frame.header().session;
  header.correlation = frame.header().correlation;
  Bytes bytes(protocol::kFrameOverhead + protocol::kMaxSerialPayload);
  bytes.resize(protocol::write_message(
      bytes, header, protocol::negotiate(*hello, offer, protocol::schema_digest()).refusal));
  answers_.push_back(std::move(bytes));
}

void OtherWire::hand_out() {
  while (!answers_.empty() && !reads_.empty()) {
    const std::size_t size = answers_.front().size();
    end(reads_.front(), UsbOutcome::kDone, size, std::move(answers_.front()));
    reads_.pop_front();
    answers_.pop_front();
  }
}

void OtherWire::end(std::uint64_t id, UsbOutcome outcome, std::size_t actual, Bytes data) {
  UsbCompletion completion;
  completion.id = id;
  completion.outcome = outcome;
  completion.actual = actual;
  completion.data = std::move(data);
  done_.push_back(std::move(completion));
}

void OtherWire::forget(UsbOutcome outcome) {
  for (const std::uint64_t id : std::exchange(reads_, {})) {
    end(id, outcome, 0);
  }
  answers_.clear();
  decoder_.reset();
}

void OtherWire::plug(simulator::UsbBusSpeed speed) {
  inner().plug(speed);
}

void OtherWire::unplug() {
  inner().unplug();
  forget(UsbOutcome::kGone);
}

void OtherWire::reset() {
  inner().reset();
  forget(UsbOutcome::kGone);
}

bool OtherWire::cancel(std::uint64_t id) {
  const auto found = std::find(reads_.begin(), reads_.end(), id);
  if (found == reads_.end()) {
    return inner().cancel(id);
  }
  reads_.erase(found);
  end(id, UsbOutcome::kCancelled, 0);
  return true;
}

std::optional<UsbCompletion> OtherWire::next_completion() {
  if (!done_.empty()) {
    UsbCompletion completion = std::move(done_.front());
    done_.pop_front();
    return completion;
  }
  std::optional<UsbCompletion> completion = inner().next_completion();
  if (completion && configurations_.erase(completion->id) != 0) {
    tell_major(completion->data, major_);
  }
  return completion;
}

}  // namespace scatter::mock_bus
