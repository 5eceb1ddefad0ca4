#include "host_sdk/device/session.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "protocol/schema_description.h"

namespace scatter::device {

namespace {

using protocol::MessageId;
using protocol::StatusCode;

// The host side has its own list of codes so that reflectance and formats need no protocol.
constexpr bool same_numbers() {
  return static_cast<int>(ErrorCode::kInvalidArgument) == static_cast<int>(StatusCode::kInvalidArgument) &&
         static_cast<int>(ErrorCode::kFailedPrecondition) ==
             static_cast<int>(StatusCode::kFailedPrecondition) &&
         static_cast<int>(ErrorCode::kUnavailable) == static_cast<int>(StatusCode::kUnavailable) &&
         static_cast<int>(ErrorCode::kUnimplemented) == static_cast<int>(StatusCode::kUnimplemented) &&
         static_cast<int>(ErrorCode::kNotFound) == static_cast<int>(StatusCode::kNotFound) &&
         static_cast<int>(ErrorCode::kOutOfRange) == static_cast<int>(StatusCode::kOutOfRange) &&
         static_cast<int>(ErrorCode::kResourceExhausted) ==
             static_cast<int>(StatusCode::kResourceExhausted) &&
         static_cast<int>(ErrorCode::kDataLoss) == static_cast<int>(StatusCode::kDataLoss) &&
         static_cast<int>(ErrorCode::kDeadlineExceeded) == static_cast<int>(StatusCode::kDeadlineExceeded) &&
         static_cast<int>(ErrorCode::kAborted) == static_cast<int>(StatusCode::kAborted) &&
         static_cast<int>(ErrorCode::kBusy) == static_cast<int>(StatusCode::kBusy) &&
         static_cast<int>(ErrorCode::kVersionMismatch) == static_cast<int>(StatusCode::kVersionMismatch) &&
         static_cast<int>(ErrorCode::kPermissionDenied) == static_cast<int>(StatusCode::kPermissionDenied) &&
         static_cast<int>(ErrorCode::kInternal) == static_cast<int>(StatusCode::kInternal) &&
         static_cast<int>(ErrorCode::kDisconnected) == static_cast<int>(StatusCode::kDisconnected);
}
static_assert(same_numbers());

constexpr std::size_t kKeptEvents = 256;
constexpr Duration kFirstRetry = std::chrono::milliseconds(250);
constexpr Duration kLongestRetry = std::chrono::seconds(2);
// A frame whose rest has not come for this long is damaged: look for whole ones inside it.
constexpr Duration kFramePatience = std::chrono::milliseconds(200);

/// Spreads the bits of a time over the 16 of the nonce (splitmix64's finaliser).
std::uint16_t nonce_from(std::uint64_t x) noexcept {
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  x ^= x >> 31U;
  const auto nonce = static_cast<std::uint16_t>(x ^ (x >> 16U) ^ (x >> 32U) ^ (x >> 48U));
  return nonce == 0 ? 1 : nonce;
}

/// The device speaks wire major `device`, or (nothing) refused every one from 1 up to the host's: no major is
/// below 1, so it left ours behind.
Error version_error(std::optional<std::uint8_t> device) {
  const std::string ours = std::to_string(protocol::kWireMajor);
  const std::string theirs =
      device ? "speaks wire version " + std::to_string(*device) : "no longer speaks wire version " + ours;
  if (device && *device < protocol::kWireMajor) {
    return {ErrorCode::kVersionMismatch,
            "hello: the instrument's firmware is older than this program: it " + theirs +
                ", this program speaks " + ours,
            "update the firmware: scatter flash, or dfu-util with a release's .dfu; over USB, scatter doctor "
            "prints the command"};
  }
  return {
      ErrorCode::kVersionMismatch,
      "hello: this program is older than the instrument's firmware, which " + theirs +
          (device ? "; this program speaks " + ours : ""),
      "update OpenScatter on this computer, or give the instrument the firmware of this release; over USB, "
      "scatter doctor prints the command"};
}

}  // namespace

Error device_error(std::string_view request, const protocol::StatusReply& reply) {
  const protocol::StatusInfo& row = protocol::info(reply.status);
  // A number that this host does not know, or a success where data were expected, is a defect.
  const bool known = row.code == reply.status && reply.status != StatusCode::kOk;
  const ErrorCode code = known ? static_cast<ErrorCode>(reply.status) : ErrorCode::kInternal;
  const std::string_view text = reply.text.str();
  std::string what(request);
  what += ": ";
  if (!known) {
    what += "the device answered with status " + std::to_string(static_cast<unsigned>(reply.status));
  } else if (text.empty()) {
    what += "the device answered " + std::string(row.name);
  } else {
    what += text;
  }
  const StatusCode spelled = static_cast<StatusCode>(code);
  return {code, std::move(what), std::string(protocol::info(spelled).remedy)};
}

Session::Session(std::unique_ptr<Transport> transport, const OpenOptions& options)
    : transport_(std::move(transport)),
      host_name_(options.host_name),
      build_id_(options.build_id.empty() ? "openscatter" : options.build_id),
      nonce_(options.nonce.value_or(nonce_from(transport_->system_time_unix_ns()))),
      decoder_buffer_(protocol::kMaxFrameBytes),
      decoder_(decoder_buffer_),
      arrived_(transport_->now()) {
  reply_.reserve(protocol::kMaxPayload);
}

Session::~Session() {
  close();
}

void Session::close() noexcept {
  closed_ = true;
  transport_->close();
}

Result<std::unique_ptr<Session>> Session::open(std::unique_ptr<Transport> transport,
                                               const OpenOptions& options, TimePoint deadline) {
  std::unique_ptr<Session> session(new Session(std::move(transport), options));
  if (const Status said = session->say_hello(deadline, options.wait.stop); !said) {
    return std::unexpected(said.error());
  }
  return session;
}

Status Session::say_hello(TimePoint deadline, const std::stop_token& stop) {
  sequence_.reset();
  protocol::Hello hello;
  hello.schema_digest = protocol::schema_digest();
  hello.host_name = std::string_view(host_name_);
  hello.build_id = std::string_view(build_id_);
  saying_hello_ = true;
  other_major_.reset();
  Result<protocol::HelloReply> reply = request<protocol::HelloReply>(hello, deadline, stop);
  saying_hello_ = false;
  if (!reply && reply.error().code == ErrorCode::kVersionMismatch) {
    return std::unexpected(version_error(other_major_));
  }
  if (!reply) {
    return std::unexpected(std::move(reply.error()));
  }
  if (reply->wire_major != protocol::kWireMajor) {
    return std::unexpected(version_error(reply->wire_major));
  }
  hello_ = *reply;
  return {};
}

Result<protocol::HelloReply> Session::renew(TimePoint deadline, const std::stop_token& stop) {
  nonce_ = nonce_from(nonce_ + (static_cast<std::uint64_t>(last_correlation_) << 32U));
  if (const Status said = say_hello(deadline, stop); !said) {
    return std::unexpected(said.error());
  }
  return hello_;
}

protocol::FrameHeader Session::next_header(protocol::Channel channel, std::uint16_t correlation) noexcept {
  protocol::FrameHeader header;
  header.channel = channel;
  header.sequence = sequence_.next(channel);
  header.session = nonce_;
  header.correlation = correlation;
  return header;
}

std::uint16_t Session::next_correlation() noexcept {
  if (++last_correlation_ == 0) {
    last_correlation_ = 1;
  }
  return last_correlation_;
}

Status Session::send_request(MessageId id, std::uint16_t correlation, std::span<const std::byte> payload,
                             TimePoint deadline, const std::stop_token& stop) {
  protocol::FrameHeader header = next_header(protocol::Channel::kControl, correlation);
  header.message = static_cast<std::uint16_t>(id);
  const std::size_t size = protocol::write_frame(send_, header, payload);
  return transport_->write(std::span<const std::byte>(send_).first(size), deadline, stop);
}

std::unexpected<Error> Session::malformed(std::string_view request) {
  return fail(ErrorCode::kDataLoss, std::string(request) + ": the device's reply cannot be read",
              "update the device's firmware or the host's software");
}

Status Session::exchange(MessageId id, std::string_view name, std::size_t payload_size, MessageId expected,
                         TimePoint deadline, const std::stop_token& stop) {
  if (closed_) {
    return fail(ErrorCode::kDisconnected, std::string(name) + ": the session is closed",
                "open the device again");
  }
  waiting_for_ = next_correlation();
  expected_id_ = expected;
  replied_ = false;
  const auto give_up = [this](Error error) -> Status {
    waiting_for_ = 0;
    return std::unexpected(std::move(error));
  };
  const std::span<const std::byte> payload = std::span<const std::byte>(request_payload_).first(payload_size);
  Duration spacing = kFirstRetry;
  TimePoint next_send = now();
  for (;;) {
    if (now() >= next_send) {
      const Status sent = send_request(id, waiting_for_, payload, deadline, stop);
      // A device that answers and is gone (in use, or restarting): its answer may lie here, so read all the
      // same.
      if (!sent && sent.error().code != ErrorCode::kDisconnected) {
        return give_up(sent.error());
      }
      next_send = now() + spacing;
      spacing = std::min(2 * spacing, kLongestRetry);
    }
    const Status pumped = pump(std::min(deadline, next_send), stop);
    if (other_major_ && saying_hello_) {
      return give_up(version_error(other_major_));
    }
    if (replied_) {
      const auto status = held_status();
      if (!status || status->status != StatusCode::kPending) {
        waiting_for_ = 0;
        return settle(name, expected);
      }
      replied_ = false;
      // The promise's end may be long after the reply, which may be lost: ask in between, it is harmless.
      const Duration promised = std::chrono::milliseconds(status->pending_ms);
      spacing = kLongestRetry;
      next_send = now() + std::clamp(promised, kFirstRetry, spacing);
    }
    if (!pumped && pumped.error().code != ErrorCode::kDeadlineExceeded) {
      return give_up(pumped.error());
    }
    if (now() >= deadline) {
      return give_up({ErrorCode::kDeadlineExceeded, std::string(name) + ": the device did not answer in time",
                      "check that the device has power and the cable is good, then try again"});
    }
  }
}

Status Session::settle(std::string_view name, MessageId expected) {
  if (reply_id_ != MessageId::kStatusReply) {
    return {};
  }
  const auto status = protocol::decode<protocol::StatusReply>(std::span<const std::byte>(reply_));
  if (!status) {
    return malformed(name);
  }
  if (status->status == StatusCode::kOk && expected == MessageId::kStatusReply) {
    return {};
  }
  return std::unexpected(device_error(name, *status));
}

Status Session::pump(TimePoint until, const std::stop_token& stop) {
  const auto deliver = [this](const protocol::Frame& frame) { on_frame(frame); };
  TimePoint slice = until;
  if (decoder_.buffered() != 0) {
    slice = std::min(until, now() + kFramePatience);
  }
  const Result<std::span<const std::byte>> got = transport_->receive(slice, stop);
  if (!got) {
    if (got.error().code == ErrorCode::kDeadlineExceeded && decoder_.buffered() != 0 &&
        now() - arrived_ >= kFramePatience) {
      note_arrival();
      decoder_.give_up(deliver);
    }
    if (got.error().code == ErrorCode::kDisconnected) {
      closed_ = true;
    }
    return std::unexpected(got.error());
  }
  note_arrival();
  bytes_ += got->size();
  decoder_.push(*got, deliver, [this](const protocol::FrameHeader& header, protocol::ParseStatus status) {
    if (saying_hello_ && status == protocol::ParseStatus::kBadVersion &&
        header.channel == protocol::Channel::kControl) {
      other_major_ = header.wire_major;
    }
  });
  return {};
}

void Session::note_arrival() {
  arrived_ = now();
  arrived_unix_ns_ = transport_->system_time_unix_ns();
}

void Session::on_frame(const protocol::Frame& frame) {
  const protocol::FrameHeader& header = frame.header();
  const std::byte* const begin = frame.bytes().data();
  if (!std::less<>()(begin, decoder_buffer_.data()) &&
      std::less<>()(begin, decoder_buffer_.data() + decoder_buffer_.size())) {
    copied_bytes_ += frame.bytes().size();
  }
  if (header.session != nonce_) {
    // Before there is a session a server may refuse with a status that names none (BUSY).
    if (saying_hello_ && !replied_ && header.channel == protocol::Channel::kControl &&
        header.correlation == 0 && header.id() == MessageId::kStatusReply) {
      on_control(frame);
      return;
    }
    ++stale_;
    return;
  }
  switch (header.channel) {
    case protocol::Channel::kControl:
      on_control(frame);
      break;
    case protocol::Channel::kEvent:
      on_event(frame);
      break;
    case protocol::Channel::kStream:
      if (sink_ != nullptr) {
        sink_->on_stream(frame, arrived_unix_ns_);
      } else {
        ++stale_;
      }
      break;
    case protocol::Channel::kTransfer:
      ++stale_;
      break;
  }
}

std::optional<protocol::StatusReply> Session::held_status() const {
  return reply_id_ == MessageId::kStatusReply
             ? protocol::decode<protocol::StatusReply>(std::span<const std::byte>(reply_))
             : std::nullopt;
}

bool Session::holds_pending() const {
  const auto status = held_status();
  return status && status->status == StatusCode::kPending;
}

void Session::on_control(const protocol::Frame& frame) {
  const protocol::FrameHeader& header = frame.header();
  if (reply_sink_ != nullptr && reply_sink_->on_reply(frame)) {
    return;
  }
  const bool refused_unasked = saying_hello_ && header.correlation == 0;
  // The reply may come in the same read as the PENDING before it.
  const bool answered = replied_ && !holds_pending();
  if (waiting_for_ == 0 || answered || (header.correlation != waiting_for_ && !refused_unasked)) {
    ++stale_;  // A repeated or late reply.
    return;
  }
  if (header.id() != expected_id_ && header.id() != MessageId::kStatusReply) {
    ++stale_;
    return;
  }
  replied_ = true;
  reply_id_ = header.id();
  reply_.assign(frame.payload().begin(), frame.payload().end());
  if (sink_ != nullptr && (header.id() == MessageId::kStarted || header.id() == MessageId::kRunReport)) {
    sink_->on_message(frame, arrived_unix_ns_);
  }
}

void Session::on_event(const protocol::Frame& frame) {
  DeviceEvent event;
  if (const auto log = frame.as<protocol::LogEvent>()) {
    event = {log->level, protocol::FaultCode::kNone, log->device_time_us, std::string(log->text.str())};
  } else if (const auto fault = frame.as<protocol::FaultEvent>()) {
    event = {4, static_cast<protocol::FaultCode>(fault->fault), fault->device_time_us,
             std::string(fault->text.str())};
  }
  if (!event.text.empty() || event.fault != protocol::FaultCode::kNone) {
    if (events_.size() == kKeptEvents) {
      events_.pop_front();
    }
    events_.push_back(std::move(event));
  }
  if (sink_ != nullptr) {
    sink_->on_message(frame, arrived_unix_ns_);
  }
}

std::vector<DeviceEvent> Session::take_events() {
  std::vector<DeviceEvent> out(std::make_move_iterator(events_.begin()),
                               std::make_move_iterator(events_.end()));
  events_.clear();
  return out;
}

LinkStatistics Session::statistics() const {
  const protocol::LinkCounters& seen = decoder_.counters();
  LinkStatistics out;
  out.bytes = bytes_;
  out.wire_frames = seen.good;
  out.bad_frames = std::uint64_t{seen.bad_header} + seen.bad_length + seen.bad_payload + seen.bad_version +
                   seen.unknown_flags + seen.unknown_channel;
  out.skipped_bytes = seen.skipped_bytes;
  out.stale_frames = stale_;
  out.copied_bytes = copied_bytes_;
  const CarrierStatistics carrier = transport_->statistics();
  out.carrier_stalls = carrier.stalls;
  out.carrier_overflows = carrier.overflows;
  out.carrier_errors = carrier.errors;
  return out;
}

}  // namespace scatter::device
