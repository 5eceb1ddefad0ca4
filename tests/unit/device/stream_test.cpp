#include <catch2/catch.hpp>
#include <cstring>
#include <random>

#include "tests/unit/device/scripted_device.h"

namespace scatter::device::test {
namespace {

using namespace std::chrono_literals;
using protocol::MessageId;

Stream start(Pair& pair, std::uint16_t frames, std::uint32_t window = 4) {
  REQUIRE(pair.host);
  REQUIRE(pair.host->configure(test_recipe(frames)));
  Result<Stream> stream = pair.host->start({.recorder = nullptr, .credit_window = window});
  REQUIRE(stream);
  return std::move(*stream);
}

bool pixels_are(const Frame& frame, std::uint32_t id) {
  const Bytes expected = test_pixels(id);
  return frame.bytes().size() == expected.size() &&
         std::memcmp(frame.bytes().data(), expected.data(), expected.size()) == 0;
}

/// Acts on one wire frame per exposure, or on all: returns what goes out instead.
using Act = std::function<std::vector<Bytes>(int index, Bytes)>;
void on_stream(ScriptedDevice& device, Act act) {
  device.script.outgoing = [act = std::move(act), index = 0](const protocol::FrameHeader& header,
                                                             Bytes frame) mutable {
    if (header.channel != protocol::Channel::kStream) {
      return std::vector<Bytes>{std::move(frame)};
    }
    return act(index++, std::move(frame));
  };
}

TEST_CASE("A clean run delivers every frame whole, in order, and the ledger balances") {
  Pair pair = open_pair();
  Stream stream = start(pair, 20);
  const std::vector<Frame> frames = drain(stream);
  REQUIRE(frames.size() == 20);
  for (std::uint32_t k = 0; k < 20; ++k) {
    CHECK(frames[k].begin.frame_id == k);
    CHECK(frames[k].begin.epoch == 1);
    CHECK(frames[k].status == FrameStatus::kComplete);
    CHECK(pixels_are(frames[k], k));
  }
  const RunSummary summary = stream.summary();
  CHECK(summary.device_reported);
  CHECK(summary.ledger == protocol::Ledger{.exposed = 20, .delivered = 20});
  CHECK(summary.ledger.balances());
}

TEST_CASE("The device is never allowed more than the credit window ahead of the caller") {
  Pair pair = open_pair();
  Stream stream = start(pair, 12, 3);
  std::uint32_t taken = 0;
  while (true) {
    const auto frame = stream.next();
    REQUIRE(frame);
    if (!*frame) {
      break;
    }
    ++taken;
    REQUIRE(pair.device->credits.back() == taken + 3);
  }
  CHECK(taken == 12);
  CHECK(std::ranges::is_sorted(pair.device->credits));
}

TEST_CASE("Lost and doubled credits do no harm") {
  Pair pair = open_pair();
  int count = 0;
  pair.device->script.incoming = [&count](const protocol::Frame& frame) {
    return frame.id() != MessageId::kCredit || ++count % 3 == 0;
  };
  Stream stream = start(pair, 15, 2);
  CHECK(drain(stream).size() == 15);
  CHECK(stream.summary().ledger.balances());
}

// PROVES: protocol.md 2, a frame is delivered complete or incomplete, never patched.
TEST_CASE("Each lost wire frame makes exactly its frame incomplete and names what is missing") {
  for (int lost = 0; lost < 3 * kWirePerFrame; ++lost) {
    Pair pair = open_pair();
    on_stream(*pair.device, [lost](int index, Bytes frame) {
      return index == lost ? std::vector<Bytes>{} : std::vector<Bytes>{std::move(frame)};
    });
    Stream stream = start(pair, 3);
    const std::vector<Frame> frames = drain(stream);
    REQUIRE(frames.size() == 3);
    for (std::uint32_t k = 0; k < 3; ++k) {
      CHECK(frames[k].begin.frame_id == k);
      const bool hit = static_cast<int>(k) == lost / kWirePerFrame;
      CHECK((frames[k].status == FrameStatus::kIncomplete) == hit);
      const int part = lost % kWirePerFrame;
      if (!hit) {
        CHECK(pixels_are(frames[k], k));
      } else if (part == 0) {
        CHECK_FALSE(frames[k].has_begin);
        CHECK(frames[k].missing.empty());
      } else if (part == kWirePerFrame - 1) {
        CHECK_FALSE(frames[k].has_end);
        CHECK(frames[k].missing.empty());
      } else {
        const std::uint32_t at = static_cast<std::uint32_t>(part - 1) * kChunkBytes;
        const ByteRange gap{at, std::min(at + kChunkBytes, kFrameBytes)};
        REQUIRE(frames[k].missing == std::vector<ByteRange>{gap});
        Bytes expected = test_pixels(k);
        std::fill(expected.begin() + gap.begin, expected.begin() + gap.end, std::byte{0});
        CHECK(std::memcmp(frames[k].bytes().data(), expected.data(), expected.size()) == 0);
      }
    }
    const protocol::Ledger ledger = stream.summary().ledger;
    CHECK(ledger == protocol::Ledger{.exposed = 3, .delivered = 2, .lost_link = 1});
    CHECK(ledger.balances());
  }
}

TEST_CASE("Every single damaged bit of the stream is noticed") {
  // One bit in each byte of the second exposure's wire frames.
  for (int wire = kWirePerFrame; wire < 2 * kWirePerFrame; ++wire) {
    for (std::size_t byte = 0; byte < 60; ++byte) {
      Pair pair = open_pair();
      on_stream(*pair.device, [&](int index, Bytes frame) {
        if (index == wire) {
          frame[byte % frame.size()] ^= static_cast<std::byte>(1U << (byte % 8));
        }
        return std::vector<Bytes>{std::move(frame)};
      });
      Stream stream = start(pair, 3);
      const std::vector<Frame> frames = drain(stream);
      REQUIRE(frames.size() == 3);
      CHECK(frames[1].status == FrameStatus::kIncomplete);
      CHECK(pixels_are(frames[0], 0));
      CHECK(pixels_are(frames[2], 2));
      CHECK(stream.summary().ledger.balances());
      CHECK(stream.summary().ledger.lost_link == 1);
    }
  }
}

TEST_CASE("Doubled and swapped wire frames change nothing but the counters") {
  Pair pair = open_pair();
  SECTION("doubled") {
    on_stream(*pair.device, [](int, Bytes frame) { return std::vector<Bytes>{frame, frame}; });
    Stream stream = start(pair, 10);
    const std::vector<Frame> frames = drain(stream);
    REQUIRE(frames.size() == 10);
    for (std::uint32_t k = 0; k < 10; ++k) {
      CHECK(pixels_are(frames[k], k));
    }
    CHECK(stream.summary().link.duplicate_chunks > 0);
    CHECK(stream.summary().ledger == protocol::Ledger{.exposed = 10, .delivered = 10});
  }
  SECTION("swapped in pairs") {
    on_stream(*pair.device, [kept = Bytes()](int index, Bytes frame) mutable {
      if (index % 2 == 0) {
        kept = std::move(frame);
        return std::vector<Bytes>{};
      }
      return std::vector<Bytes>{std::move(frame), std::move(kept)};
    });
    Stream stream = start(pair, 10);
    const std::vector<Frame> frames = drain(stream);
    REQUIRE(frames.size() == 10);
    for (std::uint32_t k = 0; k < 10; ++k) {
      CHECK(frames[k].status == FrameStatus::kComplete);
      CHECK(pixels_are(frames[k], k));
    }
    CHECK(stream.summary().ledger.balances());
  }
}

// PROVES: protocol.md 2, the loss ledger.
TEST_CASE("Each kind of loss lands in its own column and the ledger balances") {
  Pair pair = open_pair();
  SECTION("sensor and firmware") {
    pair.device->script.lose_in_sensor = 2;
    pair.device->script.lose_in_firmware = 3;
    Stream stream = start(pair, 9);
    CHECK(drain(stream).size() == 4);
    CHECK(stream.summary().ledger ==
          protocol::Ledger{.exposed = 9, .delivered = 4, .lost_sensor = 2, .lost_firmware = 3});
  }
  SECTION("corrupt") {
    pair.device->script.corrupt_checksum = true;
    Stream stream = start(pair, 3);
    for (const Frame& frame : drain(stream)) {
      CHECK(frame.status == FrameStatus::kCorrupt);
    }
    CHECK(stream.summary().ledger == protocol::Ledger{.exposed = 3, .corrupt = 3});
  }
  SECTION("host") {
    Stream stream = start(pair, 100, 8);
    REQUIRE(stream.next());
    const Result<RunSummary> summary = stream.abort();
    REQUIRE(summary);
    CHECK(summary->reason == protocol::RunEnd::kAborted);
    CHECK(summary->ledger.delivered == 1);
    CHECK(summary->ledger.balances());
    CHECK(summary->ledger.lost_link == 0);
  }
  SECTION("link, whole window at once") {
    on_stream(*pair.device, [](int index, Bytes frame) {
      return index < 8 * kWirePerFrame ? std::vector<Bytes>{} : std::vector<Bytes>{std::move(frame)};
    });
    Stream stream = start(pair, 10, 4);
    CHECK(drain(stream).size() == 2);
    CHECK(stream.summary().ledger == protocol::Ledger{.exposed = 10, .delivered = 2, .lost_link = 8});
  }
  SECTION("link, random, any seed") {
    for (unsigned seed = 0; seed < 30; ++seed) {
      Pair lossy = open_pair();
      std::mt19937 random(seed);
      on_stream(*lossy.device, [&random](int, Bytes frame) {
        switch (random() % 12) {
          case 0:
            return std::vector<Bytes>{};
          case 1:
            return std::vector<Bytes>{frame, frame};
          case 2:
            frame[random() % frame.size()] ^= std::byte{0x40};
            return std::vector<Bytes>{std::move(frame)};
          default:
            return std::vector<Bytes>{std::move(frame)};
        }
      });
      Stream stream = start(lossy, 40);
      std::uint64_t whole = 0;
      for (const Frame& frame : drain(stream)) {
        if (frame.status == FrameStatus::kComplete) {
          ++whole;
          CHECK(pixels_are(frame, frame.begin.frame_id));
        }
      }
      const protocol::Ledger ledger = stream.summary().ledger;
      CHECK(ledger.balances());
      CHECK(ledger.delivered == whole);
      CHECK(ledger.lost_link == 40 - whole);
    }
  }
}

TEST_CASE("A lost RunFinished is asked for and the run still ends with the device's ledger") {
  Pair pair = open_pair([](ScriptedDevice& device) { device.script.silent_end = true; });
  Stream stream = start(pair, 5);
  CHECK(drain(stream).size() == 5);
  CHECK(stream.summary().device_reported);
  CHECK(stream.summary().ledger == protocol::Ledger{.exposed = 5, .delivered = 5});
}

TEST_CASE("Frames that arrive while another request waits for its reply are not lost") {
  Pair pair = open_pair();
  Stream stream = start(pair, 4, 4);
  pair.device->script.request = [&](const protocol::Frame& frame) {
    if (frame.id() != MessageId::kGetStatus) {
      return false;
    }
    pair.device->answer(frame.header(), protocol::DeviceStatus{}, 100ms);
    return true;
  };
  REQUIRE(pair.host->status());
  CHECK(drain(stream).size() == 4);
}

TEST_CASE("A device that closes mid-frame: whole frames are handed out, then DISCONNECTED") {
  Pair pair = open_pair();
  on_stream(*pair.device, [&](int index, Bytes frame) {
    if (index == 2 * kWirePerFrame + 2) {
      frame.resize(frame.size() / 2);
      pair.device->hang_up();
      pair.device->running = false;
    }
    return index > 2 * kWirePerFrame + 2 ? std::vector<Bytes>{} : std::vector<Bytes>{std::move(frame)};
  });
  Stream stream = start(pair, 6);
  std::vector<FrameStatus> seen;
  ErrorCode code{};
  for (;;) {
    const auto frame = stream.next();
    if (!frame) {
      code = frame.error().code;
      break;
    }
    REQUIRE(*frame);
    seen.push_back((*frame)->status);
  }
  CHECK(seen == std::vector{FrameStatus::kComplete, FrameStatus::kComplete, FrameStatus::kIncomplete});
  CHECK(code == ErrorCode::kDisconnected);
  CHECK_FALSE(stream.summary().device_reported);
  CHECK(stream.summary().ledger.balances());
}

TEST_CASE("A device that restarts during the run is told with its reason") {
  Pair pair = open_pair();
  Stream stream = start(pair, 100, 2);
  REQUIRE(stream.next());
  pair.device->script.request = [&](const protocol::Frame& frame) {
    if (frame.id() == MessageId::kHello) {
      protocol::HelloReply reply;
      reply.boot_count = 4;
      reply.reset_reason = static_cast<std::uint8_t>(protocol::ResetReason::kWatchdog);
      pair.device->answer(frame.header(), reply);
    } else {
      pair.device->answer_status(frame.header(), protocol::StatusCode::kFailedPrecondition,
                                 "say HELLO first");
    }
    return true;
  };
  pair.device->running = false;
  Result<std::optional<Frame>> frame = stream.next();
  while (frame && *frame) {
    frame = stream.next();
  }
  REQUIRE_FALSE(frame);
  CHECK(frame.error().code == ErrorCode::kDisconnected);
  CHECK(frame.error().what.find("watchdog") != std::string::npos);
}

TEST_CASE("A silent device ends next() at its deadline, and the stream goes on after it") {
  Pair pair = open_pair();
  Stream stream = start(pair, 3);
  pair.device->running = false;
  pair.device->script.incoming = [](const protocol::Frame&) { return false; };
  const TimePoint before = pair.device->now();
  const auto frame = stream.next({.timeout = 3s, .stop = {}});
  REQUIRE_FALSE(frame);
  CHECK(frame.error().code == ErrorCode::kDeadlineExceeded);
  CHECK(pair.device->now() - before <= 3s + 20ms);
  pair.device->script.incoming = {};
  pair.device->running = true;
  CHECK(drain(stream).size() == 3);
}

TEST_CASE("request_stop ends the run after the frame in hand; stop() waits for it") {
  Pair pair = open_pair();
  Stream stream = start(pair, 1000, 4);
  REQUIRE(stream.next());
  SECTION("request_stop") {
    stream.request_stop();
  }
  SECTION("stop") {
    REQUIRE(stream.stop());
  }
  const std::vector<Frame> rest = drain(stream);
  CHECK(rest.size() < 10);
  const RunSummary summary = stream.summary();
  CHECK(summary.reason == protocol::RunEnd::kStopped);
  CHECK(summary.ledger.balances());
  CHECK(summary.ledger.lost_link == 0);
  CHECK_FALSE(pair.device->running);
}

// PROVES: issue 2, ctrl-C at any moment leaves the device stopped.
TEST_CASE("Dropping a stream, or its device, leaves the device stopped") {
  Pair pair = open_pair();
  std::optional<Stream> stream(start(pair, 1000, 4));
  REQUIRE(stream->next());
  SECTION("the stream") {
    stream.reset();
    CHECK(pair.device->aborted);
  }
  SECTION("after a stop request") {
    std::stop_source source;
    source.request_stop();
    (void)stream->next({.timeout = 1s, .stop = source.get_token()});
    stream.reset();
    CHECK(pair.device->aborted);
  }
  SECTION("a hung device, within a second") {
    pair.device->script.incoming = [](const protocol::Frame&) { return false; };
    const TimePoint before = pair.device->now();
    stream.reset();
    CHECK(pair.device->now() - before <= 1s + 250ms);
  }
}

TEST_CASE("The device outlived by its stream is stopped, and the stream says so") {
  std::optional<Pair> pair(open_pair());
  Stream stream = start(*pair, 1000, 4);
  pair.reset();
  Result<std::optional<Frame>> frame = stream.next();
  while (frame && *frame) {
    frame = stream.next();
  }
  if (!frame) {
    CHECK(frame.error().code == ErrorCode::kDisconnected);
  }
}

TEST_CASE("After an abort the next run starts clean, without frames of the last one") {
  Pair pair = open_pair();
  {
    Stream stream = start(pair, 1000, 4);
    REQUIRE(stream.next());
    REQUIRE(stream.abort());
  }
  Stream again = start(pair, 3);
  const std::vector<Frame> frames = drain(again);
  REQUIRE(frames.size() == 3);
  for (const Frame& frame : frames) {
    CHECK(frame.begin.run_id == 2);
    CHECK(frame.begin.epoch == 2);
  }
}

TEST_CASE("A second stream at once is refused") {
  Pair pair = open_pair();
  Stream stream = start(pair, 50);
  const Result<Stream> second = pair.host->start();
  REQUIRE_FALSE(second);
  CHECK(second.error().code == ErrorCode::kFailedPrecondition);
}

TEST_CASE("A device that ignores credits cannot fill the host's memory") {
  Pair pair = open_pair([](ScriptedDevice& device) { device.script.ignore_credit = true; });
  Stream stream = start(pair, 500, 2);
  // Asking for the status pumps everything that the device sends meanwhile.
  for (int k = 0; k < 20; ++k) {
    REQUIRE(pair.host->status());
  }
  std::size_t whole = 0;
  for (const Frame& frame : drain(stream)) {
    whole += frame.status == FrameStatus::kComplete ? 1U : 0U;
  }
  CHECK(stream.summary().ledger.balances());
  CHECK(stream.summary().ledger.delivered == whole);
}

TEST_CASE("Self test finds each wrong pixel of the counter pattern") {
  const std::uint32_t wrong_by = GENERATE(0U, 1U);
  Pair pair = open_pair([&](ScriptedDevice& device) { device.script.pattern_error = wrong_by; });
  REQUIRE(pair.host);
  const auto report = pair.host->self_test(2);
  REQUIRE(report);
  CHECK(report->frames == 2);
  CHECK(report->pixels == 2 * kWidth * kHeight);
  CHECK(report->wrong_pixels == (wrong_by == 0 ? 0U : report->pixels));
}

}  // namespace
}  // namespace scatter::device::test
