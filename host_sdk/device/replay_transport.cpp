#include "host_sdk/device/replay_transport.h"

#include <algorithm>
#include <utility>

#include "host_sdk/device/recording_contents.h"

namespace scatter::device {

namespace {

using protocol::Channel;
using protocol::MessageId;
using protocol::StatusCode;

// As much as is lent at once.
constexpr std::size_t kAheadBytes = 256 * 1024;

std::string_view object_name(std::uint16_t object) {
  switch (static_cast<protocol::ObjectId>(object)) {
    case protocol::ObjectId::kDescriptor:
      return kAttachmentDescriptor;
    case protocol::ObjectId::kHotPixels:
      return kAttachmentHotPixels;
    case protocol::ObjectId::kPrnuMap:
      return kAttachmentPrnuMap;
  }
  return "";
}

}  // namespace

Result<std::unique_ptr<Transport>> open_replay(const Uri& uri, const Wait& /*wait*/) {
  if (uri.place.empty()) {
    return fail(ErrorCode::kInvalidArgument, uri.text() + ": no file is named",
                "name a recording, for example replay:run.scat");
  }
  Result<RecordingReader> reader = RecordingReader::open(uri.place);
  if (!reader) {
    return std::unexpected(std::move(reader.error()));
  }
  return std::make_unique<ReplayTransport>(std::move(*reader));
}

ReplayTransport::ReplayTransport(RecordingReader recording)
    : recording_(std::move(recording)),
      unix_ns_(recording_.info().creation_unix_ns),
      decoder_buffer_(protocol::kMaxFrameBytes),
      decoder_(decoder_buffer_) {
  out_.reserve(kAheadBytes + protocol::kMaxFrameBytes);
  lent_.reserve(kAheadBytes + protocol::kMaxFrameBytes);
}

template <typename Message>
void ReplayTransport::send(Channel channel, std::uint16_t correlation, const Message& message) {
  protocol::FrameHeader header;
  header.channel = channel;
  header.sequence = sequence_.next(channel);
  header.session = nonce_;
  header.correlation = correlation;
  const std::size_t begin = out_.size();
  out_.resize(begin + protocol::kMaxFrameBytes);
  out_.resize(begin + protocol::write_message(std::span(out_).subspan(begin), header, message));
}

void ReplayTransport::refuse(const protocol::FrameHeader& request, StatusCode status, std::string_view text) {
  protocol::StatusReply reply;
  reply.status = status;
  reply.request = request.message;
  reply.text = text;
  send(Channel::kControl, request.correlation, reply);
}

Result<std::span<const std::byte>> ReplayTransport::receive(TimePoint deadline, const std::stop_token& stop) {
  if (closed_) {
    return fail(ErrorCode::kDisconnected, "replay: closed", "open the recording again");
  }
  if (stop.stop_requested()) {
    return fail(ErrorCode::kAborted, "replay: stopped", "start again when ready");
  }
  if (out_.empty()) {
    while (out_.size() < kAheadBytes && play_one()) {
    }
  }
  if (out_.empty()) {
    now_ = std::max(now_, deadline);
    return fail(ErrorCode::kDeadlineExceeded, "replay: the recording has nothing to say",
                "start a run that was recorded");
  }
  lent_.swap(out_);
  out_.clear();
  return lent_;
}

Status ReplayTransport::write(std::span<const std::byte> bytes, TimePoint /*deadline*/,
                              const std::stop_token& /*stop*/) {
  if (closed_) {
    return fail(ErrorCode::kDisconnected, "replay: closed", "open the recording again");
  }
  decoder_.push(bytes, [this](const protocol::Frame& frame) { on_request(frame); });
  return {};
}

bool ReplayTransport::play_one() {
  if (!playing_ || ended_) {
    return false;
  }
  const RecordingReader::Impl& contents = *recording_.impl_;
  const RecordedRun& run = contents.runs[run_];
  for (; at_ < run.end_record; ++at_) {
    const auto frame = contents.table.wire(at_);
    if (!frame ||
        (frame->header().channel != Channel::kStream && frame->header().channel != Channel::kEvent)) {
      continue;
    }
    if (frame->header().channel == Channel::kStream) {
      // Every stream message begins with run and frame id.
      if (frame->payload().size() < 8) {
        continue;
      }
      const auto id = protocol::load_le<std::uint32_t>(frame->payload().data() + 4);
      if (!credit_.may_send(id)) {
        return false;
      }
      if (protocol::comes_before(seen_until_, id + 1)) {
        seen_until_ = id + 1;
      }
      ends_sent_ += frame->id() == MessageId::kFrameEnd ? 1U : 0U;
    }
    unix_ns_ = std::max(unix_ns_, contents.table.host_time_unix_ns(at_));
    ended_ = frame->id() == MessageId::kRunFinished;
    protocol::FrameHeader header = frame->header();
    header.session = nonce_;
    const std::size_t begin = out_.size();
    out_.resize(begin + frame->bytes().size());
    (void)protocol::write_frame(std::span(out_).subspan(begin), header, frame->payload());
    ++at_;
    return true;
  }
  // Stopped by command, or cut off: the end is told from what is known.
  const protocol::RunReport known = report(protocol::RunEnd::kHostGone);
  protocol::RunFinished event;
  event.run_id = known.run_id;
  event.reason = known.reason;
  event.ledger = known.ledger;
  event.frames_sent = known.frames_sent;
  event.started_us = known.started_us;
  event.ended_us = known.ended_us;
  event.held_us = known.held_us;
  send(Channel::kEvent, 0, event);
  ended_ = true;
  return true;
}

protocol::RunReport ReplayTransport::report(protocol::RunEnd reason) const {
  const RecordingReader::Impl& contents = *recording_.impl_;
  const RecordedRun& run = contents.runs[run_];
  if (run.report && at_ >= run.end_record) {
    return *run.report;
  }
  protocol::RunReport out;
  out.run_id = contents.run_ids[run_].value_or(run.started.run_id);
  out.reason = static_cast<std::uint8_t>(reason);
  out.started_us = run.started.device_time_us;
  out.ended_us = run.started.device_time_us;
  out.ledger.exposed = seen_until_;
  out.frames_sent = ends_sent_;
  return out;
}

void ReplayTransport::on_request(const protocol::Frame& request) {
  const protocol::FrameHeader& header = request.header();
  if (header.id() == MessageId::kHello) {
    on_hello(header);
    return;
  }
  if (header.session != nonce_) {
    return;
  }
  if (const auto credit = request.as<protocol::Credit>()) {
    credit_.grant(credit->may_send_until);
    return;
  }
  if (header.channel != Channel::kControl) {
    return;
  }
  const RecordingReader::Impl& contents = *recording_.impl_;
  switch (header.id()) {
    case MessageId::kObjectRead:
      if (const auto message = request.as<protocol::ObjectRead>()) {
        on_object_read(header, *message);
        return;
      }
      break;
    case MessageId::kGetConfiguration:
      send(Channel::kControl, header.correlation,
           contents.runs.empty() ? protocol::Configuration{} : contents.runs[run_].configuration);
      return;
    case MessageId::kSetConfiguration:
      if (const auto message = request.as<protocol::SetConfiguration>()) {
        on_set_configuration(header, message->recipe);
        return;
      }
      break;
    case MessageId::kStart:
      if (const auto message = request.as<protocol::Start>()) {
        on_start(header, *message);
        return;
      }
      break;
    case MessageId::kGetStatus:
      on_get_status(header);
      return;
    case MessageId::kStop:
      on_end(header, protocol::RunEnd::kStopped);
      return;
    case MessageId::kAbort:
      on_end(header, protocol::RunEnd::kAborted);
      return;
    default:
      refuse(header, StatusCode::kFailedPrecondition,
             "a recording cannot do this; use the instrument itself");
      return;
  }
  refuse(header, StatusCode::kInvalidArgument, "the request cannot be read");
}

void ReplayTransport::on_hello(const protocol::FrameHeader& request) {
  nonce_ = request.session;
  sequence_.reset();
  playing_ = false;
  const Result<protocol::HelloReply> recorded = recording_.hello();
  protocol::HelloReply reply = recorded ? *recorded : protocol::HelloReply{};
  reply.run_state = static_cast<std::uint8_t>(protocol::RunState::kIdle);
  if (!recorded) {
    reply.product = "recording";
  }
  send(Channel::kControl, request.correlation, reply);
}

void ReplayTransport::on_object_read(const protocol::FrameHeader& request,
                                     const protocol::ObjectRead& message) {
  const Result<std::span<const std::byte>> object = recording_.attachment(object_name(message.object));
  if (!object) {
    refuse(request, StatusCode::kNotFound, "the recording does not hold this object");
    return;
  }
  if (message.offset > object->size()) {
    refuse(request, StatusCode::kOutOfRange, "the offset is past the end of the object");
    return;
  }
  protocol::ObjectChunk chunk;
  constexpr std::size_t kRoom = protocol::kMaxPayload - protocol::min_encoded_size<protocol::ObjectChunk>();
  chunk.object = message.object;
  chunk.offset = message.offset;
  chunk.total = static_cast<std::uint32_t>(object->size());
  chunk.object_crc = protocol::crc32c(*object);
  chunk.data = object->subspan(message.offset, std::min({static_cast<std::size_t>(message.length), kRoom,
                                                         object->size() - message.offset}));
  send(Channel::kControl, request.correlation, chunk);
}

void ReplayTransport::on_set_configuration(const protocol::FrameHeader& request,
                                           const protocol::Recipe& recipe) {
  const RecordingReader::Impl& contents = *recording_.impl_;
  if (playing_ && !ended_) {
    refuse(request, StatusCode::kFailedPrecondition, "a run is on; stop it first");
    return;
  }
  for (std::size_t k = 0; k < contents.runs.size(); ++k) {
    const std::size_t run = (run_ + k + (playing_ ? 1 : 0)) % contents.runs.size();
    if (contents.runs[run].configuration.recipe == recipe && contents.runs[run].configuration.epoch != 0) {
      run_ = run;
      playing_ = false;
      protocol::ConfigurationAccepted reply;
      reply.epoch = contents.runs[run].configuration.epoch;
      if (const auto& report = contents.runs[run].report) {
        reply.planned_frames = static_cast<std::uint32_t>(report->ledger.exposed);
        reply.planned_duration_us = static_cast<std::uint32_t>(report->ended_us - report->started_us);
      }
      send(Channel::kControl, request.correlation, reply);
      return;
    }
  }
  refuse(request, StatusCode::kFailedPrecondition,
         "a recording cannot take other measurements than it holds; ask for its configuration");
}

void ReplayTransport::on_start(const protocol::FrameHeader& request, const protocol::Start& message) {
  const RecordingReader::Impl& contents = *recording_.impl_;
  if (playing_ && !ended_) {
    refuse(request, StatusCode::kFailedPrecondition, "a run is on; stop it first");
    return;
  }
  for (std::size_t k = 0; k < contents.runs.size(); ++k) {
    const std::size_t run = (run_ + k + (playing_ ? 1 : 0)) % contents.runs.size();
    if (contents.runs[run].configuration.epoch == message.epoch) {
      run_ = run;
      at_ = contents.runs[run].first_record;
      playing_ = true;
      ended_ = false;
      seen_until_ = 0;
      ends_sent_ = 0;
      credit_.restart(message.may_send_until);
      protocol::Started started = contents.runs[run].started;
      started.run_id = contents.run_ids[run].value_or(started.run_id);
      send(Channel::kControl, request.correlation, started);
      return;
    }
  }
  refuse(request, StatusCode::kFailedPrecondition, "the recording holds no run with this settings epoch");
}

void ReplayTransport::on_get_status(const protocol::FrameHeader& request) {
  const RecordingReader::Impl& contents = *recording_.impl_;
  protocol::DeviceStatus status;
  status.run_state = static_cast<std::uint8_t>(protocol::RunState::kIdle);
  if (playing_) {
    status.run_id = report(protocol::RunEnd::kHostGone).run_id;
    status.epoch = contents.runs[run_].configuration.epoch;
    if (!ended_) {  // Everything with credit is played at once, so what is left waits for credit.
      status.run_state = static_cast<std::uint8_t>(protocol::RunState::kHolding);
    }
  }
  send(Channel::kControl, request.correlation, status);
}

void ReplayTransport::on_end(const protocol::FrameHeader& request, protocol::RunEnd reason) {
  if (!playing_) {
    refuse(request, StatusCode::kFailedPrecondition, "no run was started");
    return;
  }
  const protocol::RunReport known = report(reason);
  ended_ = true;
  send(Channel::kControl, request.correlation, known);
}

}  // namespace scatter::device
