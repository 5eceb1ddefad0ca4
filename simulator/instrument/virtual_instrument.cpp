#include "simulator/instrument/virtual_instrument.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "firmware/boot/rescue.h"
#include "firmware/core/instrument.h"
#include "protocol/usb_identity.h"
#include "simulator/instrument/past_calibration.h"
#include "simulator/instrument/usb_firmware.h"
#include "simulator/instrument/virtual_board.h"
#include "simulator/samples/sample.h"

namespace scatter::simulator {
namespace {

/// Polls at one moment of virtual time before time moves on by itself: more than any burst of work
/// needs, so that a firmware that is never done cannot hang the host.
constexpr int kMostPollsAtOnce = 100'000;

/// How long a restart keeps the device off the bus [us]: a hub takes 100 ms to believe a change.
constexpr std::uint64_t kUsbBootUs = 250'000;

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
    instrument->age_calibrations();
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
  age_calibration(board_->link().readable() == 0);
  return count;
}

void VirtualInstrument::age_calibrations() {
  ages_calibrations_ = true;
  if (VirtualUsbController* const socket = board_->usb()) {
    socket->on_completion_taken(
        [this, socket] { age_calibration(socket->waiting(protocol::usb::kBulkIn) == 0); });
  }
}

// calibration=stale: whenever a calibration session has ended and the host has read the answer, the
// instrument stands unused until what was just calibrated is past its life.
void VirtualInstrument::age_calibration(bool host_has_all) {
  if (!ages_calibrations_ || board_->camera().moving()) {
    return;
  }
  if (board_->camera().target() != protocol::Target::kSample) {
    references_used_ = true;
  } else if (references_used_ && host_has_all) {
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

UsbPort* VirtualInstrument::usb() noexcept {
  return board_->usb();
}
void VirtualInstrument::press_button() noexcept {
  board_->press_button();
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
    if (usb_) {
      asleep_until_us_ = now_us() + kUsbBootUs;
    }
  }
}

void VirtualInstrument::start_firmware() {
  core_.reset();
  rescue_.reset();
  usb_ = board_->usb() != nullptr ? std::make_unique<UsbFirmware>(*board_) : nullptr;
  ports_ = std::make_unique<firmware::Ports>(usb_ ? board_->ports(usb_->link()) : board_->ports());
  if (board_->slots().decision().action == firmware::BootDecision::Action::kRun) {
    core_ = std::make_unique<firmware::Instrument>(*ports_);
    if (usb_) {
      usb_->begin(*core_, *ports_);
    }
  } else if (usb_) {
    usb_->begin_rescue();
  } else {
    rescue_ = std::make_unique<firmware::Rescue>(board_->rescue_ports());
  }
}

firmware::Step VirtualInstrument::poll_firmware() {
  if (!usb_) {
    board_->link().tick();
    return core_ ? core_->poll() : rescue_->poll();
  }
  board_->usb()->tick();
  const firmware::Step bus = usb_->poll();
  if (!core_) {
    return bus;
  }
  const firmware::Step core = core_->poll();
  return {.did_work = bus.did_work || core.did_work,
          .wake_at_us = bus.wake_at_us == 0 || core.wake_at_us == 0
                            ? std::max(bus.wake_at_us, core.wake_at_us)
                            : std::min(bus.wake_at_us, core.wake_at_us)};
}

std::uint64_t VirtualInstrument::attachment() const noexcept {
  const VirtualUsbController* const socket = board_->usb();
  return socket != nullptr ? std::uint64_t{socket->joins()} << 1U | (socket->present() ? 1U : 0U)
                           : (attached() ? 1U : 0U);
}

std::uint64_t VirtualInstrument::run_ready() {
  if (now_us() < asleep_until_us_) {
    return asleep_until_us_;
  }
  for (int polls = 0; polls < kMostPollsAtOnce; ++polls) {
    const firmware::Step step = poll_firmware();
    const std::uint64_t before = attachment();
    restart_if_wanted();
    if (step.did_work && before == attachment()) {
      continue;
    }
    if (now_us() < asleep_until_us_) {
      return asleep_until_us_;
    }
    const std::uint64_t now = now_us();
    std::uint64_t wake = now + firmware::kLongestSleepUs;
    if (step.wake_at_us != 0) {
      wake = std::min(wake, step.wake_at_us + board_->clock().booted_us());
    }
    if (const auto event =
            board_->usb() != nullptr ? board_->usb()->next_event_us() : board_->link().next_event_us()) {
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
