// May this release go onto this device? Asked before the first byte is sent, so that nothing is begun in
// vain.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/firmware_files/package.h"
#include "protocol/image_header.h"
#include "protocol/messages.h"

namespace scatter::device {

/// What is to be done, in the order of the steps; what lies before the first one is done already.
enum class UpdateStart : std::uint8_t {
  kSend,     ///< Send the image (or the rest of it).
  kConfirm,  ///< It runs on trial: only the check and the confirmation are left.
  kRevert,   ///< Another image runs on trial: restart the device, so that the confirmed one runs, then look
             ///< again.
};

struct UpdatePlan {
  UpdateStart start = UpdateStart::kSend;
  std::uint8_t slot = 0;  ///< Gets the image.
};

/// Who asks and who is trusted.
struct UpdateTrust {
  std::span<const protocol::PublicKey> keys;  ///< Whose releases may be sent.
  bool same_version_too = false;              ///< Send what runs already, too.
};

/// Errors  kUnimplemented: the device takes no updates; kInvalidArgument: another product, or too large;
///         kPermissionDenied: not signed by a trusted key, or below the device's security counter;
///         kFailedPrecondition: this version runs already.
[[nodiscard]] Result<UpdatePlan> check_update(const firmware_files::Package& package,
                                              const protocol::HelloReply& hello, std::string_view product,
                                              const protocol::UpdateState& state, const UpdateTrust& trust);

/// "ready, not tried yet", for people.
[[nodiscard]] std::string_view words(protocol::SlotVerdict verdict) noexcept;
[[nodiscard]] std::string_view words(protocol::UpdatePhase phase) noexcept;
[[nodiscard]] std::string_view words(protocol::ResetReason reason) noexcept;
[[nodiscard]] std::string_view words(protocol::FaultCode fault) noexcept;

}  // namespace scatter::device
