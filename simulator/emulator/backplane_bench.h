// The optical bench as a board without a camera sees it: answers firmware/backplane messages.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "firmware/backplane/messages.h"
#include "host_sdk/error/error.h"
#include "simulator/emulator/backplane_line.h"
#include "simulator/instrument/virtual_board.h"

namespace scatter::simulator {

/// When a frame is ready and the stage stands.
enum class BenchPace : std::uint8_t {
  kReal,  ///< After the exposure and readout, or the movement, on the computer's clock.
  kHaste  ///< As soon as it is computed. The light, and so the pixels, are the same.
};

/// What is wrong with the bench on purpose.
struct BenchConduct {
  bool silent = false;                    ///< Triggers are not answered: a sensor that has died.
  std::int32_t temperature_shift_mK = 0;  ///< What the thermometers show more than there is.
};

/// Drives the virtual board's camera exactly as the virtual board's firmware port would: LED, trigger, wait
/// for the readout, monitor, thermometers, rows, release. So the same commands give the same pixels.
///
/// It draws a frame for a Trigger only, with the LED that the last Light named; anything out of order (before
/// Booted, a repeated number, a frame not released, a window or exposure that the sensor does not have, a
/// damaged message) is answered by Fault, counted, and changes nothing.
///
/// Threads   one at a time.
class BackplaneBench {
 public:
  using Clock = std::chrono::steady_clock;
  struct Ties {
    std::span<std::byte> frame;  ///< Where frames go: shared_memory.h's kFrameBytes.
    /// Shows temperatures on the board's thermometers [mK]; done when it returns.
    std::function<Status(std::int32_t sensor_mK, std::int32_t led_board_mK)> show_temperatures;
    /// The board says that it starts.
    std::function<void(const firmware::backplane::Booted&)> booted;
  };
  struct Statistics {
    std::uint64_t boots = 0;
    std::uint64_t frames = 0;   ///< Announced by Ready.
    std::uint64_t refused = 0;  ///< Answered by Fault.
  };

  /// `board` outlives the bench; its clock is a virtual one.
  BackplaneBench(VirtualBoard& board, BenchPace pace, Ties ties);

  /// The light of each source head is integrated at its first use, too late for a firmware that waits for its
  /// frame; this does it now. Cost: about 0.1 s per head of HS-1.
  void warm_up();

  /// Takes bytes from the board. Errors: of show_temperatures.
  [[nodiscard]] Status receive(std::span<const std::byte> bytes, Clock::time_point now);
  /// Does what has become due. Errors: of show_temperatures.
  [[nodiscard]] Status run(Clock::time_point now);
  /// When run() has something to do.
  [[nodiscard]] std::optional<Clock::time_point> due() const noexcept;
  /// Bytes for the board; the caller takes them.
  [[nodiscard]] std::vector<std::byte>& to_board() noexcept { return to_board_; }

  /// Puts another sample under the instrument, its light already integrated.
  void put(std::shared_ptr<const Sample> sample);
  void conduct(const BenchConduct& conduct) noexcept { conduct_ = conduct; }
  /// Shows the thermometers what there is now. Errors: of show_temperatures.
  [[nodiscard]] Status show_temperatures();
  [[nodiscard]] const Statistics& statistics() const noexcept { return statistics_; }

 private:
  struct PendingFrame {
    firmware::backplane::Ready ready;
    Clock::time_point due;
    bool announced = false;
  };
  struct PendingMove {
    firmware::backplane::Settled settled;
    Clock::time_point due;
  };

  void handle(const BackplaneDecoder::Message& message, Clock::time_point now);
  void boot(const firmware::backplane::Booted& booted);
  [[nodiscard]] bool trigger(const firmware::backplane::Trigger& trigger, Clock::time_point now);
  [[nodiscard]] bool move(const firmware::backplane::Move& move, Clock::time_point now);
  void refuse(std::uint8_t command, std::uint32_t number = 0);
  [[nodiscard]] Clock::time_point after(Clock::time_point now, std::uint64_t us) const noexcept;

  VirtualBoard& board_;
  BenchPace pace_;
  Ties ties_;
  BenchConduct conduct_;
  BackplaneDecoder decoder_;
  std::vector<std::byte> to_board_;
  std::vector<std::uint16_t> pixels_;
  bool running_ = false;  ///< The board has booted and speaks our version.
  std::optional<std::uint32_t> last_number_;
  std::optional<PendingFrame> frame_;
  std::optional<PendingMove> move_;
  Statistics statistics_;
};

}  // namespace scatter::simulator
