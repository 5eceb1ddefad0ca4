// HELLO and what follows from it.
#include <algorithm>
#include <array>

#include "host_sdk/device/conformance/check_functions.h"
#include "host_sdk/device/conformance/wire_probe.h"
#include "protocol/schema_description.h"

namespace scatter::conformance {

using protocol::Channel;
using protocol::MessageId;
using protocol::StatusCode;

void check_hello(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  const auto reply = probe->hello(subject);
  if (!reply) {
    return judge.broken("a second hello on the same connection", reply.error());
  }
  judge.equal("the wire major", unsigned{protocol::kWireMajor}, unsigned{reply->wire_major});
  judge.require(reply->max_payload >= protocol::kMinPayload && reply->max_payload <= protocol::kMaxPayload,
                fmt::format("the payload limit {} is outside {}..{}", reply->max_payload,
                            protocol::kMinPayload, protocol::kMaxPayload));
  judge.require(!reply->product.str().empty() && !reply->serial.str().empty(),
                "product or serial number is empty");
  judge.require(!reply->build_id.str().empty(), "the firmware's version is empty");
  judge.require(probe->last_reply().header.wire_major == 1, "the reply is not in a frame of wire major 1");
  const std::size_t before = probe->seen().size();
  if (const auto status = probe->status(); !status) {
    judge.broken("a request after hello", status.error());
  }
  (void)probe->collect();
  judge.equal("the nonce of the reply to hello", probe->nonce(), probe->last_reply().header.session);
  for (std::size_t i = before; i < probe->seen().size(); ++i) {
    judge.equal("the nonce of a frame after hello", probe->nonce(), probe->seen()[i].session);
  }
  judge.measured(fmt::format("{} {}, firmware {}, schema {}{}, payload to {} B", reply->product.str(),
                             reply->serial.str(), reply->build_id.str(), reply->schema_revision,
                             reply->schema_digest == protocol::schema_digest() ? "" : " (another digest)",
                             reply->max_payload));
}

void check_payload_limit(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  protocol::Hello smallest;
  smallest.max_payload = protocol::kMinPayload;
  const auto reply = probe->hello(subject, smallest);
  if (!reply) {
    return judge.broken("hello that offers 1024 bytes", reply.error());
  }
  judge.equal("the limit after an offer of 1024 bytes", protocol::kMinPayload, reply->max_payload);
  for (const auto object : {protocol::ObjectId::kDescriptor, protocol::ObjectId::kPrnuMap}) {
    const auto chunk = probe->ask<protocol::ObjectChunk>(protocol::ObjectRead{
        .object = static_cast<std::uint16_t>(object), .offset = 0, .length = protocol::kMaxPayload});
    if (!chunk && object == protocol::ObjectId::kDescriptor) {
      return judge.broken("object_read under the limit of 1024 bytes", chunk.error());
    }
    judge.require(!chunk || probe->last_reply().header.payload_length <= protocol::kMinPayload,
                  fmt::format("a payload of {} bytes came under the limit of {}",
                              probe->last_reply().header.payload_length, protocol::kMinPayload));
  }
  protocol::Hello too_small;
  too_small.max_payload = protocol::kMinPayload - 1;
  judge.refused("an offer of 1023 bytes", probe->hello(subject, too_small), ErrorCode::kInvalidArgument);
}

void check_version_refusal(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  // A session with traffic, so that the device's sequence numbers have left 0.
  if (const auto status = probe->status(); !status) {
    return judge.broken("a request", status.error());
  }
  const protocol::Hello future{.min_wire_major = 2, .max_wire_major = 9};
  probe->set_nonce(subject.next_nonce());
  const std::uint16_t correlation = probe->next_correlation();
  Bytes request = probe->frame_of(future, correlation);
  if (const Status sent = probe->write(request); !sent) {
    return judge.broken("hello of wire 2 to 9", sent.error());
  }
  const auto reply = probe->reply_to(correlation);
  if (!reply) {
    return judge.broken("the refusal of wire 2 to 9", reply.error());
  }
  protocol::FrameHeader header;
  header.message = static_cast<std::uint16_t>(MessageId::kStatusReply);
  header.session = probe->nonce();
  header.correlation = correlation;
  const protocol::StatusReply frozen{.status = StatusCode::kVersionMismatch,
                                     .request = static_cast<std::uint16_t>(MessageId::kHello),
                                     .pending_ms = 0,
                                     .text = std::string_view("no common wire version")};
  Bytes expected(protocol::kMaxFrameBytes);
  expected.resize(protocol::write_message(std::span(expected), header, frozen));
  if (reply->bytes != expected) {
    const auto [mine, theirs] = std::ranges::mismatch(expected, reply->bytes);
    judge.complain(fmt::format("the refusal differs from the frozen bytes at byte {} of {} (sequence {})",
                               mine - expected.begin(), expected.size(), reply->header.sequence));
    (void)theirs;
  }
  judge.measured(fmt::format("{} frozen bytes", expected.size()));
}

void check_before_hello(Subject& subject, Judgement& judge) {
  {
    // Makes sure that nobody else holds the device, and leaves a session of ours behind.
    auto earlier = WireProbe::greet(subject);
    if (!earlier) {
      return judge.broken("hello", earlier.error());
    }
  }
  for (int attempt = 0;; ++attempt) {
    auto probe = WireProbe::open(subject);
    if (!probe) {
      return judge.broken("open", probe.error());
    }
    probe->set_nonce(subject.next_nonce());
    const auto status = probe->status_of(protocol::GetStatus{});
    const bool busy = (status && *status == StatusCode::kBusy) ||
                      (!status && status.error().code == ErrorCode::kDisconnected);
    if (busy && attempt < 40 && subject.pause(std::chrono::milliseconds(50))) {
      continue;  // The earlier connection is not given up yet.
    }
    if (status) {
      judge.require(
          *status == StatusCode::kFailedPrecondition,
          fmt::format("a request before hello was answered {} when it should be FAILED_PRECONDITION",
                      protocol::info(*status).name));
      return;
    }
    if (status.error().code != ErrorCode::kDeadlineExceeded) {
      return judge.broken("a request before hello", status.error());
    }
    // A carrier without a notion of opening (a UART) cannot tell: to the device this is a stale session.
    const auto reply = probe->hello(subject);
    const auto counters = reply ? probe->status() : std::unexpected(reply.error());
    if (!counters) {
      return judge.broken("hello after a request that was not answered", counters.error());
    }
    judge.require(counters->stale_session > 0,
                  "a request before hello was neither refused nor counted as stale");
    judge.measured("counted as stale: the carrier does not tell when a host comes");
    return;
  }
}

void check_sequence(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  (void)probe->collect();
  const std::size_t before = probe->seen().size();
  if (const auto reply = probe->hello(subject); !reply) {
    return judge.broken("a second hello", reply.error());
  }
  for (int i = 0; i < 20; ++i) {
    if (const auto status = probe->status(); !status) {
      return judge.broken("a request", status.error());
    }
  }
  (void)probe->collect();
  std::array<std::uint32_t, protocol::kChannels> expected{};
  std::array<std::uint16_t, protocol::kChannels> last_correlation{};
  std::size_t counted = 0;
  for (std::size_t i = before; i < probe->seen().size(); ++i) {
    const protocol::FrameHeader& header = probe->seen()[i];
    if (header.session != probe->nonce()) {
      continue;
    }
    const auto lane = static_cast<std::size_t>(header.channel);
    const bool repeated = header.correlation != 0 && header.correlation == last_correlation[lane] &&
                          header.sequence + 1 == expected[lane];
    if (repeated) {
      continue;  // A slow device got the request twice and sent the same bytes again (SPEC 5.2).
    }
    ++counted;
    last_correlation[lane] = header.correlation;
    judge.equal(fmt::format("the sequence number on channel {}", lane), expected[lane]++, header.sequence);
  }
  judge.measured(fmt::format("{} frames", counted));
}

void check_stale_session(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  const auto before = probe->status();
  if (!before) {
    return judge.broken("get_status", before.error());
  }
  const std::uint16_t correlation = probe->next_correlation();
  protocol::FrameHeader header = probe->header(Channel::kControl, correlation);
  header.session = static_cast<std::uint16_t>(header.session ^ 0x5A5AU);
  header.message = static_cast<std::uint16_t>(MessageId::kGetStatus);
  if (const Status sent = probe->write(probe->raw_frame(header, {})); !sent) {
    return judge.broken("a request of another session", sent.error());
  }
  const auto answers = probe->collect();
  const bool silent = answers && std::ranges::none_of(*answers, [&](const Received& frame) {
                        return frame.is_control() && frame.header.correlation == correlation;
                      });
  judge.require(silent, "a request with another session's nonce was answered");
  const auto after = probe->status();
  if (!after) {
    return judge.broken("get_status", after.error());
  }
  judge.equal("the counter of stale frames", before->stale_session + 1, after->stale_session);
}

void check_new_session_ends_run(Subject& subject, Judgement& judge) {
  const auto descriptor = subject.descriptor();
  if (!descriptor) {
    return judge.broken("open", descriptor.error());
  }
  protocol::Recipe recipe = small_recipe(*descriptor);
  recipe.repeats = 1000;
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    return judge.broken("hello", probe.error());
  }
  const auto accepted =
      probe->ask<protocol::ConfigurationAccepted>(protocol::SetConfiguration{.recipe = recipe});
  if (!accepted) {
    return judge.broken("set_configuration", accepted.error());
  }
  const auto started =
      probe->ask<protocol::Started>(protocol::Start{.epoch = accepted->epoch, .may_send_until = 900});
  if (!started) {
    return judge.broken("start", started.error());
  }
  const auto reply = probe->hello(subject);
  if (!reply) {
    return judge.broken("hello while a run is on", reply.error());
  }
  judge.equal("the run state after hello", 0U, unsigned{reply->run_state});
  const auto later = probe->collect();
  judge.require(
      later && std::ranges::none_of(
                   *later, [](const Received& frame) { return frame.header.channel == Channel::kStream; }),
      "pixels of the old run came after the reply to the new session's hello");
  const auto status = probe->status();
  if (!status) {
    return judge.broken("get_status", status.error());
  }
  judge.equal("the run state", 0U, unsigned{status->run_state});
}

}  // namespace scatter::conformance
