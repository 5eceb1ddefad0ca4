#include "simulator/instrument/virtual_instrument.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "firmware/boot/rescue.h"
#include "firmware/core/instrument.h"
#include "simulator/instrument/past_calibration.h"
#include "simulator/instrument/virtual_board.h"
#include "simulator/samples/sample.h"

namespace scatter::simulator {
namespace {

/// Polls at one moment of virtual time before time moves on by itself: more than any burst of work
/// needs, so that a firmware that is never done cannot hang the host.
constexpr int kMostPollsAtOnce = 100'000;

}  // namespace

Result<std::unique_ptr<VirtualInstrument>> VirtualInstrument::make(const InstrumentOptions& options) {
  Result<std::unique_ptr<VirtualBoard>> board = VirtualBoard::make(options);
  if (!board) {
    return std::unexpected(std::move(board.error()));
  }
  std::unique_ptr<VirtualInstrument> instrument(new VirtualInstrument(std::move(*board)));
  if (options.calibration == CalibrationHeld::kStale) {
    if (Status done = hold_past_calibration(*instrument); !done) {
      return std::unexpected(std::move(done.error()));
    }
    instrument->ages_calibrations_ = true;
  }
  return instrument;
}

VirtualInstrument::VirtualInstrument(std::unique_ptr<VirtualBoard> board) : board_(std::move(board)) {
  start_firmware();
}

VirtualInstrument::~VirtualInstrument() = default;

void VirtualInstrument::attach() {
  if (attached()) {
    detach();
  }
  board_->link().attach();
}

void VirtualInstrument::detach() {
  board_->link().detach();
  // The firmware must see the gap even when the next host comes at once.
  run_ready();
}

bool VirtualInstrument::attached() const noexcept {
  return board_->link().attached();
}

std::size_t VirtualInstrument::host_write(std::span<const std::byte> bytes) {
  return board_->link().host_write(bytes);
}
std::size_t VirtualInstrument::host_read(std::span<std::byte> out) {
  const std::size_t count = board_->link().host_read(out);
  age_calibration();
  return count;
}

// calibration=stale: whenever a calibration session has ended and the host has read the answer, the
// instrument stands unused until what was just calibrated is past its life.
void VirtualInstrument::age_calibration() {
  if (!ages_calibrations_ || board_->camera().moving()) {
    return;
  }
  if (board_->camera().target() != protocol::Target::kSample) {
    references_used_ = true;
  } else if (references_used_ && board_->link().readable() == 0) {
    references_used_ = false;
    board_->clock().skip(past_life_us(board_->descriptor()));
  }
}
std::size_t VirtualInstrument::readable() {
  return board_->link().readable();
}
std::size_t VirtualInstrument::writable() {
  return board_->link().writable();
}

std::shared_ptr<const Sample> VirtualInstrument::sample() const noexcept {
  return board_->bench().sample();
}

Status VirtualInstrument::put(std::shared_ptr<const Sample> sample) {
  if (sample->transmits() != this->sample()->transmits()) {
    return fail(
        ErrorCode::kFailedPrecondition,
        "simulated instrument: a sample that reflects cannot follow one that transmits, nor the other "
        "way round",
        "open another instrument for it");
  }
  board_->bench().put(std::move(sample));
  board_->camera().sample_placed();
  return {};
}

std::uint64_t VirtualInstrument::now_us() const noexcept {
  return board_->clock().since_power_on_us();
}
ClockMode VirtualInstrument::clock_mode() const noexcept {
  return board_->clock().mode();
}

void VirtualInstrument::restart_if_wanted() {
  if (const auto reason = board_->restart_wanted()) {
    board_->restart(*reason);
    start_firmware();
  }
}

void VirtualInstrument::start_firmware() {
  core_.reset();
  rescue_.reset();
  ports_ = std::make_unique<firmware::Ports>(board_->ports());
  if (board_->slots().decision().action == firmware::BootDecision::Action::kRun) {
    core_ = std::make_unique<firmware::Instrument>(*ports_);
  } else {
    rescue_ = std::make_unique<firmware::Rescue>(board_->rescue_ports());
  }
}

std::uint64_t VirtualInstrument::run_ready() {
  for (int polls = 0; polls < kMostPollsAtOnce; ++polls) {
    board_->link().tick();
    const firmware::Step step = core_ ? core_->poll() : rescue_->poll();
    const bool was_attached = attached();
    restart_if_wanted();
    if (step.did_work && was_attached == attached()) {
      continue;
    }
    const std::uint64_t now = now_us();
    std::uint64_t wake = now + firmware::kLongestSleepUs;
    if (step.wake_at_us != 0) {
      wake = std::min(wake, step.wake_at_us + board_->clock().booted_us());
    }
    if (const auto event = board_->link().next_event_us()) {
      wake = std::min(wake, *event);
    }
    // A wake in the past means "now": time must move for it to be over.
    return std::max(wake, now + 1);
  }
  return now_us() + 1;
}

void VirtualInstrument::run_until(std::uint64_t time_us, Until until, std::uint64_t slice_us) {
  const bool began_attached = attached();
  const std::uint64_t slice_end = now_us() + slice_us;
  while (true) {
    const std::uint64_t wake = run_ready();
    const bool ready = until == Until::kReadable ? readable() > 0 : writable() > 0;
    const std::uint64_t now = now_us();
    if (ready || now >= time_us || (began_attached && !attached())) {
      return;
    }
    if (clock_mode() == ClockMode::kVirtual) {
      advance_to(std::min(wake, time_us));
      continue;
    }
    const std::uint64_t to = std::min({wake, time_us, slice_end});
    if (now >= slice_end) {
      return;
    }
    if (to > now) {
      std::this_thread::sleep_for(std::chrono::microseconds(to - now));
    }
  }
}

void VirtualInstrument::advance_to(std::uint64_t time_us) noexcept {
  board_->clock().advance_to(time_us);
}

}  // namespace scatter::simulator
