// The device behind a USB/IP server: who it is, who holds it, and the holder's transfers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "simulator/usb/usb_port.h"
#include "simulator/usbip/usbip_protocol.h"

namespace scatter::simulator::usbip {

/// RET_SUBMIT or RET_UNLINK, with the data behind it.
struct Reply {
  UrbHeader header{};
  std::vector<std::byte> data;
};

/// Plugs the device in, and pulls the cable when destroyed. USB/IP carries no signalling, so this is the bus:
/// it gives the address, resets the device when a holder lets it go, and takes a SET_CONFIGURATION of a
/// configured device for what it is on Linux, the end of a bus reset.
///
/// Memory    bounded by the constants below, whatever a holder sends.
/// Threads   the instrument's.
class ExportedDevice {
 public:
  static constexpr std::string_view kBusId = "1-1";
  static constexpr std::uint32_t kBusNumber = 1;
  static constexpr std::uint32_t kDeviceNumber = 2;
  static constexpr std::size_t kMostUnderWay = 1024;              ///< Transfers; more end with ENOMEM.
  static constexpr std::size_t kMostBytesUnderWay = 64UL << 20U;  ///< Their buffers in all; likewise.

  /// `port` outlives this.
  ExportedDevice(UsbPort& port, UsbBusSpeed speed);
  ExportedDevice(const ExportedDevice&) = delete;
  ExportedDevice& operator=(const ExportedDevice&) = delete;
  ~ExportedDevice();

  /// Call after each run of the instrument: notices that the device left or joined the bus, asks a new one
  /// who it is, takes what has been completed. True when there is something new for the holder or the device.
  bool poll();

  /// Null while it is off the bus or has not said who it is.
  [[nodiscard]] const DeviceRecord* record() const noexcept { return record_ ? &*record_ : nullptr; }

  /// Takes the device, if nobody has it.
  [[nodiscard]] OpStatus import(std::string_view bus_id);
  [[nodiscard]] bool held() const noexcept { return held_; }
  /// The device that was imported has left the bus, or left and joined, or is another one since a reset (DFU
  /// mode ends so): release it, import anew.
  [[nodiscard]] bool left() const noexcept { return left_; }
  /// The holder is gone: the device sees a reset, replies are forgotten.
  void release();

  // While held.

  /// "": taken; else what was wrong with it, and the connection has to end.
  [[nodiscard]] std::string submit(SubmitUrb&& urb);
  [[nodiscard]] std::string unlink(const UnlinkUrb& urb);
  /// In the order in which they have to be sent.
  [[nodiscard]] std::optional<Reply> next_reply();
  /// Gives the memory of a reply that was sent back, for data to come.
  void reuse(std::vector<std::byte>&& data);

 private:
  struct UnderWay {
    std::size_t bytes = 0;  ///< Of its buffer.
    bool to_host = false;
    bool short_not_ok = false;
    std::optional<std::uint32_t> unlink;  ///< The CMD_UNLINK that wants it stopped.
  };

  void start_again();
  void ask_who();
  void control_in(std::uint64_t id, std::uint8_t descriptor, std::size_t length);
  void learn(UsbCompletion&& completion);
  bool take_completions();
  void complete(UsbCompletion&& completion);
  void refuse(const SubmitUrb& urb, UrbStatus status);
  [[nodiscard]] std::uint64_t port_id(std::uint32_t sequence) const noexcept {
    return std::uint64_t{generation_} << 32U | sequence;
  }

  UsbPort& port_;
  UsbBusSpeed speed_;
  std::uint32_t joins_ = 0;       ///< The port's count at the last look.
  bool on_bus_ = false;           ///< At the last look.
  std::uint32_t generation_ = 1;  ///< Of holders; 0 is the bus itself.
  std::vector<std::byte> device_descriptor_;
  std::optional<DeviceRecord> record_;
  int questions_ = 0;  ///< Asked of this device without an answer that makes sense.
  bool held_ = false;
  bool left_ = false;
  bool configured_ = false;  ///< By the holder.
  std::map<std::uint32_t, UnderWay> under_way_;
  std::size_t bytes_under_way_ = 0;
  std::deque<Reply> replies_;
  std::vector<std::vector<std::byte>> spare_;
};

}  // namespace scatter::simulator::usbip
