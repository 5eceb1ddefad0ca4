#include "simulator/instrument/virtual_board.h"

#include <utility>

#include <fmt/format.h>

#include "simulator/samples/sample.h"

namespace scatter::simulator {

Result<std::unique_ptr<VirtualBoard>> VirtualBoard::make(const InstrumentOptions& options) {
  Result<std::shared_ptr<const Sample>> sample = Sample::make(options.sample);
  if (!sample) {
    return std::unexpected(std::move(sample.error()));
  }
  Result<std::unique_ptr<Bench>> bench =
      Bench::make({.seed = options.seed,
                   .profile = options.profile,
                   .references = options.references,
                   .transmission_module = options.transmission_module,
                   .reference_stage = options.calibration != CalibrationHeld::kNone,
                   .sample = *sample,
                   .faults = options.bench_faults});
  if (!bench) {
    return std::unexpected(std::move(bench.error()));
  }
  const std::size_t leds = (*bench)->descriptor().illuminations.size();
  for (const std::uint8_t led : options.faults.dead_leds) {
    if (led >= leds) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("fault led:{}: this instrument has {} illuminations", led, leds),
                  fmt::format("use led:0 to led:{}", leds - 1));
    }
  }
  auto flash = std::make_unique<FlashImage>();
  if (!options.flash_file.empty()) {
    Result<std::unique_ptr<FlashImage>> opened = FlashImage::open(options.flash_file);
    if (!opened) {
      return std::unexpected(std::move(opened.error()));
    }
    flash = std::move(*opened);
  }
  return std::unique_ptr<VirtualBoard>(new VirtualBoard(options, std::move(*bench), std::move(flash)));
}

VirtualBoard::VirtualBoard(const InstrumentOptions& options, std::unique_ptr<Bench> bench,
                           std::unique_ptr<FlashImage> flash)
    : plan_(options.faults),
      bench_(std::move(bench)),
      flash_(std::move(flash)),
      clock_(options.clock),
      link_(clock_, plan_, options.seed),
      power_on_clock_(clock_),
      camera_(clock_, *bench_, plan_, options.seed),
      watchdog_(clock_),
      factory_(*bench_),
      slots_(*flash_, factory_.data.product.str()) {
  factory_.data.serial = std::string_view(fmt::format("SIM-{:08x}", options.seed & 0xFFFF'FFFFU));
  if (options.calibration == CalibrationHeld::kNone) {
    factory_.data.reference_stage = 0;
    factory_.data.certificates.clear();
  } else {
    factory_.data.reference_stage = 1;
  }
  if (options.carrier == Carrier::kUsb) {
    usb_.emplace(power_on_clock_, plan_, options.seed);
  }
}

firmware::Ports VirtualBoard::ports(firmware::Link& link) noexcept {
  return {.clock = clock_,
          .link = link,
          .sensor = camera_,
          .illuminator = camera_,
          .monitor = camera_,
          .thermometer = camera_,
          .watchdog = watchdog_,
          .reset = reset_,
          .flash = *flash_,
          .factory = factory_,
          .reference_stage = factory_.data.reference_stage != 0 ? &camera_ : nullptr,
          .image_slots = &slots_,
          .verifier = &slots_.verifier(),
          .button = &button_,
          .build_id = slots_.build_id()};
}

firmware::RescuePorts VirtualBoard::rescue_ports() noexcept {
  return {.clock = clock_,
          .link = link_,
          .watchdog = watchdog_,
          .reset = reset_,
          .slots = slots_,
          .verifier = slots_.verifier(),
          .product = factory_.data.product.str(),
          .serial = factory_.data.serial.str(),
          .build_id = slots_.build_id()};
}

std::optional<protocol::ResetReason> VirtualBoard::restart_wanted() noexcept {
  if (reset_.wanted) {
    return protocol::ResetReason::kRequested;
  }
  if (clock_.since_power_on_us() - watchdog_.kicked_us > kWatchdogUs) {
    return protocol::ResetReason::kWatchdog;
  }
  for (std::uint64_t& frame : plan_.reset_at_frame) {
    if (frame != 0 && camera_.exposures() >= frame) {
      frame = 0;  // Once.
      return protocol::ResetReason::kFault;
    }
  }
  return std::nullopt;
}

void VirtualBoard::restart(protocol::ResetReason reason) noexcept {
  link_.device_gone();
  if (usb_) {
    usb_->connect(false);
  }
  camera_.reset();
  clock_.boot();
  watchdog_.kick();
  reset_.wanted = false;
  button_.count = 0;
  reset_.why = reason;
  slots_.boot(reason);
}

}  // namespace scatter::simulator
