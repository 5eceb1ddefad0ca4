#include "tests/usb/mock_bus/plugged_instrument.h"

#include <utility>

#include "simulator/instrument/virtual_instrument.h"

namespace scatter::mock_bus {

namespace {

class PluggedInstrument final : public Peripheral {
 public:
  explicit PluggedInstrument(std::unique_ptr<simulator::VirtualInstrument> instrument)
      : instrument_(std::move(instrument)) {}
  [[nodiscard]] simulator::UsbPort& port() override { return *instrument_->usb(); }
  std::uint64_t run_ready() override { return instrument_->run_ready(); }
  [[nodiscard]] std::uint64_t now_us() const override { return instrument_->now_us(); }
  void advance_to(std::uint64_t time_us) override { instrument_->advance_to(time_us); }
  [[nodiscard]] simulator::ClockMode clock_mode() const override { return instrument_->clock_mode(); }
  void press_button() override { instrument_->press_button(); }

 private:
  std::unique_ptr<simulator::VirtualInstrument> instrument_;
};

}  // namespace

Result<std::unique_ptr<Peripheral>> plugged_instrument(std::string_view query) {
  simulator::InstrumentOptions defaults;
  defaults.carrier = simulator::Carrier::kUsb;
  Result<simulator::InstrumentOptions> options = simulator::parse_instrument_options(query, defaults);
  if (!options) {
    return std::unexpected(std::move(options.error()));
  }
  Result<std::unique_ptr<simulator::VirtualInstrument>> instrument =
      simulator::VirtualInstrument::make(*options);
  if (!instrument) {
    return std::unexpected(std::move(instrument.error()));
  }
  return std::make_unique<PluggedInstrument>(std::move(*instrument));
}

}  // namespace scatter::mock_bus
