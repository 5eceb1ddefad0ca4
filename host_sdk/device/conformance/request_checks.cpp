// Requests, well formed and otherwise, and the bytes between them.
#include <algorithm>
#include <array>

#include "host_sdk/device/conformance/check_functions.h"
#include "host_sdk/device/conformance/wire_probe.h"

namespace scatter::conformance {

using protocol::Channel;
using protocol::MessageId;
using protocol::StatusCode;
using std::chrono::milliseconds;

namespace {

constexpr std::uint16_t kUnknownRequest = 0x7F01;
constexpr std::uint16_t kUnknownEvent = 0x7F02;

constexpr std::uint16_t number(MessageId id) noexcept {
  return static_cast<std::uint16_t>(id);
}

/// Replies among `frames` to `correlation` that are not PENDING.
std::vector<const Received*> replies(const std::vector<Received>& frames, std::uint16_t correlation) {
  std::vector<const Received*> out;
  for (const Received& frame : frames) {
    if (frame.is_control() && frame.header.correlation == correlation && !frame.is_pending()) {
      out.push_back(&frame);
    }
  }
  return out;
}

/// A session, or nothing and a complaint.
std::optional<WireProbe> greeted(Subject& subject, Judgement& judge) {
  auto probe = WireProbe::greet(subject);
  if (!probe) {
    judge.broken("hello", probe.error());
    return std::nullopt;
  }
  return std::move(*probe);
}

void expect_status(Judgement& judge, std::string_view what, const Result<StatusCode>& found,
                   StatusCode expected) {
  if (!found) {
    judge.broken(what, found.error());
  } else if (*found != expected) {
    judge.complain(fmt::format("{} was answered {} when it should be {}", what, protocol::info(*found).name,
                               protocol::info(expected).name));
  }
}

/// A served request proves that the device is in step; counters before and after tell what it saw.
void expect_served(WireProbe& probe, Judgement& judge, std::string_view after_what) {
  if (const auto status = probe.status(); !status) {
    judge.broken(fmt::format("a request after {}", after_what), status.error());
  }
}

}  // namespace

void check_one_reply(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  std::size_t answered = 0;
  const auto batch = [&](const std::array<std::pair<MessageId, MessageId>, 4>& ids,
                         const std::array<Bytes, 4>& frames,
                         const std::array<std::uint16_t, 4>& correlations) {
    Bytes together;
    for (const Bytes& frame : frames) {
      together.insert(together.end(), frame.begin(), frame.end());
    }
    if (const Status sent = probe->write(together); !sent) {
      return judge.broken("four requests at once", sent.error());
    }
    const auto got = probe->collect(milliseconds(500));
    if (!got) {
      return judge.broken("the replies to four requests", got.error());
    }
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const auto mine = replies(*got, correlations[i]);
      judge.equal(fmt::format("the number of replies to request 0x{:04X}", number(ids[i].first)),
                  std::size_t{1}, mine.size());
      if (mine.size() == 1) {
        ++answered;
        judge.equal("the reply's message id", number(ids[i].second), mine[0]->header.message);
        judge.equal("the reply's session", probe->nonce(), mine[0]->header.session);
      }
    }
  };
  std::array<std::uint16_t, 4> c{};
  std::ranges::generate(c, [&] { return probe->next_correlation(); });
  batch({{{MessageId::kGetStatus, MessageId::kDeviceStatus},
          {MessageId::kKeyValueGet, MessageId::kKeyValue},
          {MessageId::kObjectRead, MessageId::kObjectChunk},
          {MessageId::kCalibrationList, MessageId::kCalibrationListed}}},
        {probe->frame_of(protocol::GetStatus{}, c[0]),
         probe->frame_of(protocol::KeyValueGet{.key = std::string_view("serial")}, c[1]),
         probe->frame_of(protocol::ObjectRead{.object = 1, .offset = 0, .length = 64}, c[2]),
         probe->frame_of(protocol::CalibrationList{}, c[3])},
        c);
  std::ranges::generate(c, [&] { return probe->next_correlation(); });
  protocol::FrameHeader unknown = probe->header(Channel::kControl, c[3]);
  unknown.message = kUnknownRequest;
  batch({{{MessageId::kKeyValueGet, MessageId::kStatusReply},
          {MessageId::kObjectRead, MessageId::kStatusReply},
          {MessageId::kCalibrationEnd, MessageId::kStatusReply},
          {static_cast<MessageId>(kUnknownRequest), MessageId::kStatusReply}}},
        {probe->frame_of(protocol::KeyValueGet{.key = std::string_view("no such key")}, c[0]),
         probe->frame_of(protocol::ObjectRead{.object = 0xFFFF, .offset = 0, .length = 64}, c[1]),
         probe->frame_of(protocol::CalibrationEnd{.session = 0xFFFF'FFFF}, c[2]),
         probe->raw_frame(unknown, {})},
        c);
  judge.measured(fmt::format("{} of 8 requests answered once", answered));
}

void check_repeated_request(Subject& subject, Judgement& judge) {
  const auto descriptor = subject.descriptor();
  if (!descriptor) {
    return judge.broken("open", descriptor.error());
  }
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  const auto before = probe->status();
  if (!before) {
    return judge.broken("get_status", before.error());
  }
  // Every accepted configuration takes a new epoch, so executing it twice shows.
  const protocol::Recipe recipe = small_recipe(*descriptor);
  const std::uint16_t correlation = probe->next_correlation();
  const Bytes request = probe->frame_of(protocol::SetConfiguration{.recipe = recipe}, correlation);
  std::vector<Received> got;
  for (int i = 0; i < 3; ++i) {
    if (const Status sent = probe->write(request); !sent) {
      return judge.broken("set_configuration", sent.error());
    }
    auto reply = probe->reply_to(correlation);
    if (!reply) {
      return judge.broken(fmt::format("set_configuration, sent {} times", i + 1), reply.error());
    }
    got.push_back(std::move(*reply));
  }
  auto more = probe->collect();
  if (!more) {
    return judge.broken("silence after three replies", more.error());
  }
  std::ranges::move(*more, std::back_inserter(got));
  const auto mine = replies(got, correlation);
  judge.equal("the number of replies to a request sent three times", std::size_t{3}, mine.size());
  for (const Received* reply : mine) {
    judge.require(reply->bytes == mine[0]->bytes, "a repeated request got another reply");
  }
  const auto accepted = mine.empty() ? std::nullopt : mine[0]->as<protocol::ConfigurationAccepted>();
  const auto in_force = probe->ask<protocol::Configuration>(protocol::GetConfiguration{});
  const auto after = probe->status();
  if (!accepted || !in_force || !after) {
    return judge.complain("the configuration was not accepted, or cannot be read back");
  }
  judge.equal("the settings epoch after a request sent three times", accepted->epoch, in_force->epoch);
  judge.equal("the counter of duplicates", before->duplicates + 2, after->duplicates);
}

void check_unknown_messages(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  const auto before = probe->status();
  const std::uint16_t correlation = probe->next_correlation();
  protocol::FrameHeader request = probe->header(Channel::kControl, correlation);
  request.message = kUnknownRequest;
  expect_status(judge, "request 0x7F01", probe->status_of(probe->raw_frame(request, {}), correlation),
                StatusCode::kUnimplemented);
  if (const auto status = probe->last_reply().as<protocol::StatusReply>()) {
    judge.equal("the request that the reply names", unsigned{kUnknownRequest}, unsigned{status->request});
  }
  protocol::FrameHeader event = probe->header(Channel::kEvent, 0);
  event.message = kUnknownEvent;
  if (const Status sent = probe->write(probe->raw_frame(event, {})); !sent) {
    return judge.broken("event 0x7F02", sent.error());
  }
  const auto got = probe->collect();
  judge.require(got && std::ranges::none_of(*got, &Received::is_control), "an unknown event was answered");
  const auto after = probe->status();
  if (!before || !after) {
    return judge.complain("the device's status cannot be read");
  }
  judge.equal("the counter of unknown events", before->unknown_events + 1, after->unknown_events);
}

void check_bad_payload(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  const auto ask = [&](MessageId id, const Bytes& payload) {
    const std::uint16_t correlation = probe->next_correlation();
    protocol::FrameHeader header = probe->header(Channel::kControl, correlation);
    header.message = number(id);
    return probe->status_of(probe->raw_frame(header, payload), correlation);
  };
  expect_status(judge, "a key_value_get of one byte", ask(MessageId::kKeyValueGet, Bytes(1)),
                StatusCode::kInvalidArgument);
  expect_status(judge, "an object_read of three bytes", ask(MessageId::kObjectRead, Bytes(3)),
                StatusCode::kInvalidArgument);
  Bytes long_key(2 + 33, std::byte{'a'});
  long_key[0] = std::byte{33};
  long_key[1] = std::byte{0};
  expect_status(judge, "a key of 33 bytes", ask(MessageId::kKeyValueGet, long_key),
                StatusCode::kInvalidArgument);
}

void check_payload_evolution(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  const std::uint16_t correlation = probe->next_correlation();
  protocol::FrameHeader header = probe->header(Channel::kControl, correlation);
  header.message = number(MessageId::kObjectRead);
  // Missing fields are zero, and object 0 does not exist.
  expect_status(judge, "an object_read without fields",
                probe->status_of(probe->raw_frame(header, {}), correlation), StatusCode::kNotFound);
  Bytes payload(64, std::byte{0xEE});
  const auto size =
      protocol::encode(protocol::ObjectRead{.object = 1, .offset = 0, .length = 16}, std::span(payload));
  const std::uint16_t second = probe->next_correlation();
  header.sequence += 1;
  header.correlation = second;
  expect_status(judge, fmt::format("an object_read with {} bytes behind its fields", payload.size() - *size),
                probe->status_of(probe->raw_frame(header, payload), second), StatusCode::kOk);
}

void check_flags(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  const auto ask = [&](std::uint8_t incompatible, std::uint8_t compatible) {
    const std::uint16_t correlation = probe->next_correlation();
    protocol::FrameHeader header = probe->header(Channel::kControl, correlation);
    header.message = number(MessageId::kGetStatus);
    header.incompatible_flags = incompatible;
    header.compatible_flags = compatible;
    return probe->status_of(probe->raw_frame(header, {}), correlation);
  };
  expect_status(judge, "a request with incompatible flag 0x80", ask(0x80, 0), StatusCode::kVersionMismatch);
  expect_status(judge, "a request with compatible flags 0xFF", ask(0, 0xFF), StatusCode::kOk);
}

void check_garbage(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  const auto before = probe->status();
  Bytes garbage(999);
  std::uint32_t state = 0x2545F491;
  for (std::size_t i = 0; i < garbage.size(); ++i) {
    state = state * 1664525U + 1013904223U;
    garbage[i] = static_cast<std::byte>(state >> 24U);
    if (i % 37 == 1) {  // Where a frame seems to begin.
      garbage[i - 1] = std::byte{0xA7};
      garbage[i] = std::byte{0x5C};
    }
  }
  if (const Status sent = probe->write(garbage); !sent) {
    return judge.broken("999 bytes of garbage", sent.error());
  }
  const auto after = probe->status();
  if (!before || !after) {
    return judge.broken("a request after garbage", after ? before.error() : after.error());
  }
  judge.measured(fmt::format("{} of 999 bytes counted as skipped, {} bad headers",
                             after->bytes_skipped - before->bytes_skipped,
                             after->frames_bad_header - before->frames_bad_header));
}

void check_damaged_frames(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  // One flipped bit in each part of a frame: magic, id, length, session, header's checksum, payload, its
  // checksum.
  const protocol::KeyValueGet request{.key = std::string_view("serial")};
  std::size_t tried = 0;
  std::vector<std::uint16_t> damaged;
  for (const std::size_t byte : {std::size_t{0}, std::size_t{6}, std::size_t{8}, std::size_t{16},
                                 std::size_t{20}, std::size_t{26}, std::size_t{33}}) {
    const std::uint16_t correlation = probe->next_correlation();
    Bytes frame = probe->frame_of(request, correlation);
    frame[byte] ^= std::byte{0x04};
    if (const Status sent = probe->write(frame); !sent) {
      return judge.broken("a damaged frame", sent.error());
    }
    const std::uint16_t whole = probe->next_correlation();
    if (const Status sent = probe->write(probe->frame_of(request, whole)); !sent) {
      return judge.broken("the frame after it", sent.error());
    }
    const auto reply = probe->reply_to(whole);
    judge.require(reply.has_value(),
                  fmt::format("the frame after a bit flip in byte {} was not answered", byte));
    damaged.push_back(correlation);
    ++tried;
  }
  (void)probe->collect();
  for (const protocol::FrameHeader& header : probe->seen()) {
    judge.require(std::ranges::find(damaged, header.correlation) == damaged.end(),
                  "a damaged frame was answered");
  }
  judge.measured(fmt::format("{} flips", tried));
}

void check_cut_frame(Subject& subject, Judgement& judge) {
  auto probe = greeted(subject, judge);
  if (!probe) {
    return;
  }
  // A header that promises 1000 bytes which never come.
  const Bytes whole =
      probe->raw_frame(probe->header(Channel::kControl, probe->next_correlation()), Bytes(1000));
  if (const Status sent = probe->write(std::span(whole).first(100)); !sent) {
    return judge.broken("a tenth of a frame", sent.error());
  }
  const device::TimePoint cut = probe->now();
  expect_served(*probe, judge, "a frame that was cut");
  judge.measured(fmt::format("served again after {:.0f} ms",
                             std::chrono::duration<double, std::milli>(probe->now() - cut).count()));
}

}  // namespace scatter::conformance
