// The bench behind the backplane, driven by a board made here of messages: no QEMU.
#include <algorithm>
#include <catch2/catch.hpp>
#include <optional>
#include <random>
#include <vector>

#include "firmware/backplane/shared_memory.h"
#include "protocol/crc.h"
#include "simulator/emulator/backplane_bench.h"

using namespace scatter;
using namespace scatter::simulator;
namespace backplane = firmware::backplane;
using std::chrono::microseconds;

namespace {

constexpr std::uint16_t kSide = 120;
constexpr std::uint32_t kExposure_us = 2000;
constexpr std::uint8_t kLed = 4;

InstrumentOptions options() {
  auto parsed = parse_instrument_options("profile=binned&seed=7&sample=ggx:alpha=0.2,f0=0.04,albedo=0.3");
  REQUIRE(parsed.has_value());
  return *parsed;
}

std::unique_ptr<VirtualBoard> virtual_board(const InstrumentOptions& of = options()) {
  auto board = VirtualBoard::make(of);
  REQUIRE(board.has_value());
  return std::move(*board);
}

struct Answer {
  std::uint8_t kind = 0;
  std::vector<std::byte> payload;
  template <typename M>
  [[nodiscard]] std::optional<M> as() const {
    return kind == static_cast<std::uint8_t>(M::kKind) ? protocol::decode<M>(payload) : std::nullopt;
  }
};

/// A board made of messages.
class FakeBoard {
 public:
  explicit FakeBoard(BenchPace pace = BenchPace::kHaste)
      : virtual_board_(virtual_board()),
        memory_(backplane::kFrameBytes, std::byte{0xEE}),
        bench_(*virtual_board_, pace,
               {.frame = memory_,
                .show_temperatures = [this](std::int32_t sensor, std::int32_t led_board) -> Status {
                  shown_at_answers_ = answers_.size();
                  sensor_mK_ = sensor;
                  led_board_mK_ = led_board;
                  return {};
                },
                .booted = [this](const backplane::Booted&) { ++boots_; }}) {}

  template <typename M>
  void send(const M& message) {
    std::vector<std::byte> line;
    put_message(line, message);
    send_bytes(line);
  }
  void send_bytes(std::span<const std::byte> line) {
    REQUIRE(bench_.receive(line, now_).has_value());
    take();
  }
  void boot() { send(backplane::Booted{}); }
  void pass(microseconds time) {
    now_ += time;
    REQUIRE(bench_.run(now_).has_value());
    take();
  }
  [[nodiscard]] bool untouched() const {
    return std::ranges::all_of(memory_, [](std::byte b) { return b == std::byte{0xEE}; });
  }
  [[nodiscard]] std::span<const std::byte> frame() const {
    return std::span(memory_).first(std::size_t{2} * kSide * kSide);
  }
  /// Answers since the last call.
  std::vector<Answer> answers() { return std::exchange(answers_, {}); }

  std::unique_ptr<VirtualBoard> virtual_board_;
  std::vector<std::byte> memory_;
  std::vector<Answer> answers_;
  std::size_t shown_at_answers_ = 0;
  std::int32_t sensor_mK_ = 0;
  std::int32_t led_board_mK_ = 0;
  int boots_ = 0;
  BackplaneBench::Clock::time_point now_{};
  BackplaneBench bench_;

 private:
  void take() {
    decoder_.push(std::exchange(bench_.to_board(), {}), [this](const BackplaneDecoder::Message& message) {
      REQUIRE(message.intact);
      answers_.push_back({message.kind, {message.payload.begin(), message.payload.end()}});
    });
  }
  BackplaneDecoder decoder_;
};

backplane::Trigger whole_frame(std::uint32_t number) {
  return {.number = number, .x = 0, .y = 0, .width = kSide, .height = kSide, .exposure_us = kExposure_us};
}

/// What the firmware's own port on the virtual board sees of the same commands.
struct Seen {
  std::vector<std::uint16_t> pixels;
  std::uint32_t monitor_uv = 0;
};
Seen seen_by_the_virtual_board(VirtualBoard& board, std::uint8_t led) {
  Camera& camera = board.camera();
  Seen seen;
  seen.pixels.resize(std::size_t{kSide} * kSide);
  REQUIRE(camera.light(led));
  REQUIRE(camera.trigger({.x = 0, .y = 0, .width = kSide, .height = kSide, .exposure_us = kExposure_us}));
  board.clock().advance_to(camera.ready_at_us() + board.clock().booted_us());
  seen.monitor_uv = camera.reading_uv();
  REQUIRE(camera.read_rows(0, kSide, seen.pixels));
  camera.release();
  return seen;
}

}  // namespace

TEST_CASE("A frame that was not commanded is refused, named and not drawn") {
  FakeBoard board;
  // Before the board has said that it runs.
  board.send(whole_frame(1));
  auto answers = board.answers();
  REQUIRE(answers.size() == 1);
  REQUIRE(answers[0].as<backplane::Fault>().has_value());
  CHECK(answers[0].as<backplane::Fault>()->command == static_cast<std::uint8_t>(backplane::Kind::kTrigger));
  CHECK(answers[0].as<backplane::Fault>()->number == 1);
  board.boot();
  // An LED alone draws nothing, however long it is on.
  board.send(backplane::Light{.illumination = kLed});
  board.pass(std::chrono::seconds(10));
  CHECK(board.answers().empty());
  // Windows and exposures that the sensor does not have, and an LED that is not there.
  auto outside = whole_frame(1);
  outside.x = 1;
  auto too_long = whole_frame(1);
  too_long.exposure_us = 200'001;
  auto nothing = whole_frame(1);
  nothing.width = 0;
  board.send(outside);
  board.send(too_long);
  board.send(nothing);
  board.send(backplane::Light{.illumination = 12});
  board.send(backplane::Move{.target = 9});
  answers = board.answers();
  CHECK(answers.size() == 5);
  CHECK(std::ranges::all_of(answers, [](const Answer& a) { return a.as<backplane::Fault>().has_value(); }));
  CHECK(board.untouched());
  CHECK(board.bench_.statistics().refused == 6);
  CHECK(board.bench_.statistics().frames == 0);
}

TEST_CASE("A repeated or skipped trigger and a frame not given back are refused") {
  FakeBoard board;
  board.boot();
  board.send(whole_frame(1));
  REQUIRE(board.answers().size() == 1);
  const std::vector<std::byte> first(board.frame().begin(), board.frame().end());
  board.send(whole_frame(2));  // The first was not released.
  board.send(backplane::Release{});
  board.send(whole_frame(1));
  board.send(whole_frame(3));
  const auto answers = board.answers();
  REQUIRE(answers.size() == 3);
  CHECK(answers[0].as<backplane::Fault>()->number == 2);
  CHECK(answers[1].as<backplane::Fault>()->number == 1);
  CHECK(answers[2].as<backplane::Fault>()->number == 3);
  CHECK(std::ranges::equal(first, board.frame()));
  board.send(whole_frame(2));
  CHECK(board.answers().front().as<backplane::Ready>().has_value());
  CHECK(board.bench_.statistics().frames == 2);
}

TEST_CASE("A damaged message is refused and the next one is understood") {
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    FakeBoard board;
    board.boot();
    std::vector<std::byte> line;
    put_message(line, whole_frame(1));
    line[2 + random() % (line.size() - 2)] ^= static_cast<std::byte>(1U << random() % 8);
    board.send_bytes(line);
    auto answers = board.answers();
    REQUIRE(answers.size() == 1);
    CHECK(answers[0].as<backplane::Fault>().has_value());
    CHECK(board.untouched());
    board.send(whole_frame(1));
    CHECK(board.answers().at(0).as<backplane::Ready>().has_value());
    if (round == 20) {
      break;
    }
  }
}

TEST_CASE("A board of another version is refused until the right one boots") {
  FakeBoard board;
  board.send(backplane::Booted{.version = 2});
  board.send(whole_frame(1));
  CHECK(board.answers().size() == 2);
  CHECK(board.untouched());
  board.boot();
  board.send(whole_frame(1));
  CHECK(board.answers().at(0).as<backplane::Ready>().has_value());
}

TEST_CASE("The bench gives the pixels, the monitor and the temperatures that the virtual board gives") {
  FakeBoard board;
  const auto other = virtual_board();
  board.boot();
  std::uint32_t number = 0;
  for (const std::uint8_t led : {kLed, std::uint8_t{11}, firmware::Illuminator::kNone}) {
    board.send(backplane::Light{.illumination = led});
    board.send(whole_frame(++number));
    const auto ready = board.answers().at(0).as<backplane::Ready>();
    const Seen seen = seen_by_the_virtual_board(*other, led);
    REQUIRE(ready.has_value());
    CHECK(ready->number == number);
    CHECK(ready->monitor_uv == seen.monitor_uv);
    CHECK(std::ranges::equal(board.frame(), std::as_bytes(std::span(seen.pixels))));
    CHECK(ready->pixel_crc == protocol::crc32c(board.frame(), 0));
    const auto temperatures = other->bench().temperatures(other->camera().scheduled_us());
    CHECK(board.sensor_mK_ == temperatures.sensor_mK);
    CHECK(board.led_board_mK_ == temperatures.led_board_mK);
    board.send(backplane::Light{.illumination = firmware::Illuminator::kNone});
    board.send(backplane::Release{});
    REQUIRE(other->camera().light(firmware::Illuminator::kNone));
  }
  CHECK(number == 3);
}

TEST_CASE("The thermometers show the moment before the frame is announced") {
  FakeBoard board;
  board.boot();
  board.send(whole_frame(1));
  CHECK(board.shown_at_answers_ == 0);
  CHECK(board.answers().size() == 1);
  CHECK(board.sensor_mK_ > 0);
}

TEST_CASE("At a real pace a frame comes after exposure and readout, and a release before that cancels it") {
  FakeBoard board(BenchPace::kReal);
  board.boot();
  const std::uint32_t readout_us = board.virtual_board_->descriptor().sensor.readout_us;
  board.send(whole_frame(1));
  board.pass(microseconds(kExposure_us + readout_us - 1));
  CHECK(board.answers().empty());
  CHECK(board.untouched());
  board.pass(microseconds(1));
  CHECK(board.answers().size() == 1);
  board.send(backplane::Release{});
  std::ranges::fill(board.memory_, std::byte{0xEE});
  board.send(whole_frame(2));
  board.pass(microseconds(10));
  board.send(backplane::Release{});
  board.pass(std::chrono::seconds(1));
  CHECK(board.answers().empty());
  CHECK(board.untouched());
  board.send(backplane::Move{.target = 2});
  board.pass(microseconds(Camera::kStageUs - 1));
  CHECK(board.answers().empty());
  board.pass(microseconds(1));
  CHECK(board.answers().at(0).as<backplane::Settled>()->target == 2);
}

TEST_CASE("A bench told to keep silent answers no trigger but everything else") {
  FakeBoard board;
  board.boot();
  board.bench_.conduct({.silent = true});
  board.send(whole_frame(1));
  board.send(backplane::Release{});
  board.pass(std::chrono::seconds(10));
  CHECK(board.answers().empty());
  board.send(backplane::Move{.target = 2});
  CHECK(board.answers().size() == 1);
}
