#include "simulator/instrument/usb_firmware.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <system_error>

#include "protocol/usb_identity.h"
#include "simulator/instrument/virtual_board.h"

namespace scatter::simulator {
namespace {

constexpr std::string_view kManufacturer = "OpenScatter";

}  // namespace

std::uint16_t release_bcd(std::string_view version) noexcept {
  // Two digits, one, one.
  std::array<unsigned, 3> parts{};
  const char* at = version.data();
  const char* const end = at + version.size();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto [next, problem] = std::from_chars(at, end, parts[i]);
    const bool last = i + 1 == parts.size();
    if (problem != std::errc{} || (!last && (next == end || *next != '.'))) {
      return 0;
    }
    at = last ? next : next + 1;
  }
  const unsigned major = std::min(parts[0], 99U);
  return static_cast<std::uint16_t>(major / 10 << 12U | major % 10 << 8U | std::min(parts[1], 9U) << 4U |
                                    std::min(parts[2], 9U));
}

UsbFirmware::UsbFirmware(VirtualBoard& board)
    : board_(board),
      product_(board.descriptor().product.str()),
      serial_(board.descriptor().serial.str()),
      link_(*board.usb()) {}

void UsbFirmware::begin(firmware::InstrumentCore& core, firmware::Ports& ports) {
  rescue_.emplace(core, ports);
  make_device(*core.update_receiver(), ports.clock, ports.reset, &*rescue_);
}

void UsbFirmware::begin_rescue() {
  const firmware::RescuePorts ports = board_.rescue_ports();
  own_receiver_.emplace(ports.slots, ports.verifier, product_);
  make_device(*own_receiver_, ports.clock, ports.reset, nullptr);
}

void UsbFirmware::make_device(firmware::UpdateReceiver& receiver, firmware::Clock& clock,
                              firmware::Reset& reset, firmware::RescueService* rescue) {
  dfu_.emplace(clock, board_.slots(), receiver, product_, protocol::usb::kDfuInterface);
  const std::string_view build = board_.slots().build_id();
  device_.emplace(firmware::UsbParts{.controller = *board_.usb(),
                                     .clock = clock,
                                     .reset = reset,
                                     .link = link_,
                                     .dfu = *dfu_,
                                     .rescue = rescue},
                  firmware::UsbIdentity{.manufacturer = kManufacturer,
                                        .product = product_,
                                        .serial = serial_,
                                        .release_bcd = release_bcd(build.substr(build.rfind(' ') + 1))});
}

firmware::Step UsbFirmware::poll() noexcept {
  if (!rescue_) {
    board_.rescue_ports().watchdog.kick();
  }
  return device_->poll();
}

}  // namespace scatter::simulator
