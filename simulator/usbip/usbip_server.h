// Serves a simulated instrument's USB socket to Linux's own USB stack over USB/IP: `usbip attach` puts it on
// a machine's bus.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/instrument/virtual_clock.h"
#include "simulator/usb/usb_port.h"

namespace scatter::simulator {

class FileDescriptor;
class VhciBus;
class VirtualInstrument;

/// What UsbIpServer serves: a USB socket, and the instrument behind it that has to run. Threads: the
/// server's.
class UsbIpDevice {
 public:
  UsbIpDevice() = default;
  UsbIpDevice(const UsbIpDevice&) = delete;
  UsbIpDevice& operator=(const UsbIpDevice&) = delete;
  virtual ~UsbIpDevice() = default;

  [[nodiscard]] virtual UsbPort& port() = 0;
  /// See VirtualInstrument.
  [[nodiscard]] virtual std::uint64_t run_ready() = 0;
  [[nodiscard]] virtual std::uint64_t now_us() const = 0;
  [[nodiscard]] virtual ClockMode clock_mode() const = 0;
  virtual void advance_to(std::uint64_t time_us) = 0;
  virtual void press_button() = 0;
};

struct UsbIpOptions {
  bool allow_remote = false;  ///< Listen on addresses that other computers reach.
  UsbBusSpeed speed = UsbBusSpeed::kHigh;
  /// Also plugs the device into this machine's own bus, and again whenever it comes back after leaving (not
  /// after somebody detached it there). Null: only those who connect get it. Outlives the server.
  VhciBus* plug_into = nullptr;
};

/// One device (bus id 1-1), one holder at a time; the list of devices is there for everybody, and a second
/// import gets "busy". When the device leaves the bus (a restart, DFU mode), the holder's connection ends,
/// and when it is back it can be imported again. When the holder leaves, the device sees a bus reset.
///
/// Time      See pace.h.
/// Threads   serve() from one thread; request the stop, and press the button, from any.
class UsbIpServer {
 public:
  /// Plugs the device in and starts to listen; serve() answers. `device` outlives the server. `address`:
  /// tcp:HOST:PORT (port 0: a free one).
  /// Errors    see Listener::open.
  [[nodiscard]] static Result<std::unique_ptr<UsbIpServer>> listen(std::string_view address,
                                                                   UsbIpDevice& device,
                                                                   const UsbIpOptions& options = {});
  /// kFailedPrecondition: the instrument's carrier is not USB.
  [[nodiscard]] static Result<std::unique_ptr<UsbIpServer>> listen(std::string_view address,
                                                                   VirtualInstrument& instrument,
                                                                   const UsbIpOptions& options = {});
  /// Unplugs the device.
  ~UsbIpServer();
  UsbIpServer(const UsbIpServer&) = delete;
  UsbIpServer& operator=(const UsbIpServer&) = delete;

  /// "usbip:HOST:PORT", with the true port.
  [[nodiscard]] const std::string& address() const noexcept;
  /// What `usbip attach -b` wants.
  [[nodiscard]] static std::string_view bus_id() noexcept;

  /// Serves a client whose connection is there already: a connected stream socket. Not beside serve().
  void adopt(FileDescriptor socket, std::string peer);

  /// Serves until stopped (within 100 ms); then the device is off the machine's bus.
  /// Errors    kInternal: the system refuses to poll; those of VhciBus::attach.
  [[nodiscard]] Status serve(const std::stop_token& stop);

  /// Somebody presses the instrument's measure button.
  void press_button() noexcept;

  struct Statistics {
    std::uint64_t connections = 0;
    std::uint64_t imports = 0;          ///< Of the device; this machine's own bus included.
    std::uint64_t refused_imports = 0;  ///< Busy, off the bus, or another bus id.
    std::uint64_t broken = 0;           ///< Connections that did not keep to the protocol.
    std::string last_problem;           ///< Of the last of them.
    std::uint64_t transfers = 0;
    std::uint64_t bytes_to_host = 0;
    std::uint64_t bytes_to_device = 0;
  };
  [[nodiscard]] Statistics statistics() const;

 private:
  struct Parts;
  explicit UsbIpServer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace scatter::simulator
