// What the USB logic (firmware/core/usb) needs from a device controller: a narrow port that the registers of
// common controllers (Synopsys DWC2, ChipIdea) and the simulator's virtual socket can both serve.
//
// All calls are non-blocking and made from the main loop; a driver's interrupt hands over through its own
// queue.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace scatter::firmware {

enum class UsbSpeed : std::uint8_t { kNone, kFull, kHigh };

/// One thing that happened on the bus.
struct UsbEvent {
  enum class Kind : std::uint8_t {
    kNone,       ///< Nothing new.
    kReset,      ///< Reset signalling: address 0, no configuration; endpoint queues are empty.
    kUnplugged,  ///< No host (VBUS gone), or the link was lost.
    kSuspended,
    kResumed,
    kSetup,        ///< A SETUP packet; ends whatever control transfer was under way.
    kControlData,  ///< The OUT data stage asked for by control_receive() is complete.
  };
  Kind kind = Kind::kNone;
  std::array<std::uint8_t, 8> setup{};  ///< kSetup: as on the bus.
  std::size_t size = 0;                 ///< kControlData: bytes received.
};

struct UsbEndpoint {
  enum class Type : std::uint8_t { kBulk = 2, kInterrupt = 3 };
  std::uint8_t address = 0;  ///< Bit 7: to the host.
  Type type = Type::kBulk;
  std::uint16_t packet_bytes = 0;  ///< wMaxPacketSize.
};

class UsbController {
 public:
  /// Joins the bus (pull-up) or leaves it. Leaving empties everything; events come again after joining.
  virtual void connect(bool on) noexcept = 0;
  /// Of the bus now; kNone while there is no host or no reset has come.
  [[nodiscard]] virtual UsbSpeed speed() noexcept = 0;
  /// The oldest event that was not taken yet.
  [[nodiscard]] virtual UsbEvent next_event() noexcept = 0;

  // Endpoint 0. Every kSetup is answered by exactly one of send, accept and stall; accept and stall may come
  // after a control_receive().

  /// IN data stage, at most wLength bytes (a shorter one ends with a short packet, maybe one of no bytes),
  /// then the status stage. `data` stays untouched until the next event. Not for wLength 0.
  virtual void control_send(std::span<const std::byte> data) noexcept = 0;
  /// OUT data stage into `room`; kControlData says when it is there.
  virtual void control_receive(std::span<std::byte> room) noexcept = 0;
  /// Status stage of a request without data, or whose data was taken.
  virtual void control_accept() noexcept = 0;
  virtual void control_stall() noexcept = 0;
  /// Called before control_accept(); takes effect after the status stage of SET_ADDRESS.
  virtual void set_address(std::uint8_t address) noexcept = 0;

  // Other endpoints.

  /// These are the open ones from now on: one that was open already stays as it is (another interface's data
  /// toggles must not change), a new one begins with its data toggle reset, no halt and an empty queue, one
  /// that is not named is closed.
  virtual void open_endpoints(std::span<const UsbEndpoint> endpoints) noexcept = 0;
  /// IN: takes as many of `bytes` as there is room for; an empty queue has room for a packet at least. Whole
  /// packets leave without end_transfer(). OUT endpoints and closed ones take nothing.
  [[nodiscard]] virtual std::size_t write(std::uint8_t endpoint,
                                          std::span<const std::byte> bytes) noexcept = 0;
  /// IN: the bytes written so far end a transfer, by a short packet or one of no bytes. Idempotent.
  virtual void end_transfer(std::uint8_t endpoint) noexcept = 0;
  /// IN: bytes that the host has not taken yet.
  [[nodiscard]] virtual std::size_t waiting(std::uint8_t endpoint) noexcept = 0;
  /// OUT: takes received bytes, of an interrupt endpoint those of one packet; 0 = none waiting.
  [[nodiscard]] virtual std::size_t read(std::uint8_t endpoint, std::span<std::byte> out) noexcept = 0;
  /// Halts the endpoint (STALL) or ends the halt with the data toggle reset and its queue empty.
  virtual void set_halt(std::uint8_t endpoint, bool halted) noexcept = 0;
  [[nodiscard]] virtual bool halted(std::uint8_t endpoint) noexcept = 0;

 protected:
  ~UsbController() = default;
};

}  // namespace scatter::firmware
