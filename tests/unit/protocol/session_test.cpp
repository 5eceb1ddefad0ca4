#include "protocol/session.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "protocol/schema_description.h"
#include "tests/unit/protocol/test_bytes.h"

namespace scatter::protocol::test {
namespace {

constexpr std::uint32_t kLast = 0xFFFFFFFFU;

FrameHeader request(std::uint16_t session, std::uint16_t correlation, MessageId id = MessageId::kStart) {
  FrameHeader header;
  header.session = session;
  header.correlation = correlation;
  header.message = static_cast<std::uint16_t>(id);
  return header;
}

// PROVES: SPEC 7.2
TEST_CASE("Order of counters holds across the wrap at 2^32") {
  CHECK(comes_before(0, 1));
  CHECK_FALSE(comes_before(1, 0));
  CHECK_FALSE(comes_before(5, 5));
  CHECK(comes_before(kLast, 0));
  CHECK(comes_before(kLast - 10, 20));
  CHECK_FALSE(comes_before(20, kLast - 10));
  CHECK(comes_before(0, 0x7FFFFFFF));
}

// PROVES: SPEC 7.1, 7.2
TEST_CASE("Lost, repeated and late grants do no harm, across the wrap too") {
  for (const std::uint32_t start : {0U, 1000U, kLast - 5}) {
    CreditWindow credits;
    credits.restart(start + 4, start);
    CHECK(credits.may_send(start));
    CHECK(credits.may_send(start + 3));
    CHECK_FALSE(credits.may_send(start + 4));
    CHECK(credits.grant(start + 8));
    CHECK_FALSE(credits.grant(start + 8));  // Repeated.
    CHECK_FALSE(credits.grant(start + 6));  // Late.
    CHECK(credits.until() == start + 8);
    CHECK(credits.grant(start + 20));  // The grants between were lost.
    CHECK(credits.may_send(start + 19));
    CHECK_FALSE(credits.may_send(start + 20));
  }
}

// PROVES: SPEC 7.3
TEST_CASE("Settings epochs rise by one and never become 0") {
  EpochCounter fresh;
  CHECK(fresh.current() == 0);
  CHECK(fresh.advance() == 1);
  CHECK(fresh.advance() == 2);
  EpochCounter wrapping(kLast);
  CHECK(wrapping.advance() == 1);
}

TEST_CASE("Sequence numbers count per channel and wrap") {
  SequenceCounters sequence;
  sequence.reset(kLast);
  CHECK(sequence.next(Channel::kStream) == kLast);
  CHECK(sequence.next(Channel::kStream) == 0);
  CHECK(sequence.next(Channel::kControl) == kLast);
}

TEST_CASE("Gaps and repeats in sequence numbers are counted across the wrap") {
  SequenceTracker tracker;
  FrameHeader header;
  header.channel = Channel::kStream;
  const auto arrive = [&](std::uint32_t sequence) {
    header.sequence = sequence;
    return tracker.arrived(header);
  };
  CHECK(arrive(kLast - 1).missing == 0);
  CHECK(arrive(kLast).missing == 0);
  CHECK(arrive(2).missing == 2);
  CHECK(arrive(2).repeated);
  CHECK(arrive(kLast).repeated);
  CHECK(arrive(3).missing == 0);
  CHECK(tracker.missing() == 2);
  header.channel = Channel::kControl;
  CHECK(arrive(500).missing == 0);
}

// PROVES: SPEC 5.2
TEST_CASE("A repeated request gets the same bytes again and is executed once") {
  Bytes storage(2 * kMaxFrameBytes);
  ReplyCache cache(storage, 2);
  int executed = 0;
  const auto serve = [&](const FrameHeader& header) {
    if (cache.admit(header) == ReplyCache::Admission::kExecute) {
      ++executed;
      cache.store(header,
                  make_frame(Started{.run_id = static_cast<std::uint32_t>(executed), .device_time_us = 9}));
    }
    return copy(cache.reply(header));
  };
  const Bytes first = serve(request(1, 10));
  for (int i = 0; i < 5; ++i) {
    CHECK(serve(request(1, 10)) == first);
  }
  CHECK(executed == 1);
  CHECK(serve(request(1, 11)) != first);
  CHECK(serve(request(1, 10)) == first);  // The other slot kept it.
  CHECK(executed == 2);
  CHECK(serve(request(2, 10)) != first);  // Another session is another request.
  CHECK(executed == 3);
}

// PROVES: SPEC 5.2, 5.3
TEST_CASE("A request under way is not executed again, and PENDING gives way to the end") {
  Bytes storage(4096);
  ReplyCache cache(storage, 4);
  const FrameHeader step = request(1, 5, MessageId::kCalibrationStep);
  REQUIRE(cache.admit(step) == ReplyCache::Admission::kExecute);
  CHECK(cache.admit(step) == ReplyCache::Admission::kUnderWay);
  CHECK(cache.reply(step).empty());
  const Bytes pending =
      make_frame(StatusReply{.status = StatusCode::kPending, .request = 11, .pending_ms = 500});
  const Bytes end = make_frame(CalibrationPlaced{.placed = 1});
  REQUIRE(cache.store(step, pending));
  CHECK(cache.admit(step) == ReplyCache::Admission::kRepeat);
  CHECK(copy(cache.reply(step)) == pending);
  REQUIRE(cache.store(step, end));
  CHECK(copy(cache.reply(step)) == end);
}

TEST_CASE("The reply cache forgets the oldest request first and never mixes slots") {
  Bytes storage(8 * 64);
  ReplyCache cache(storage, 8);
  CHECK(cache.slot_bytes() == 64);
  const auto reply = [](std::uint16_t i) { return Bytes(1 + i % 64, static_cast<std::byte>(i)); };
  for (std::uint16_t i = 1; i < 500; ++i) {
    REQUIRE(cache.admit(request(1, i)) == ReplyCache::Admission::kExecute);
    REQUIRE(cache.store(request(1, i), reply(i)));
    for (std::uint16_t back = 0; back < std::min<std::uint16_t>(i, 8); ++back) {
      REQUIRE(copy(cache.reply(request(1, static_cast<std::uint16_t>(i - back)))) ==
              reply(static_cast<std::uint16_t>(i - back)));
    }
    if (i > 8) {
      REQUIRE(cache.reply(request(1, static_cast<std::uint16_t>(i - 8))).empty());
    }
  }
  CHECK_FALSE(cache.store(request(1, 499), Bytes(65)));
  CHECK(cache.admit(request(1, 0)) == ReplyCache::Admission::kUncached);
  cache.clear();
  CHECK(cache.admit(request(1, 498)) == ReplyCache::Admission::kExecute);
}

// PROVES: SPEC 6.2, 6.3
TEST_CASE("HELLO agrees on the highest common major and the lower payload limit") {
  Hello hello;
  hello.min_wire_major = 1;
  hello.max_wire_major = 5;
  hello.max_payload = 4096;
  hello.capabilities = 0b0110;
  const Offer device{.min_wire_major = 1, .max_wire_major = 3, .max_payload = 16384, .capabilities = 0b0011};
  const Negotiation answer = negotiate(hello, device, 0xABCD);
  REQUIRE(answer.status == StatusCode::kOk);
  CHECK(answer.reply.wire_major == 3);
  CHECK(answer.reply.max_payload == 4096);
  CHECK(answer.reply.schema_digest == 0xABCD);
  CHECK(answer.reply.capabilities == 0b0011);
  CHECK(common_capabilities(hello, answer.reply) == 0b0010);
}

// PROVES: SPEC 6.2, 6.3
TEST_CASE("HELLO is refused when no major is common or the payload limit is too low") {
  Hello hello;
  hello.min_wire_major = 2;
  hello.max_wire_major = 4;
  CHECK(negotiate(hello, {}, 0).status == StatusCode::kVersionMismatch);
  CHECK(negotiate(hello, {.min_wire_major = 5, .max_wire_major = 6}, 0).status ==
        StatusCode::kVersionMismatch);
  hello.min_wire_major = 1;
  hello.max_payload = kMinPayload - 1;
  const Negotiation low = negotiate(hello, {}, 0);
  CHECK(low.status == StatusCode::kInvalidArgument);
  CHECK(low.refusal.status == StatusCode::kInvalidArgument);
  CHECK(low.refusal.request == static_cast<std::uint16_t>(MessageId::kHello));
}

// PROVES: SPEC 5.1
TEST_CASE("Every request has a reply that exists") {
  for_each_message([]<typename M>() {
    if (is_request(M::kId)) {
      INFO(M::kName);
      CHECK(is_known(reply_of(M::kId)));
      CHECK(direction_of(reply_of(M::kId)) == Direction::kDeviceToHost);
      CHECK(channel_of(reply_of(M::kId)) == Channel::kControl);
    }
  });
  CHECK(reply_of(MessageId::kStart) == MessageId::kStarted);
  CHECK(reply_of(MessageId::kAbort) == MessageId::kRunReport);
  CHECK(reply_of(MessageId::kReboot) == MessageId::kStatusReply);
  CHECK_FALSE(is_request(MessageId::kCredit));
}

// PROVES: SPEC 7.4
TEST_CASE("The ledger balances exactly when every exposed frame is accounted for once") {
  Ledger ledger{.exposed = 21,
                .delivered = 6,
                .lost_sensor = 5,
                .lost_firmware = 4,
                .lost_link = 3,
                .lost_host = 2,
                .corrupt = 1};
  CHECK(ledger.balances());
  for (auto field : {&Ledger::exposed, &Ledger::delivered, &Ledger::lost_sensor, &Ledger::lost_firmware,
                     &Ledger::lost_link, &Ledger::lost_host, &Ledger::corrupt}) {
    Ledger wrong = ledger;
    ++(wrong.*field);
    CHECK_FALSE(wrong.balances());
  }
}

}  // namespace
}  // namespace scatter::protocol::test
