// The USB socket of the virtual instrument, seen from the host: transfers go in, completions come out. What a
// USB/IP server and a mocked usbfs both stand on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace scatter::simulator {

enum class UsbBusSpeed : std::uint8_t { kFull, kHigh };

/// One transfer (URB) that a host submits.
struct UsbTransfer {
  std::uint64_t id = 0;                 ///< Chosen by the host; unique among those under way.
  std::uint8_t endpoint = 0;            ///< Bit 7: to the host. 0x00 and 0x80 are the control endpoint.
  std::array<std::uint8_t, 8> setup{};  ///< Control only, as on the bus.
  std::vector<std::byte> data{};  ///< To the device; to the host: memory to use, its contents do not matter.
  std::size_t length = 0;         ///< To the host: at most so many bytes.
};

enum class UsbOutcome : std::uint8_t {
  kDone,       ///< Maybe shorter than asked.
  kStalled,    ///< The endpoint is halted, or the control request was refused.
  kBabble,     ///< The device sent more than asked (an injected fault); the bytes are lost.
  kError,      ///< No handshake (an injected fault, or no such endpoint).
  kCancelled,  ///< By cancel().
  kGone,       ///< The device left the bus.
};

struct UsbCompletion {
  std::uint64_t id = 0;
  UsbOutcome outcome = UsbOutcome::kDone;
  std::size_t actual = 0;         ///< Bytes moved, either way.
  std::vector<std::byte> data{};  ///< To the host: `actual` bytes.
};

/// Calls never block; what the device does about them happens when the instrument runs. Threads: the
/// instrument's.
class UsbPort {
 public:
  UsbPort() = default;
  UsbPort(const UsbPort&) = delete;
  UsbPort& operator=(const UsbPort&) = delete;
  virtual ~UsbPort() = default;

  /// Plugs the cable in; the device sees a bus reset. A device that has left the bus does not answer yet.
  virtual void plug(UsbBusSpeed speed) = 0;
  /// Pulls the cable: transfers under way end with kGone.
  virtual void unplug() = 0;
  [[nodiscard]] virtual bool plugged() const = 0;
  /// The device is on the bus: plugged in, and it has joined (it leaves for a restart and for DFU mode, and
  /// comes back by itself: then enumerate it anew). Each joining counts.
  [[nodiscard]] virtual bool present() const = 0;
  [[nodiscard]] virtual std::uint32_t joins() const = 0;
  /// Reset signalling; transfers under way end with kGone.
  virtual void reset() = 0;

  virtual void submit(UsbTransfer transfer) = 0;
  /// It completes as kCancelled. False: it is not under way (any more).
  virtual bool cancel(std::uint64_t id) = 0;
  /// In order of completion.
  [[nodiscard]] virtual std::optional<UsbCompletion> next_completion() = 0;
  [[nodiscard]] virtual std::size_t under_way() const = 0;
  /// A bulk endpoint holds bytes for the host and no transfer is there to take them: virtual time stands
  /// still meanwhile (pace.h), so that a host slower than virtual time loses nothing.
  [[nodiscard]] virtual bool host_is_slow() const = 0;
};

}  // namespace scatter::simulator
