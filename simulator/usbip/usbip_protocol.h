// USB/IP, version 1.1.1 (Linux, Documentation/usb/usbip_protocol.rst), the server's side: requests from
// bytes, replies to bytes. All numbers on the wire are big endian; the status of a transfer is a negative
// Linux errno.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace scatter::simulator::usbip {

inline constexpr std::uint16_t kVersion = 0x0111;
inline constexpr std::uint16_t kDefaultPort = 3240;

// Sizes on the wire [bytes].
inline constexpr std::size_t kOpHeaderBytes = 8;    ///< Version, code, status.
inline constexpr std::size_t kBusIdBytes = 32;      ///< Filled up with zeros.
inline constexpr std::size_t kDeviceBytes = 312;    ///< One exported device.
inline constexpr std::size_t kUrbHeaderBytes = 48;  ///< Every CMD_ and RET_ message before its data.

/// Longest transfer taken: what Linux's usbfs allows in all.
inline constexpr std::size_t kMostTransferBytes = 16UL << 20U;

/// OP_REQ_DEVLIST.
struct ListDevices {
  bool operator==(const ListDevices&) const = default;
};

/// OP_REQ_IMPORT.
struct ImportDevice {
  std::string bus_id;  ///< Without the zeros behind it.
  bool operator==(const ImportDevice&) const = default;
};

/// CMD_SUBMIT. The URB flags that mean something to a device without isochronous endpoints: SHORT_NOT_OK is
/// below; ZERO_PACKET changes nothing, because the instrument's pipe to the device is a stream of bytes.
struct SubmitUrb {
  std::uint32_t sequence = 0;           ///< Names the transfer in replies and in CMD_UNLINK.
  std::uint32_t device = 0;             ///< Bus number * 65536 + device number.
  std::uint8_t endpoint = 0;            ///< Bit 7: to the host.
  bool short_not_ok = false;            ///< To the host: less than `length` bytes is an error.
  std::size_t length = 0;               ///< Of the buffer.
  std::array<std::uint8_t, 8> setup{};  ///< Control only.
  std::vector<std::byte> data;          ///< To the device: `length` bytes.
  bool operator==(const SubmitUrb&) const = default;
};

/// CMD_UNLINK.
struct UnlinkUrb {
  std::uint32_t sequence = 0;  ///< Of this request.
  std::uint32_t device = 0;
  std::uint32_t victim = 0;  ///< The transfer that shall not go on.
  bool operator==(const UnlinkUrb&) const = default;
};

using Request = std::variant<ListDevices, ImportDevice, SubmitUrb, UnlinkUrb>;

/// Takes a client's bytes apart. The same bytes give the same requests however they were cut.
///
/// Memory    one header, and of a transfer's data what has arrived; at most kMostTransferBytes.
/// Threads   one.
class RequestReader {
 public:
  /// The next request, taken from the front of `bytes`, which becomes what is left of it. Nothing: all of it
  /// was taken and the request goes on in the bytes to come, or broken(), where nothing more is taken.
  [[nodiscard]] std::optional<Request> next(std::span<const std::byte>& bytes);

  /// After a granted import: the bytes to come are CMD_ messages, no longer OP_ requests.
  void start_transfers() noexcept { transfers_ = true; }

  /// What was wrong: expected and found. "": nothing.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
  [[nodiscard]] bool broken() const noexcept { return !problem_.empty(); }

 private:
  [[nodiscard]] bool fill_header(std::span<const std::byte>& bytes, std::size_t size);
  [[nodiscard]] std::optional<Request> next_operation(std::span<const std::byte>& bytes);
  [[nodiscard]] std::optional<Request> next_transfer(std::span<const std::byte>& bytes);
  [[nodiscard]] bool parse_submit();

  bool transfers_ = false;
  std::array<std::byte, kUrbHeaderBytes> header_{};
  std::size_t header_size_ = 0;
  std::optional<SubmitUrb> submit_;  ///< Its header is complete, its data is not.
  std::string problem_;
};

/// Status of an OP_ reply, as the usbip program understands it.
enum class OpStatus : std::uint32_t {
  kOk = 0,
  kNotAvailable = 1,  ///< The device is off the bus for the moment.
  kBusy = 2,          ///< Another host holds it.
  kDeviceError = 3,   ///< It does not answer.
  kNoDevice = 4,      ///< No such bus id.
};

enum class Speed : std::uint32_t { kFull = 2, kHigh = 3 };

/// One exported device.
struct DeviceRecord {
  struct Interface {
    std::uint8_t device_class = 0;
    std::uint8_t sub_class = 0;
    std::uint8_t protocol = 0;
    bool operator==(const Interface&) const = default;
  };
  std::string bus_id;  ///< "1-1".
  std::uint32_t bus_number = 0;
  std::uint32_t device_number = 0;
  Speed speed = Speed::kHigh;
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::uint16_t release_bcd = 0;
  Interface device;
  std::uint8_t configuration = 0;  ///< Chosen one; 0: none.
  std::uint8_t configurations = 0;
  std::vector<Interface> interfaces;  ///< Alternate setting 0 of each.

  bool operator==(const DeviceRecord&) const = default;
  /// What SubmitUrb::device is of it.
  [[nodiscard]] std::uint32_t id() const noexcept { return bus_number << 16U | device_number; }
};

/// From the descriptors that the device gave; the addresses are the caller's. Nothing when they are not
/// whole.
[[nodiscard]] std::optional<DeviceRecord> read_descriptors(std::span<const std::byte> device,
                                                           std::span<const std::byte> configuration);

/// Status of a finished transfer: negative numbers of Linux's errno.h.
enum class UrbStatus : std::int32_t {
  kOk = 0,
  kNoMemory = -12,   ///< ENOMEM: more under way than the server takes.
  kInvalid = -22,    ///< EINVAL: no such transfer is possible.
  kStalled = -32,    ///< EPIPE.
  kProtocol = -71,   ///< EPROTO: no handshake.
  kOverflow = -75,   ///< EOVERFLOW: babble.
  kUnlinked = -104,  ///< ECONNRESET.
  kShutDown = -108,  ///< ESHUTDOWN: ended by a reset.
  kShort = -121,     ///< EREMOTEIO: shorter than asked, and SHORT_NOT_OK.
};

[[nodiscard]] std::vector<std::byte> device_list(const DeviceRecord* device);
/// `device` only with kOk.
[[nodiscard]] std::vector<std::byte> import_reply(OpStatus status, const DeviceRecord* device);

using UrbHeader = std::array<std::byte, kUrbHeaderBytes>;
/// RET_SUBMIT; to the host, `actual` bytes of data follow it.
[[nodiscard]] UrbHeader submit_reply(std::uint32_t sequence, UrbStatus status, std::size_t actual);
/// RET_UNLINK: kUnlinked when the transfer was stopped, kOk when it had been replied to already.
[[nodiscard]] UrbHeader unlink_reply(std::uint32_t sequence, UrbStatus status);

}  // namespace scatter::simulator::usbip
