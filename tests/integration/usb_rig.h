// The instrument behind its USB socket, and the SDK on it, without a kernel between them.
#pragma once

#include <catch2/catch.hpp>
#include <memory>
#include <string_view>
#include <utility>

#include "host_sdk/device/device.h"
#include "simulator/instrument/virtual_instrument.h"
#include "tests/usb/port_transport.h"

namespace scatter::integration {

inline std::shared_ptr<simulator::VirtualInstrument> usb_instrument_of(std::string_view query) {
  auto options = simulator::parse_instrument_options(query);
  REQUIRE(options.has_value());
  options->carrier = simulator::Carrier::kUsb;
  auto instrument = simulator::VirtualInstrument::make(*options);
  REQUIRE(instrument.has_value());
  return std::move(*instrument);
}

inline Result<device::Device> open_usb(const std::shared_ptr<simulator::VirtualInstrument>& instrument,
                                       const device::OpenOptions& options = {}) {
  auto transport = usb_test::make_port_transport(instrument);
  if (!transport) {
    return fail(ErrorCode::kDisconnected, "usb: the simulated instrument could not be opened", "plug it in");
  }
  return device::Device::open(std::move(transport), options);
}

}  // namespace scatter::integration
