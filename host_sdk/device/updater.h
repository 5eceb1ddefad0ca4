// A whole firmware update: check, send, restart, try, confirm; resumable at every point.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "host_sdk/device/device.h"
#include "host_sdk/device/wait.h"
#include "host_sdk/error/error.h"
#include "host_sdk/firmware_files/package.h"
#include "protocol/image_header.h"
#include "protocol/messages.h"

namespace scatter::device {

enum class UpdateStage : std::uint8_t {
  kReverting,  ///< Restarts the device to end the trial of another image.
  kPreparing,  ///< The device checks the header and erases the slot.
  kSending,
  kVerifying,  ///< The device hashes the image.
  kRestarting,
  kChecking,  ///< Status and self test of the new firmware.
};

struct UpdateProgress {
  UpdateStage stage = UpdateStage::kPreparing;
  std::uint32_t done = 0;  ///< kSending: bytes of the body that the device has.
  std::uint32_t total = 0;
};

struct UpdateOptions {
  std::span<const protocol::PublicKey> trusted;  ///< Whose releases may be sent; the device has its own list.
  bool same_version_too = false;
  bool confirm = true;    ///< False: leave the new firmware on trial; it goes at the next restart.
  std::size_t depth = 4;  ///< Pieces under way at once.
  Duration restart = std::chrono::seconds(60);  ///< For the device to come back, real time.
  Duration request = std::chrono::seconds(60);  ///< For any one request, on the transport's clock.
  std::stop_token stop = {};
  std::function<void(const UpdateProgress&)> progress = {};
  /// Called once, with what runs and what will be sent, before anything is changed.
  std::function<void(const protocol::UpdateState&, std::uint8_t slot)> about_to_begin = {};
};

enum class UpdateOutcome : std::uint8_t {
  kConfirmed,  ///< The new firmware runs and is kept.
  kOnTrial,    ///< It runs; the caller did not want it confirmed.
  kReverted,   ///< The old firmware runs again: `why` says what was wrong with the new one.
};

struct UpdateReport {
  UpdateOutcome outcome = UpdateOutcome::kReverted;
  std::string why;        ///< When reverted: what happened, for people.
  std::uint8_t slot = 0;  ///< Got the image.
  std::uint32_t body_bytes = 0;
  std::uint32_t sent_bytes = 0;  ///< By this call; less than body_bytes when it resumed an earlier one.
  int reconnections = 0;         ///< Times that the link had to be opened again while sending.
  protocol::UpdateState before;
  protocol::UpdateState after;
  protocol::ResetReason reset_reason = protocol::ResetReason::kPowerOn;  ///< Of the last start.
  std::optional<protocol::FaultRecord> fault;                            ///< When the new firmware crashed.
};

/// Opens the device, and opens it again after it went away. The Wait bounds one attempt.
using OpenDevice = std::function<Result<Device>(const Wait& wait)>;

/// Brings a release onto a device.
///
/// Resumes   after a lost link by itself, as long as it gets on; after any other end (stop request, power cut
///           on either side) when called again with the same release.
/// Safe      at every moment the device has a whole image to start from, and nothing is kept that did not
///           pass the checks: HELLO, no new fault in the status, a right self-test pattern.
/// Errors    those of check_update() before anything is changed; kDataLoss: the device found the image
///           damaged; kAborted: stop requested; kDeadlineExceeded: the device did not come back; else the
///           last error of the link.
/// Waits     all bounded: see UpdateOptions.
[[nodiscard]] Result<UpdateReport> update_firmware(const OpenDevice& open,
                                                   const firmware_files::Package& package,
                                                   const UpdateOptions& options);

}  // namespace scatter::device
