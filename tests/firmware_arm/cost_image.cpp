// What the firmware's main loop costs, in instructions: the real core over a sensor whose frames lie ready in
// memory and a link that takes everything. The emulator counts (-icount shift=1: 2 ns of the 25 MHz counter's
// time for each instruction), so the figures are the same on every machine. Time of the Clock port is made up
// and costs nothing.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>

#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/startup.h"
#include "firmware/core/instrument.h"
#include "firmware/core/serial_link.h"
#include "protocol/message_traits.h"
#include "tests/firmware_arm/semihosting.h"

namespace scatter::firmware {
namespace {

using semihosting::check;

constexpr std::uint16_t kWidth = 640;
constexpr std::uint16_t kHeight = 480;
constexpr std::uint32_t kPixels = std::uint32_t{kWidth} * kHeight;
constexpr std::uint32_t kInstructionsPerTick = 20;  // 40 ns of the counter at 2 ns each.
constexpr std::uint16_t kSession = 0x51;

[[nodiscard]] std::uint32_t tick() noexcept {
  return mps2_an500::read_register(mps2_an500::kCounter);
}

struct TestClock final : Clock {
  std::uint64_t time_us = 1;
  std::uint64_t now_us() noexcept override { return time_us; }
};

/// Takes every byte; notes when the first chunk of a frame came.
struct SinkLink final : Link {
  std::array<std::byte, 1200> to_device{};
  std::size_t waiting = 0;
  std::uint32_t first_chunk = 0;
  std::uint32_t limit = protocol::kMaxSerialPayload;
  bool frame_ended = false;
  bool run_ended = false;
  std::size_t left = 0;  // Of the frame under way.

  std::size_t read(std::span<std::byte> out) noexcept override {
    const std::size_t count = std::min(out.size(), waiting);
    std::copy_n(to_device.begin(), count, out.begin());
    waiting -= count;
    return count;
  }
  std::size_t write(std::span<const std::byte> bytes) noexcept override {
    if (left == 0) {
      const auto message = protocol::load_le<std::uint16_t>(bytes.data() + 6);
      left = protocol::kFrameOverhead + protocol::load_le<std::uint32_t>(bytes.data() + 8);
      if (message == static_cast<std::uint16_t>(protocol::MessageId::kFrameData) && first_chunk == 0) {
        first_chunk = tick();
      }
      frame_ended = frame_ended || message == static_cast<std::uint16_t>(protocol::MessageId::kFrameEnd);
      run_ended = run_ended || message == static_cast<std::uint16_t>(protocol::MessageId::kRunFinished);
    }
    left -= std::min(left, bytes.size());
    return bytes.size();
  }
  bool connected() noexcept override { return true; }
  std::uint32_t max_payload() noexcept override { return limit; }

  template <protocol::Message M>
  void ask(const M& message, std::uint16_t correlation) noexcept {
    waiting = protocol::write_message(to_device, protocol::header_for<M>(kSession, correlation, correlation),
                                      message);
    check(waiting > 0, "a request fits");
  }
};

struct TestOptics final : Sensor, Illuminator, Monitor, Thermometer {
  explicit TestOptics(TestClock& its_clock) : clock(its_clock) {}
  TestClock& clock;
  bool busy = false;
  std::uint64_t due_us = 0;
  std::uint32_t ready = 0;  // Tick at which the core was first told.
  std::span<const std::uint16_t> frame;

  bool trigger(const SensorSettings& settings) noexcept override {
    due_us = clock.time_us + settings.exposure_us + 16'000;
    busy = true;
    ready = 0;
    return true;
  }
  SensorState state() noexcept override {
    if (!busy) {
      return SensorState::kIdle;
    }
    if (clock.time_us < due_us) {
      return SensorState::kExposing;
    }
    ready = ready == 0 ? tick() : ready;
    return SensorState::kReady;
  }
  std::uint64_t ready_at_us() noexcept override { return due_us; }
  bool read_rows(std::uint16_t first, std::uint16_t count, std::span<std::uint16_t> out) noexcept override {
    std::memcpy(out.data(), frame.data() + std::size_t{first} * kWidth, std::size_t{count} * kWidth * 2);
    return true;
  }
  void release() noexcept override { busy = false; }
  bool light(std::uint8_t) noexcept override { return true; }
  std::uint32_t reading_uv() noexcept override { return 500'000; }
  std::int32_t sensor_mK() noexcept override { return 298'150; }
  std::int32_t led_board_mK() noexcept override { return 298'150; }
};

struct TestKeeper final : Watchdog, Reset {
  void kick() noexcept override {}
  void reboot() noexcept override {}
  protocol::ResetReason reason() noexcept override { return protocol::ResetReason::kPowerOn; }
};

struct TestFlash final : Flash {
  std::array<std::byte, 32 * 1024> cells{};
  Geometry geometry() noexcept override { return {1024, 32, 64}; }
  bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
    std::copy_n(cells.begin() + offset, out.size(), out.begin());
    return true;
  }
  bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
    std::ranges::copy(bytes, cells.begin() + offset);
    return true;
  }
  bool erase(std::uint32_t unit) noexcept override {
    std::fill_n(cells.begin() + unit * 1024, 1024, std::byte{0xFF});
    return true;
  }
};

struct TestFactory final : Factory {
  protocol::Descriptor data;
  const protocol::Descriptor& descriptor() noexcept override { return data; }
  std::span<const std::byte> object(protocol::ObjectId) noexcept override { return {}; }
};

constinit TestClock test_clock{};
constinit SinkLink sink{};
constinit TestKeeper keeper{};
constinit TestFlash flash{};
constinit TestFactory factory{};
constinit std::array<std::uint16_t, kPixels> pixels{};
alignas(8) constinit std::array<std::byte, sizeof(InstrumentCore)> core_memory{};
constinit InstrumentArrays<protocol::kMaxSerialPayload> arrays{};

void describe() noexcept {
  protocol::Descriptor& d = factory.data;
  d.product = "cost";
  d.sensor.width_px = kWidth;
  d.sensor.height_px = kHeight;
  d.sensor.bits = 10;
  d.sensor.min_exposure_us = 10;
  d.sensor.max_exposure_us = 200'000;
  d.sensor.readout_us = 16'000;
  d.sensor.gain_e_per_dn = 10;
  d.sensor.full_well_e = 20'000;
  d.sensor.black_level_dn = 16;
  d.optics.center_x_px = 320;
  d.optics.center_y_px = 240;
  d.optics.radius_px = 230;
  d.optics.a1 = 0.6F;
  d.optics.theta_max_rad = 1.4F;
  d.illuminations.push_back({});
}

struct Costs {
  std::uint32_t first_chunk = 0;  // All in ticks.
  std::uint32_t whole_frame = 0;
  std::uint32_t worst_poll = 0;
  std::uint32_t idle_poll = 0;
};

class Bench {
 public:
  Bench() noexcept : core_(*new(core_memory.data()) InstrumentCore(ports_, arrays.memory())) {
    optics_.frame = pixels;
  }

  /// Turns the main loop until it has nothing to do; time then jumps to what it waits for.
  void turn() noexcept {
    const std::uint32_t begin = tick();
    const Step step = core_.poll();
    last_ = tick() - begin;
    worst_ = std::max(worst_, last_);
    reading_ += optics_.ready != 0 ? last_ : 0;
    if (!step.did_work) {
      test_clock.time_us = std::max(step.wake_at_us, test_clock.time_us + 1);
    }
  }
  template <protocol::Message M>
  void ask(const M& message) noexcept {
    sink.ask(message, ++correlation_);
    for (int i = 0; i < 20; ++i) {
      turn();
    }
  }

  /// One frame of the whole sensor; the run is the `number`th of the session.
  [[nodiscard]] Costs measure(protocol::PixelFormat format, std::uint32_t number) noexcept {
    protocol::SetConfiguration configuration;
    configuration.recipe.illuminations.push_back(0);
    configuration.recipe.exposures_us.push_back(1'000);
    configuration.recipe.pixel_format = format;
    ask(configuration);
    Costs costs;
    costs.idle_poll = last_;
    sink.first_chunk = 0;
    sink.frame_ended = sink.run_ended = false;
    worst_ = reading_ = 0;
    sink.ask(protocol::Start{.epoch = number, .may_send_until = 1}, ++correlation_);
    for (int i = 0; i < 100'000 && !sink.frame_ended; ++i) {
      turn();
    }
    check(sink.frame_ended, "the frame came");
    costs.first_chunk = sink.first_chunk - optics_.ready;
    costs.whole_frame = reading_;
    costs.worst_poll = worst_;
    optics_.ready = 0;
    for (int i = 0; i < 100 && !sink.run_ended; ++i) {
      turn();
    }
    check(sink.run_ended, "the run ended");
    return costs;
  }

 private:
  TestOptics optics_{test_clock};
  Ports ports_{.clock = test_clock,
               .link = sink,
               .sensor = optics_,
               .illuminator = optics_,
               .monitor = optics_,
               .thermometer = optics_,
               .watchdog = keeper,
               .reset = keeper,
               .flash = flash,
               .factory = factory};
  InstrumentCore& core_;
  std::uint16_t correlation_ = 0;
  std::uint32_t last_ = 0;
  std::uint32_t worst_ = 0;
  std::uint32_t reading_ = 0;
};

/// Ticks of one whole wire frame of 1 KiB through serial framing, both ways.
[[nodiscard]] std::uint32_t serial_cost() noexcept {
  static constinit std::array<std::byte, protocol::kFrameOverhead + protocol::kMaxSerialPayload> frame{};
  static constinit SerialLink link{sink};
  protocol::FrameHeader header;
  header.message = 0x0100;
  for (std::size_t i = 0; i < protocol::kMaxSerialPayload; ++i) {
    frame[protocol::kHeaderBytes + i] = static_cast<std::byte>(i);
  }
  check(protocol::finish_frame(frame, header, protocol::kMaxSerialPayload) == frame.size(),
        "a frame of 1 KiB");
  sink.left = 1U << 30U;  // What comes now is no frame of the core's.
  const std::uint32_t begin = tick();
  for (int i = 0; i < 8; ++i) {
    check(link.write(frame) == frame.size(), "the serial link takes a frame");
    link.pump();
  }
  return (tick() - begin) / 8;
}

void figure(const char* name, std::uint32_t value, const char* end) noexcept {
  semihosting::print(" \"");
  semihosting::print(name);
  semihosting::print("\": ");
  semihosting::print(value);
  semihosting::print(end);
}

}  // namespace
}  // namespace scatter::firmware

void run_image() noexcept {
  using namespace scatter::firmware;
  namespace protocol = scatter::protocol;
  describe();
  flash.cells.fill(std::byte{0xFF});
  for (std::uint32_t i = 0; i < kPixels; ++i) {
    pixels[i] = static_cast<std::uint16_t>(16 + i * 2654435761U % 900);
  }
  static Bench* bench = nullptr;
  alignas(Bench) static constinit std::array<std::byte, sizeof(Bench)> memory{};
  bench = new (memory.data()) Bench();
  bench->ask(protocol::Hello{.max_payload = protocol::kMaxSerialPayload});
  const Costs packed = bench->measure(protocol::PixelFormat::kMono10p, 1);
  const Costs plain = bench->measure(protocol::PixelFormat::kMono16, 2);
  const std::uint32_t serial = serial_cost();
  semihosting::print("{\n");
  figure("ready_to_first_chunk_mono10p", packed.first_chunk * kInstructionsPerTick, ",\n");
  figure("ready_to_first_chunk_mono16", plain.first_chunk * kInstructionsPerTick, ",\n");
  figure("per_100_pixels_mono10p", packed.whole_frame / (kPixels / 100) * kInstructionsPerTick, ",\n");
  figure("per_100_pixels_mono16", plain.whole_frame / (kPixels / 100) * kInstructionsPerTick, ",\n");
  figure("worst_poll_mono10p", packed.worst_poll * kInstructionsPerTick, ",\n");
  figure("worst_poll_mono16", plain.worst_poll * kInstructionsPerTick, ",\n");
  figure("idle_poll", packed.idle_poll * kInstructionsPerTick, ",\n");
  figure("serial_framing_of_1_KiB", serial * kInstructionsPerTick, "\n");
  semihosting::print("}\n");
  semihosting::exit(0);
}
