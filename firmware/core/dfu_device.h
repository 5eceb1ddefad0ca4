// USB Device Firmware Upgrade 1.1 (USB-IF, 5 August 2004) without the USB: the state machine of appendix A,
// behind the few calls that a USB stack's control endpoint makes. What is downloaded is a whole .scfw.
//
// Answers of this device to what the specification leaves open:
// - bitCanUpload = 0: a slot holds one linking of a release, and one alone could not be downloaded again.
// - bitManifestationTolerant = 1: after a download the device goes on answering, in dfuIDLE; a bus reset then
//   asks for the restart that tries the new image. dfuMANIFEST-WAIT-RESET and dfuUPLOAD-IDLE are never
//   entered.
// - bitWillDetach = 1: after DETACH the device leaves the bus by itself and comes back in DFU mode.
// - dfuDNBUSY and dfuMANIFEST end when the work is done, or at half of the bwPollTimeout that the host was
// told,
//   so that a host whose clock is a little fast is served. Before that a request is an error, as the table
//   says.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/core/package_stream.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware {

/// Table 3.2.
enum class DfuRequestCode : std::uint8_t {
  kDetach = 0,
  kDnload = 1,
  kUpload = 2,
  kGetStatus = 3,
  kClrStatus = 4,
  kGetState = 5,
  kAbort = 6,
};

/// bState, section 6.1.2.
enum class DfuState : std::uint8_t {
  kAppIdle = 0,
  kAppDetach = 1,
  kIdle = 2,
  kDnloadSync = 3,
  kDnbusy = 4,
  kDnloadIdle = 5,
  kManifestSync = 6,
  kManifest = 7,
  kManifestWaitReset = 8,  ///< Never entered.
  kUploadIdle = 9,         ///< Never entered.
  kError = 10,
};

/// bStatus, section 6.1.2. This device gives those with a comment.
enum class DfuStatus : std::uint8_t {
  kOk = 0x00,
  kErrTarget = 0x01,  ///< For another product.
  kErrFile = 0x02,    ///< No whole .scfw, or refused: signature, slot, address, size, security counter.
  kErrWrite = 0x03,
  kErrErase = 0x04,  ///< The slot cannot be erased, or did not take the header.
  kErrCheckErased = 0x05,
  kErrProg = 0x06,      ///< Flash did not take a part of the body.
  kErrVerify = 0x07,    ///< The image in flash is not the signed one.
  kErrAddress = 0x08,   ///< A block number is not the one after the last.
  kErrNotDone = 0x09,   ///< The download ended before the file.
  kErrFirmware = 0x0A,  ///< No image can be started (rescue mode).
  kErrVendor = 0x0B,    ///< Updates are not possible now: one over the normal protocol is under way, or the
                        ///< running image is on trial and the other slot its fallback.
  kErrUsbr = 0x0C,
  kErrPor = 0x0D,
  kErrUnknown = 0x0E,     ///< Somebody else used the update receiver meanwhile.
  kErrStalledPkt = 0x0F,  ///< A request that the state does not allow.
};

/// For the interface descriptors, sections 4.1.2 and 4.2.3.
inline constexpr std::uint8_t kDfuInterfaceClass = 0xFE;
inline constexpr std::uint8_t kDfuInterfaceSubClass = 0x01;
inline constexpr std::uint8_t kDfuProtocolRunTime = 0x01;
inline constexpr std::uint8_t kDfuProtocolDfuMode = 0x02;

/// For the functional descriptor, section 4.1.3.
inline constexpr std::uint8_t kDfuCanDnload = 1U << 0U;
inline constexpr std::uint8_t kDfuCanUpload = 1U << 1U;
inline constexpr std::uint8_t kDfuManifestationTolerant = 1U << 2U;
inline constexpr std::uint8_t kDfuWillDetach = 1U << 3U;
inline constexpr std::uint8_t kDfuAttributes = kDfuCanDnload | kDfuManifestationTolerant | kDfuWillDetach;
inline constexpr std::uint16_t kDfuDetachTimeoutMs = 1000;
inline constexpr std::uint16_t kDfuTransferBytes = PackageStream::kMaxBlock;
inline constexpr std::uint16_t kDfuVersion = 0x0110;  ///< bcdDFUVersion.
/// As it goes over the bus, the same in both descriptor sets.
inline constexpr std::array<std::uint8_t, 9> kDfuFunctionalDescriptor{
    9,
    0x21,
    kDfuAttributes,
    kDfuDetachTimeoutMs & 0xFFU,
    kDfuDetachTimeoutMs >> 8U,
    kDfuTransferBytes & 0xFFU,
    kDfuTransferBytes >> 8U,
    kDfuVersion & 0xFFU,
    kDfuVersion >> 8U,
};

/// A class request to the DFU interface, its data stage done.
struct DfuRequest {
  std::uint8_t request = 0;  ///< bRequest: a DfuRequestCode, or anything.
  std::uint16_t value = 0;   ///< wValue: DNLOAD: block number; DETACH: timeout [ms].
  std::uint16_t index = 0;   ///< wIndex: interface.
  std::uint16_t length = 0;  ///< wLength [B].
  std::span<const std::byte>
      data{};  ///< From the host, `length` bytes for DNLOAD; used only during the call.
};

struct DfuReply {
  bool stall = false;     ///< STALL the control pipe; nothing else counts then.
  bool detach = false;    ///< After the status stage: leave the bus and attach again.
  std::uint8_t size = 0;  ///< Of `bytes`, to the host.
  std::array<std::byte, 6> bytes{};
};

/// How to go on after a bus reset.
enum class DfuAfterReset : std::uint8_t {
  kRunTime,  ///< Enumerate with the run-time descriptors.
  kDfuMode,  ///< Enumerate with those of DFU mode.
  kRestart,  ///< A new image is ready: restart the device, so that the bootloader tries it.
};

/// RAM: 5216 B on a Cortex-M7, no heap. Threads: one, that of the main loop (a USB stack that calls from an
/// interrupt hands the request over first). Cost of a request: at most kDfuTransferBytes copied.
class DfuDevice {
 public:
  /// What the host is told to wait [ms] while a block is stored, and while flash is erased or an image
  /// hashed.
  static constexpr std::uint32_t kBlockPollMs = 10;
  static constexpr std::uint32_t kManifestPollMs = 100;

  /// `interface_number` is what wIndex of our requests holds. In a bootloader (no slot runs) the device
  /// begins in dfuERROR with errFIRMWARE, else in appIDLE. All outlive the device; in DFU mode the receiver
  /// is the device's alone.
  DfuDevice(Clock& clock, ImageSlots& slots, UpdateReceiver& receiver, std::string_view product,
            std::uint16_t interface_number) noexcept;

  /// Serves one class request. One to another interface is stalled and changes nothing.
  [[nodiscard]] DfuReply request(const DfuRequest& request) noexcept;
  /// One bounded piece of the work in the background (PackageStream::step), and the timers. Call it on every
  /// turn of the main loop.
  void poll() noexcept;
  /// There is work for poll().
  [[nodiscard]] bool busy() const noexcept { return stream_.busy(); }
  /// Reset signalling on the bus. Hosts reset more than once while they enumerate, so DFU mode is left only
  /// after it served a request. A download that was under way stops; the same file resumes it.
  [[nodiscard]] DfuAfterReset bus_reset() noexcept;

  [[nodiscard]] DfuState state() const noexcept { return state_; }
  [[nodiscard]] DfuStatus status() const noexcept { return status_; }

 private:
  void advance() noexcept;
  void fail(DfuStatus status) noexcept;
  void wait(DfuState state, std::uint32_t poll_ms) noexcept;
  [[nodiscard]] DfuReply refuse(DfuStatus status = DfuStatus::kErrStalledPkt) noexcept;
  [[nodiscard]] DfuReply give_status(std::uint16_t length) const noexcept;
  [[nodiscard]] DfuReply give_state(std::uint16_t length) const noexcept;
  [[nodiscard]] DfuReply in_application(const DfuRequest& request) noexcept;
  [[nodiscard]] DfuReply get_status(const DfuRequest& request) noexcept;
  [[nodiscard]] DfuReply download(const DfuRequest& request) noexcept;

  Clock& clock_;
  ImageSlots& slots_;
  PackageStream stream_;
  std::uint16_t interface_;

  DfuState state_ = DfuState::kAppIdle;
  DfuStatus status_ = DfuStatus::kOk;
  bool served_ = false;      // A request, since DFU mode was entered.
  bool manifested_ = false;  // Manifestation was begun.
  std::uint16_t next_block_ = 0;
  std::uint32_t poll_ms_ = 0;   // bwPollTimeout.
  std::uint64_t until_us_ = 0;  // End of appDETACH, dfuDNBUSY, dfuMANIFEST.
};

}  // namespace scatter::firmware
