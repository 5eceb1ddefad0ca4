#include <array>
#include <catch2/catch.hpp>

#include "tests/unit/firmware/fake_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

/// exposed - lost_sensor - lost_firmware must be the frames whose end was sent; nothing else is lost here.
void check_ledger(const Ledger& ledger, std::uint32_t frames_sent) {
  CHECK(ledger.exposed == ledger.lost_sensor + ledger.lost_firmware + frames_sent);
  CHECK(ledger.delivered == 0);
  CHECK(ledger.lost_link == 0);
  CHECK(ledger.lost_host == 0);
  CHECK(ledger.corrupt == 0);
}

std::size_t whole_frames(const FakeHost& host) {
  return static_cast<std::size_t>(std::count_if(host.frames.begin(), host.frames.end(),
                                                [](const HostFrame& f) { return f.end.has_value(); }));
}

std::vector<std::uint16_t> unpack(const HostFrame& frame, std::uint32_t bits) {
  std::vector<std::uint16_t> pixels;
  std::uint64_t position = 0;
  while (position + bits <= frame.bytes.size() * 8 &&
         pixels.size() < std::size_t{frame.begin.width} * frame.begin.height) {
    std::uint32_t value = 0;
    for (std::uint32_t b = 0; b < bits; ++b, ++position) {
      const auto byte = static_cast<std::uint32_t>(frame.bytes[position / 8]);
      value |= ((byte >> (position % 8)) & 1U) << b;
    }
    pixels.push_back(static_cast<std::uint16_t>(value));
  }
  return pixels;
}

}  // namespace

TEST_CASE(
    "A fixed recipe runs sweeps outermost, LED-off frames first, every exposure of every illumination") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const Recipe recipe = fixed_recipe();
  const auto accepted = host.ask(SetConfiguration{.recipe = recipe}).as<ConfigurationAccepted>();
  CHECK(accepted.planned_frames == 10);
  // 2 sweeps x (off 20 ms + 2 x (1 + 20 ms)) + 10 readouts of 16 ms.
  CHECK(accepted.planned_duration_us == 2 * (20'000 + 2 * 21'000) + 10 * 16'000);
  const std::uint32_t run = host.start(accepted.epoch);
  REQUIRE(host.run(10'000'000, [&] { return !host.all<RunFinished>().empty(); }));

  REQUIRE(host.frames.size() == 10);
  struct Expected {
    std::uint8_t illumination;
    std::uint32_t exposure_us;
    std::uint8_t bracket;
  };
  const Expected sweep[] = {{255, 20'000, 0}, {0, 1'000, 0}, {0, 20'000, 1}, {4, 1'000, 0}, {4, 20'000, 1}};
  for (std::size_t i = 0; i < 10; ++i) {
    const FrameBegin& b = host.frames[i].begin;
    const Expected& e = sweep[i % 5];
    INFO("frame " << i);
    CHECK(b.run_id == run);
    CHECK(b.frame_id == i);
    CHECK(b.epoch == accepted.epoch);
    CHECK(b.sweep == i / 5);
    CHECK(b.illumination == e.illumination);
    CHECK(b.exposure_us == e.exposure_us);
    CHECK(b.bracket == e.bracket);
    CHECK(b.kind == (e.illumination == 255 ? FrameKind::kAmbient : FrameKind::kLight));
    CHECK(b.monitor_uv == (e.illumination == 255 ? 0U : 500'000U));
    CHECK(b.sensor_temperature_mK == 298'150);
    CHECK(b.bits == 10);
    REQUIRE(host.frames[i].end);
    CHECK(host.frames[i].end->flags == 0);
    // Scene: 0.01 DN/us with the LED on, black level 16.
    const auto expected = static_cast<std::uint16_t>(e.illumination == 255 ? 16 : 16 + e.exposure_us / 100);
    const auto pixels = unpack(host.frames[i], 16);
    CHECK(pixels.size() == kWidth * kHeight);
    CHECK(std::all_of(pixels.begin(), pixels.end(), [&](std::uint16_t p) { return p == expected; }));
    CHECK(host.frames[i].end->max_dn == expected);
  }
  const RunFinished finished = host.all<RunFinished>().back();
  CHECK(finished.reason == static_cast<std::uint8_t>(RunEnd::kCompleted));
  CHECK(finished.frames_sent == 10);
  CHECK(finished.held_us == 0);
  CHECK(finished.ended_us - finished.started_us == accepted.planned_duration_us);
  check_ledger(finished.ledger, finished.frames_sent);
  CHECK(board.optics.lit == Illuminator::kNone);
}

TEST_CASE("Dark cap frames are of kind dark and need no illumination") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  Recipe recipe;
  recipe.target = Target::kDarkCap;
  recipe.off_frames = 3;
  recipe.off_exposure_us = 5'000;
  host.measure(recipe);
  REQUIRE(host.frames.size() == 3);
  for (const HostFrame& frame : host.frames) {
    CHECK(frame.begin.kind == FrameKind::kDark);
    CHECK(frame.begin.exposure_us == 5'000);
    CHECK(frame.begin.illumination == 255);
  }
}

TEST_CASE("A window is read from where it lies, costs its share of rows, and packs as the format says") {
  for (const PixelFormat format : {PixelFormat::kMono16, PixelFormat::kMono10p, PixelFormat::kMono12p}) {
    for (const std::uint32_t max_payload : {1024U, 16384U}) {
      FakeBoard board;
      board.optics.scene = [](std::uint8_t, std::uint32_t x, std::uint32_t y) {
        return static_cast<float>(x * 13 + y) / 1000.F;
      };
      FakeHost host(board);
      host.max_payload = max_payload;
      host.hello();
      Recipe recipe;
      recipe.illuminations.push_back(1);
      recipe.exposures_us.push_back(1'000);
      recipe.region_x = 5;
      recipe.region_y = 12;
      recipe.region_width = 37;
      recipe.region_height = 31;
      recipe.pixel_format = format;
      const RunFinished finished = host.measure(recipe);
      CHECK(finished.ended_us - finished.started_us == 1'000 + kReadoutUs);  // The fake reads at full cost.
      CHECK(host.ask(GetConfiguration{}).as<Configuration>().recipe == recipe);
      REQUIRE(host.frames.size() == 1);
      const std::uint32_t bits = format == PixelFormat::kMono16    ? 16
                                 : format == PixelFormat::kMono10p ? 10
                                                                   : 12;
      CHECK(host.frames[0].bytes.size() == (37 * 31 * bits + 7) / 8);
      const auto pixels = unpack(host.frames[0], bits);
      REQUIRE(pixels.size() == 37 * 31);
      for (std::uint32_t y = 0; y < 31; ++y) {
        for (std::uint32_t x = 0; x < 37; ++x) {
          REQUIRE(pixels[y * 37 + x] == 16 + (x + 5) * 13 + (y + 12));
        }
      }
    }
  }
}

TEST_CASE("Saturated pixels are counted, hot ones included; the brightest leaves hot pixels out") {
  FakeBoard board;
  board.factory.add_hot_pixel(3, 7);
  board.factory.add_hot_pixel(60, 40);
  board.optics.scene = [](std::uint8_t, std::uint32_t x, std::uint32_t y) {
    if (x == 3 && y == 7) {
      return 10.F;  // Hot and saturated.
    }
    if (x == 60 && y == 40) {
      return 0.9F;  // Hot, bright, not saturated.
    }
    return y == 0 ? 5.F : 0.3F;  // The first row saturates.
  };
  FakeHost host(board);
  host.hello();
  Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1'000);
  host.measure(recipe);
  REQUIRE(host.frames.size() == 1);
  CHECK(host.frames[0].end->saturated_pixels == kWidth + 1);
  CHECK(host.frames[0].end->max_dn == 316);
}

TEST_CASE("The self test sends pixel k of frame n as (7919 n + k) modulo 1024, without LED or sensor") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  Recipe recipe = fixed_recipe();
  recipe.test_pattern = 1;
  const RunFinished finished = host.measure(recipe);
  CHECK(board.optics.triggers == 0);
  CHECK(finished.ended_us - finished.started_us == 2 * (20'000 + 2 * 21'000) + 10 * 16'000);
  REQUIRE(host.frames.size() == 10);
  for (const HostFrame& frame : host.frames) {
    CHECK((frame.end->flags & kFrameTestPattern) != 0);
    const auto pixels = unpack(frame, 16);
    bool good = true;
    for (std::uint32_t k = 0; k < pixels.size(); ++k) {
      good = good && pixels[k] == ((frame.begin.frame_id * 7919 + k) & 1023U);
    }
    CHECK(good);
  }
}

TEST_CASE("Without credit a recipe holds the next exposure, loses nothing and reports the hold") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  const std::uint32_t run = host.start(host.configure(fixed_recipe()), 3);
  host.run_for(2'000'000);
  CHECK(whole_frames(host) == 3);
  CHECK(board.optics.triggers == 3);
  CHECK(host.instrument().run_state() == RunState::kHolding);
  host.grant(run, 2);  // Lower than before: ignored.
  host.grant(run + 1, 100);
  host.run_for(1'000'000);
  CHECK(whole_frames(host) == 3);
  host.grant(run, 5);
  host.grant(run, 5);
  host.run_for(1'000'000);
  CHECK(whole_frames(host) == 5);
  host.grant(run, 1000);
  host.run_for(2'000'000);
  REQUIRE(whole_frames(host) == 10);
  for (const HostFrame& frame : host.frames) {
    const bool held = frame.begin.frame_id == 3 || frame.begin.frame_id == 5;
    CHECK(((frame.end->flags & kFrameHeldForCredit) != 0) == held);
  }
  REQUIRE(host.all<RunFinished>().size() == 1);
  const RunFinished finished = host.all<RunFinished>()[0];
  // All time that was not exposure or readout was a hold.
  CHECK(finished.held_us ==
        finished.ended_us - finished.started_us - (2 * (20'000 + 2 * 21'000) + 10 * 16'000));
  check_ledger(finished.ledger, finished.frames_sent);
  CHECK(finished.ledger.exposed == 10);
}

TEST_CASE("Live preview drops whole frames without credit and counts them") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1'000);
  recipe.repeats = 20;
  recipe.live_preview = 1;
  const std::uint32_t run = host.start(host.configure(recipe), 2);
  host.run_for(17'000 * 9 + 500);
  host.grant(run, 12);
  REQUIRE(host.run(10'000'000, [&] { return !host.all<RunFinished>().empty(); }));
  const RunFinished finished = host.all<RunFinished>()[0];
  CHECK(finished.ledger.exposed == 20);
  CHECK(finished.frames_sent == whole_frames(host));
  CHECK(finished.ledger.lost_firmware == 20 - whole_frames(host));
  CHECK(host.frames.front().begin.frame_id == 0);
  CHECK(host.frames.back().begin.frame_id == 11);  // Stamped before anything was dropped.
  CHECK(finished.held_us == 0);
  check_ledger(finished.ledger, finished.frames_sent);
}

TEST_CASE("Stop ends after the frame in hand, whose end comes before the report") {
  FakeBoard board;
  board.link.capacity = GENERATE(std::size_t{65'536}, std::size_t{50});  // Also where it leaves byte by byte.
  FakeHost host(board);
  host.hello();
  host.start(host.configure(fixed_recipe()));
  host.run_for(37'000 + 5'000);
  REQUIRE(board.optics.busy);
  const std::uint16_t stop = host.send(Stop{});
  host.run_for(3'000'000);
  REQUIRE(host.final_reply(stop));
  CHECK(FakeHost::is_pending(host.replies(stop)[0]));
  const RunReport report = host.final_reply(stop)->as<RunReport>();
  CHECK(report.reason == static_cast<std::uint8_t>(RunEnd::kStopped));
  CHECK(report.frames_sent == whole_frames(host));
  CHECK(report.ledger.lost_firmware == 0);
  check_ledger(report.ledger, report.frames_sent);
  CHECK(host.received.back().header.id() == MessageId::kRunReport);
  CHECK(host.all<RunFinished>().empty());
}

TEST_CASE("Abort at any poll of a run leaves an accounted ledger, a dark instrument and one that answers") {
  bool ended = false;
  std::size_t aborted = 0;
  for (int polls = 0; !ended; polls += 1) {
    FakeBoard board;
    board.link.capacity = 700;  // Frames leave in pieces, so aborts fall inside them too.
    FakeHost host(board);
    host.hello();
    Recipe recipe = fixed_recipe();
    recipe.repeats = 1;
    recipe.region_height = 12;
    host.start(host.configure(recipe));
    for (int i = 0; i < polls; ++i) {
      if (!host.poll()) {
        host.run(100'000, [&] { return true; });
        board.clock.time_us += 8'000;
      }
    }
    ended = host.instrument().run_state() == RunState::kIdle;
    const RunReport report = host.ask(Abort{}).as<RunReport>();
    aborted += report.reason == static_cast<std::uint8_t>(RunEnd::kAborted) ? 1 : 0;
    host.run_for(100'000);
    REQUIRE(report.ledger.exposed ==
            report.ledger.lost_sensor + report.ledger.lost_firmware + report.frames_sent);
    REQUIRE(whole_frames(host) == report.frames_sent);
    REQUIRE(host.received.back().header.id() == MessageId::kRunReport);  // No pixel comes after it.
    REQUIRE(board.optics.lit == Illuminator::kNone);
    REQUIRE(!board.optics.busy);
    REQUIRE(host.ask(GetStatus{}).as<DeviceStatus>().run_state == 0);
  }
  CHECK(aborted > 20);
}

TEST_CASE(
    "Wherever the link jams, the report of Stop and of Abort is the last word and names the frames that "
    "came") {
  const bool abort = GENERATE(false, true);
  for (std::size_t room = 0; room < 500; ++room) {  // Three frames of a small window.
    FakeBoard board;
    FakeHost host(board);
    host.hello();
    Recipe recipe = fixed_recipe();
    recipe.region_width = 8;
    recipe.region_height = 4;
    host.start(host.configure(recipe));
    // Stop waits for the frame in hand, so it must be known before that frame jams.
    std::uint16_t request = abort ? std::uint16_t{0} : host.send(Stop{});
    host.settle();
    host.reading = false;
    board.link.capacity = room;
    host.run_for(200'000);
    request = abort ? host.send(Abort{}) : request;
    host.run_for(100'000);
    board.link.capacity = 100'000;
    host.reading = true;
    REQUIRE(host.run(1'000'000, [&] { return host.final_reply(request).has_value(); }));
    host.run_for(100'000);
    REQUIRE(host.received.back().header.id() == MessageId::kRunReport);
    REQUIRE(whole_frames(host) == host.final_reply(request)->as<RunReport>().frames_sent);
  }
}

TEST_CASE("Control replies overtake stream data at frame boundaries") {
  FakeBoard board;
  board.link.capacity = 20'000;  // Stalls in the middle of the run.
  FakeHost host(board);
  host.max_payload = 1024;
  host.hello();
  host.start(host.configure(fixed_recipe()));
  host.reading = false;
  host.run_for(1'000'000);
  CHECK(board.link.to_host.size() == 20'000);
  const std::size_t before = host.received.size();
  const std::uint16_t status = host.send(GetStatus{});
  for (int i = 0; i < 10; ++i) {
    host.poll();
  }
  host.reading = true;
  host.run_for(10'000);
  // Only what the carrier had taken and the rest of the frame under way come first.
  std::size_t bytes_before = 0;
  for (std::size_t i = before; i < host.received.size() && host.received[i].header.correlation != status;
       ++i) {
    bytes_before += host.received[i].payload.size() + kFrameOverhead;
  }
  CHECK(bytes_before >= 18'000);
  CHECK(bytes_before <= 20'000 + 1'024 + kFrameOverhead);
  REQUIRE(host.run(10'000'000, [&] { return !host.all<RunFinished>().empty(); }));
  CHECK(whole_frames(host) == 10);
}

TEST_CASE("A control frame goes before a stream frame that was submitted earlier but not begun") {
  FakeLink link;
  link.capacity = 0;
  std::array<std::byte, kMaxFrameBytes> stream{};
  LinkOutput output(link, stream);
  const std::span<std::byte> slot = output.stream_slot();
  output.submit_stream(write_message(slot, output.stream_header(), FrameEnd{}));
  CHECK(!output.pump());
  REQUIRE(!output.send(Channel::kControl, StatusReply{}, 0, 1).empty());
  link.capacity = 1'000;
  CHECK(output.pump());
  CHECK(output.idle());
  const ParseResult first = parse_frame(link.to_host);
  REQUIRE(first.frame);
  CHECK(first.frame->id() == MessageId::kStatusReply);
  const ParseResult second = parse_frame(std::span<const std::byte>(link.to_host).subspan(first.consumed));
  REQUIRE(second.frame);
  CHECK(second.frame->id() == MessageId::kFrameEnd);
}

TEST_CASE("A link that takes nothing for a minute loses no frame of a recipe") {
  FakeBoard board;
  board.link.capacity = 3'000;
  FakeHost host(board);
  host.hello();
  host.start(host.configure(fixed_recipe()));
  host.reading = false;
  host.run_for(60'000'000);
  host.reading = true;
  REQUIRE(host.run(10'000'000, [&] { return !host.all<RunFinished>().empty(); }));
  CHECK(whole_frames(host) == 10);
  CHECK(host.all<RunFinished>()[0].ledger.exposed == 10);
}

TEST_CASE("A closed link ends the run; the next host finds the device idle") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  host.start(host.configure(fixed_recipe()));
  host.run_for(30'000);
  board.link.attached = false;
  host.run_for(1'000'000);
  CHECK(host.instrument().run_report().reason == static_cast<std::uint8_t>(RunEnd::kHostGone));
  CHECK(board.optics.lit == Illuminator::kNone);
  board.link.to_host.clear();
  board.link.attached = true;
  host.session = 0x4321;
  CHECK(host.hello().run_state == 0);
  CHECK(host.hello().epoch == 1);  // The configuration is still there.
}

TEST_CASE("A new HELLO ends the run of the host before") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  host.start(host.configure(fixed_recipe()));
  host.run_for(30'000);
  host.session = 0x4321;
  CHECK(host.hello().run_state == 0);
  CHECK(host.instrument().run_report().reason == static_cast<std::uint8_t>(RunEnd::kHostGone));
  const std::size_t frames = host.frames.size();
  host.run_for(1'000'000);
  CHECK(host.frames.size() == frames);
}

TEST_CASE("Every failed readout is a frame lost by the sensor; three in a row end the run") {
  FakeBoard board;
  FakeHost host(board);
  host.hello();
  board.optics.fail_reads = 1;
  const RunFinished one = host.measure(fixed_recipe());
  CHECK(one.reason == static_cast<std::uint8_t>(RunEnd::kCompleted));
  CHECK(one.ledger.lost_sensor == 1);
  CHECK(one.frames_sent == 9);
  check_ledger(one.ledger, one.frames_sent);
  CHECK(!host.all<FaultEvent>().empty());

  board.optics.broken = true;
  const RunFinished last = host.measure(fixed_recipe());
  CHECK(last.reason == static_cast<std::uint8_t>(RunEnd::kSensorFault));
  CHECK(last.ledger.exposed == 3);
  CHECK(last.ledger.lost_sensor == 3);
}

TEST_CASE("A dark monitor with the LED on flags the frame and raises a fault once per run") {
  FakeBoard board;
  board.optics.dead_led = 4;
  FakeHost host(board);
  host.hello();
  host.measure(fixed_recipe());
  for (const HostFrame& frame : host.frames) {
    CHECK(((frame.end->flags & kFrameMonitorLow) != 0) == (frame.begin.illumination == 4));
  }
  REQUIRE(host.all<FaultEvent>().size() == 1);
  CHECK(host.all<FaultEvent>()[0].fault == static_cast<std::uint16_t>(FaultCode::kMonitorLow));
  CHECK(host.ask(GetStatus{}).as<DeviceStatus>().last_fault ==
        static_cast<std::uint16_t>(FaultCode::kMonitorLow));
}

TEST_CASE("A temperature outside 5..50 deg C flags the frames") {
  FakeBoard board;
  board.optics.temperature_mK = 323'151;
  FakeHost host(board);
  host.hello();
  host.measure(fixed_recipe());
  for (const HostFrame& frame : host.frames) {
    CHECK((frame.end->flags & kFrameTemperatureOut) != 0);
  }
}
