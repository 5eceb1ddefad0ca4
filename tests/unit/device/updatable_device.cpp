#include "tests/unit/device/updatable_device.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "protocol/codec.h"

namespace scatter::device::test {

using protocol::MessageId;
using protocol::SlotVerdict;
using protocol::StatusCode;
using protocol::UpdatePhase;

OpenDevice UpdatableDevice::opener() {
  return [this](const Wait& wait) -> Result<Device> {
    ++openings;
    if (restarted_ && busy_openings > 0) {
      --busy_openings;
      return fail(ErrorCode::kBusy, "held by \"scatter\"", "close the other program that holds the device");
    }
    if (gone_) {
      return fail(ErrorCode::kDisconnected, "nobody answers", "plug it in");
    }
    auto transport = std::make_unique<ScriptedDevice>();
    ScriptedDevice* device = transport.get();
    device->script.request = [this, device](const protocol::Frame& frame) { return serve(*device, frame); };
    device->script.incoming = [this](const protocol::Frame& frame) {
      if (frame.id() != MessageId::kUpdateWrite) {
        return true;
      }
      const int index = writes_heard_++;
      const bool lost =
          (lose_write && index == *lose_write) || (lose_every > 0 && index % lose_every == lose_every - 1);
      if (lost) {
        lose_write.reset();
      }
      return !lost;
    };
    device->script.pattern_error = slots[running].version == "2.0.0" ? pattern_error : 0;
    OpenOptions options;
    options.wait = wait;
    return Device::open(std::move(transport), options);
  };
}

protocol::UpdateState UpdatableDevice::state() {
  protocol::UpdateState out;
  out.running_slot = running;
  out.running_version = std::string_view(slots[running].version);
  out.running_verdict = slots[running].verdict;
  out.running_counter = slots[running].counter;
  out.other_version = std::string_view(other().version);
  out.other_verdict = other().verdict;
  out.other_counter = other().counter;
  out.lowest_counter = lowest_counter;
  out.slot_bytes = slot_bytes;
  out.chunk_bytes = chunk_bytes;
  out.received = static_cast<std::uint32_t>(other().body.size());
  out.phase = slots[running].verdict == SlotVerdict::kTrial ? UpdatePhase::kTrial
              : other().verdict == SlotVerdict::kReady      ? UpdatePhase::kReady
              : other().verdict == SlotVerdict::kReceiving  ? UpdatePhase::kReceiving
                                                            : UpdatePhase::kIdle;
  return out;
}

void UpdatableDevice::begin(ScriptedDevice& device, const protocol::Frame& frame) {
  const auto message = *frame.as<protocol::UpdateBegin>();
  const auto& header = message.header;
  const auto bytes = std::as_bytes(std::span(header));
  if (!std::ranges::equal(bytes, other().header)) {
    const auto image = *protocol::decode<protocol::ImageHeader>(bytes);
    other() = {};
    other().header.assign(bytes.begin(), bytes.end());
    other().version = reinterpret_cast<const char*>(image.version.data());
    other().counter = image.security_counter;
    other().body_bytes = image.body_bytes;
    other().verdict = SlotVerdict::kReceiving;
  }
  // Erasing takes its time.
  device.answer_status(frame.header(), StatusCode::kPending, "", 1000);
  protocol::StatusReply done;
  done.request = frame.header().message;
  device.answer(frame.header(), done, std::chrono::milliseconds(300));
}

void UpdatableDevice::write(ScriptedDevice& device, const protocol::Frame& frame) {
  const auto message = *frame.as<protocol::UpdateWrite>();
  Bytes& body = other().body;
  if (!first_write_) {
    first_write_ = device.now();
  }
  if (message.offset > body.size()) {
    device.answer_status(frame.header(), StatusCode::kOutOfRange, "not the next bytes");
    return;
  }
  if (message.offset == body.size()) {
    body.insert(body.end(), message.data.begin(), message.data.end());
  }
  if (unplug_at && body.size() >= *unplug_at) {
    unplug_at.reset();
    device.hang_up();
    return;
  }
  protocol::StatusReply done;
  done.request = frame.header().message;
  device.answer(frame.header(), done, reply_delay);
}

void UpdatableDevice::restart() {
  ++boot_count;
  reset_reason = protocol::ResetReason::kRequested;
  gone_ = stays_away;
  restarted_ = true;
  if (slots[running].verdict == SlotVerdict::kTrial) {
    slots[running].verdict = SlotVerdict::kReverted;
    running = 1 - running;
  } else if (other().verdict == SlotVerdict::kReady) {
    if (new_firmware_crashes) {
      other().verdict = SlotVerdict::kReverted;
      ++boot_count;
      reset_reason = protocol::ResetReason::kFault;
      record.present = 1;
      record.pc = 0x6088'1234;
      record.build_id = std::string_view(other().version);
    } else {
      capabilities &= ~std::uint32_t{protocol::kCapabilityRescue};
      running = 1 - running;
      slots[running].verdict = SlotVerdict::kTrial;
    }
  }
}

bool UpdatableDevice::serve(ScriptedDevice& device, const protocol::Frame& frame) {
  const protocol::FrameHeader& header = frame.header();
  ++carried_out[header.id()];
  const auto ok = [&] { device.answer_status(header, StatusCode::kOk); };
  switch (header.id()) {
    case MessageId::kHello: {
      protocol::HelloReply reply;
      reply.capabilities = capabilities;
      reply.product = std::string_view(product);
      reply.boot_count = boot_count;
      reply.reset_reason = static_cast<std::uint8_t>(reset_reason);
      device.answer(header, reply);
      return true;
    }
    case MessageId::kUpdateStatus:
      if (restarted_ && broken_links > 0) {
        --broken_links;
        device.hang_up();
        return true;
      }
      device.answer(header, state());
      return true;
    case MessageId::kUpdateBegin:
      begin(device, frame);
      return true;
    case MessageId::kUpdateWrite:
      write(device, frame);
      return true;
    case MessageId::kUpdateFinish:
      sending_time = device.now() - first_write_.value_or(device.now());
      if (finds_damage || other().body.size() != other().body_bytes) {
        other() = {};
        device.answer_status(header, StatusCode::kDataLoss, "the body is not the announced one");
      } else {
        other().verdict = SlotVerdict::kReady;
        ok();
      }
      return true;
    case MessageId::kUpdateConfirm:
      slots[running].verdict = SlotVerdict::kConfirmed;
      ok();
      return true;
    case MessageId::kClockSync:
      device.answer(header, protocol::ClockSynced{.host_time_us = 0, .device_time_us = 0});
      return true;
    case MessageId::kReboot:
      if (std::exchange(reboot_is_lost, false)) {
        device.hang_up();
        return true;
      }
      ok();
      device.hang_up();
      restart();
      return true;
    case MessageId::kFaultRecordRead:
      device.answer(header, record);
      return true;
    case MessageId::kGetStatus: {
      if (fault == protocol::FaultCode::kNone) {
        return false;
      }
      protocol::DeviceStatus status;
      status.last_fault =
          static_cast<std::uint16_t>(slots[running].version == "2.0.0" ? fault : protocol::FaultCode::kNone);
      device.answer(header, status);
      return true;
    }
    default:
      return false;
  }
}

}  // namespace scatter::device::test
