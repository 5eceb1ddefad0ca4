#include "tests/unit/device/scripted_device.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::device::test {

using protocol::Channel;
using protocol::MessageId;

protocol::Descriptor test_descriptor() {
  protocol::Descriptor d;
  d.product = "Scripted";
  d.serial = "TEST-1";
  d.sensor.width_px = kWidth;
  d.sensor.height_px = kHeight;
  d.sensor.bits = 12;
  d.sensor.min_exposure_us = 100;
  protocol::Illumination light;
  light.theta_rad = 0.35F;
  d.illuminations.push_back(light);
  return d;
}

protocol::Recipe test_recipe(std::uint16_t frames) {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1000);
  recipe.repeats = frames;
  return recipe;
}

Bytes test_pixels(std::uint32_t frame_id) {
  Bytes out(kFrameBytes);
  for (std::uint32_t i = 0; i < kFrameBytes; ++i) {
    out[i] = static_cast<std::byte>(frame_id * 37 + i * 11 + 1);
  }
  return out;
}

ScriptedDevice::ScriptedDevice() : decoder_buffer_(protocol::kMaxFrameBytes), decoder_(decoder_buffer_) {}

Result<std::span<const std::byte>> ScriptedDevice::receive(TimePoint deadline, const std::stop_token& stop) {
  if (stop.stop_requested()) {
    return fail(ErrorCode::kAborted, "stopped", "start again");
  }
  if (posted_.empty()) {
    run();
  }
  if (!posted_.empty() && posted_.front().due <= std::max(deadline, now_)) {
    now_ = std::max(now_, posted_.front().due);
    lent_ = std::move(posted_.front().bytes);
    posted_.pop_front();
    return lent_;
  }
  if (posted_.empty() && hung_up_) {
    return fail(ErrorCode::kDisconnected, "the device closed the connection", "plug it in again");
  }
  now_ = std::max(now_, deadline);
  return fail(ErrorCode::kDeadlineExceeded, "nothing came", "wait longer");
}

Status ScriptedDevice::write(std::span<const std::byte> bytes, TimePoint, const std::stop_token&) {
  if (hung_up_ || closed) {
    return fail(ErrorCode::kDisconnected, "the device closed the connection", "plug it in again");
  }
  decoder_.push(bytes, [this](const protocol::Frame& frame) { on_frame(frame); });
  if (hung_up_) {
    return fail(ErrorCode::kDisconnected, "the device closed the connection meanwhile", "plug it in again");
  }
  return {};
}

void ScriptedDevice::post(Bytes frame, Duration delay) {
  const protocol::ParseResult parsed = protocol::parse_frame(frame);
  REQUIRE(parsed.frame);
  if (parsed.header.channel == Channel::kControl && parsed.header.correlation != 0) {
    replies_[parsed.header.correlation] = frame;
  }
  if (!script.outgoing) {
    send_raw(std::move(frame), delay);
    return;
  }
  for (Bytes& one : script.outgoing(parsed.header, std::move(frame))) {
    send_raw(std::move(one), delay);
  }
}

void ScriptedDevice::send_raw(Bytes bytes, Duration delay) {
  const TimePoint due = now_ + delay;
  const auto at = std::ranges::upper_bound(posted_, due, {}, &Posted::due);
  if (!bytes.empty()) {
    posted_.insert(at, {due, std::move(bytes)});
  }
}

void ScriptedDevice::answer_status(const protocol::FrameHeader& request, protocol::StatusCode status,
                                   std::string_view text, std::uint32_t pending_ms) {
  protocol::StatusReply reply;
  reply.status = status;
  reply.request = request.message;
  reply.pending_ms = pending_ms;
  reply.text = text;
  answer(request, reply);
}

void ScriptedDevice::on_frame(const protocol::Frame& frame) {
  if (script.incoming && !script.incoming(frame)) {
    return;
  }
  const protocol::FrameHeader& header = frame.header();
  if (const auto credit = frame.as<protocol::Credit>()) {
    credits.push_back(credit->may_send_until);
    credit_.grant(credit->may_send_until);
    return;
  }
  ++heard[header.id()];
  if (header.id() == MessageId::kHello && header.session != nonce) {
    nonce = header.session;
    sequence_.reset();
    replies_.clear();
    running = false;
  }
  if (const auto known = replies_.find(header.correlation); known != replies_.end()) {
    const Bytes again = known->second;
    post(again, {});
    return;
  }
  ++executed[header.id()];
  if (!script.request || !script.request(frame)) {
    execute(frame);
  }
}

void ScriptedDevice::execute(const protocol::Frame& frame) {
  const protocol::FrameHeader& header = frame.header();
  switch (header.id()) {
    case MessageId::kHello: {
      protocol::HelloReply reply;
      reply.product = "Scripted";
      reply.serial = "TEST-1";
      reply.boot_count = boot_count;
      answer(header, reply);
      return;
    }
    case MessageId::kObjectRead:
      object_read(frame);
      return;
    case MessageId::kGetConfiguration:
      answer(header, protocol::Configuration{.epoch = epoch, .recipe = recipe_});
      return;
    case MessageId::kSetConfiguration:
      recipe_ = frame.as<protocol::SetConfiguration>()->recipe;
      ++epoch;
      answer(header, protocol::ConfigurationAccepted{
                         .epoch = epoch, .planned_frames = recipe_.repeats, .planned_duration_us = 1000});
      return;
    case MessageId::kStart:
      running = true;
      aborted = false;
      ++run_id;
      next_frame_ = sent_frames_ = 0;
      credit_.restart(frame.as<protocol::Start>()->may_send_until);
      answer(header, protocol::Started{.run_id = run_id, .device_time_us = 0});
      return;
    case MessageId::kStop:
    case MessageId::kAbort: {
      aborted = aborted || header.id() == MessageId::kAbort;
      const bool was_running = running;
      running = false;
      answer(header, report(!was_running ? protocol::RunEnd::kCompleted
                            : aborted    ? protocol::RunEnd::kAborted
                                         : protocol::RunEnd::kStopped));
      return;
    }
    case MessageId::kGetStatus: {
      protocol::DeviceStatus status;
      status.run_id = run_id;
      status.epoch = epoch;
      status.run_state = static_cast<std::uint8_t>(!running ? protocol::RunState::kIdle
                                                            : (credit_.may_send(next_frame_)
                                                                   ? protocol::RunState::kRunning
                                                                   : protocol::RunState::kHolding));
      answer(header, status);
      return;
    }
    default:
      answer_status(header, protocol::StatusCode::kUnimplemented, "unknown request");
  }
}

void ScriptedDevice::object_read(const protocol::Frame& frame) {
  const auto read = *frame.as<protocol::ObjectRead>();
  Bytes object;
  if (read.object == static_cast<std::uint16_t>(protocol::ObjectId::kDescriptor)) {
    const protocol::Descriptor descriptor = test_descriptor();
    object.resize(protocol::encoded_size(descriptor));
    REQUIRE(protocol::encode(descriptor, std::span(object)));
  } else if (read.object == static_cast<std::uint16_t>(protocol::ObjectId::kPrnuMap)) {
    object.assign(kWidth * kHeight, std::byte{7});
  } else {
    answer_status(frame.header(), protocol::StatusCode::kNotFound, "no such object");
    return;
  }
  protocol::ObjectChunk chunk;
  chunk.object = read.object;
  chunk.offset = read.offset;
  chunk.total = static_cast<std::uint32_t>(object.size());
  chunk.object_crc = protocol::crc32c(object);
  // Small chunks, so that reading takes several requests.
  chunk.data = std::span<const std::byte>(object).subspan(
      read.offset, std::min<std::size_t>({100, read.length, object.size() - read.offset}));
  answer(frame.header(), chunk);
}

protocol::RunReport ScriptedDevice::report(protocol::RunEnd reason) {
  protocol::RunReport out;
  out.run_id = run_id;
  out.reason = static_cast<std::uint8_t>(reason);
  out.ledger.exposed = next_frame_;
  out.ledger.lost_sensor = std::min(next_frame_, script.lose_in_sensor);
  out.ledger.lost_firmware =
      std::min(next_frame_ - static_cast<std::uint32_t>(out.ledger.lost_sensor), script.lose_in_firmware);
  out.frames_sent = sent_frames_;
  return out;
}

void ScriptedDevice::run() {
  if (!running) {
    return;
  }
  if (next_frame_ < recipe_.repeats && (script.ignore_credit || credit_.may_send(next_frame_))) {
    const std::uint32_t id = next_frame_++;
    if (id >= script.lose_in_sensor + script.lose_in_firmware) {
      send_frame(id);
      ++sent_frames_;
    }
  }
  if (next_frame_ == recipe_.repeats) {
    running = false;
    if (!script.silent_end) {
      const protocol::RunReport r = report(protocol::RunEnd::kCompleted);
      send(Channel::kEvent, 0,
           protocol::RunFinished{.run_id = r.run_id,
                                 .reason = r.reason,
                                 .ledger = r.ledger,
                                 .frames_sent = r.frames_sent,
                                 .started_us = 0,
                                 .ended_us = 0,
                                 .held_us = 0});
    }
  } else if (posted_.empty() && (script.ignore_credit || credit_.may_send(next_frame_))) {
    run();  // The whole exposure was lost: go on with the next.
  }
}

void ScriptedDevice::send_frame(std::uint32_t id) {
  Bytes pixels = test_pixels(id);
  if (recipe_.test_pattern != 0) {
    for (std::uint32_t k = 0; k < kWidth * kHeight; ++k) {
      const auto value = static_cast<std::uint16_t>((id * 7919U + k + script.pattern_error) & 0x0FFFU);
      protocol::store_le(pixels.data() + 2 * std::size_t{k}, value);
    }
  }
  protocol::FrameBegin begin;
  begin.run_id = run_id;
  begin.frame_id = id;
  begin.epoch = epoch;
  begin.illumination = 0;
  begin.exposure_us = 1000;
  begin.width = kWidth;
  begin.height = kHeight;
  begin.bits = 12;
  begin.total = kFrameBytes;
  send(Channel::kStream, 0, begin);
  for (std::uint32_t at = 0; at < kFrameBytes; at += kChunkBytes) {
    protocol::FrameData data;
    data.run_id = run_id;
    data.frame_id = id;
    data.offset = at;
    data.total = kFrameBytes;
    data.data = std::span<const std::byte>(pixels).subspan(at, std::min(kChunkBytes, kFrameBytes - at));
    send(Channel::kStream, 0, data);
  }
  protocol::FrameEnd end;
  end.run_id = run_id;
  end.frame_id = id;
  end.frame_crc = protocol::crc32c(pixels) ^ (script.corrupt_checksum ? 1U : 0U);
  send(Channel::kStream, 0, end);
}

Pair open_pair(const std::function<void(ScriptedDevice&)>& prepare, const OpenOptions& options) {
  auto transport = std::make_unique<ScriptedDevice>();
  ScriptedDevice* device = transport.get();
  if (prepare) {
    prepare(*device);
  }
  return {device, Device::open(std::move(transport), options)};
}

std::vector<Frame> drain(Stream& stream) {
  std::vector<Frame> out;
  for (;;) {
    Result<std::optional<Frame>> frame = stream.next();
    if (!frame) {
      FAIL(frame.error().what);
    }
    if (!*frame) {
      return out;
    }
    out.push_back(std::move(**frame));
  }
}

}  // namespace scatter::device::test
