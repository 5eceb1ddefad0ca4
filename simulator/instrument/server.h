// Serves a virtual instrument, or another device, to other processes over a socket.
#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::simulator {

class ServedDevice;
class VirtualInstrument;

struct ServerOptions {
  bool allow_remote = false;  ///< Listen on addresses that other computers reach.
};

/// One device, one host at a time. The first connection is the host; another one meanwhile gets a
/// BUSY reply that names the holder, and the first notices nothing. A host that vanishes ends its run;
/// the next one may come at once.
///
/// Time      Real clock: as it runs. Virtual clock: from event to event while the device has something
///           to do, with the computer's clock while it waits for the host, and not at all while the
///           host does not take what was sent.
/// Threads   serve() from one thread; request the stop, and press the button, from any.
class Server {
 public:
  /// Starts to listen; hosts can connect from now on and are served by serve().
  /// `device` must outlive the server. `address`: tcp:HOST:PORT (port 0: a free one) or unix:PATH.
  /// Errors    see Listener::open.
  [[nodiscard]] static Result<std::unique_ptr<Server>> listen(std::string_view address, ServedDevice& device,
                                                              const ServerOptions& options = {});
  [[nodiscard]] static Result<std::unique_ptr<Server>> listen(std::string_view address,
                                                              VirtualInstrument& instrument,
                                                              const ServerOptions& options = {});
  ~Server();

  /// URI for hosts, with the true port.
  [[nodiscard]] const std::string& address() const noexcept;

  /// Serves until stopped (within 100 ms); the socket file goes with the Server.
  /// Errors    kInternal: the system refuses to poll; others by the device when it is gone for good.
  [[nodiscard]] Status serve(const std::stop_token& stop);

  /// Somebody presses the instrument's measure button, where it has one.
  void press_button() noexcept;

  struct Statistics {
    std::uint64_t hosts = 0;        ///< Connections that held the device.
    std::uint64_t turned_away = 0;  ///< Connections that got BUSY.
  };
  [[nodiscard]] Statistics statistics() const noexcept;

 private:
  struct Parts;
  explicit Server(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace scatter::simulator
