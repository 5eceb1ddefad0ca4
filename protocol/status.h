// Status codes of the wire, the SDK and the C ABI: one closed list, numbers frozen.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace scatter::protocol {

/// What happened to a request. Codes are chosen by what the caller does next (see `remedy`).
/// Numbers are part of the wire format and never change meaning.
enum class StatusCode : std::uint16_t {
  kOk = 0,
  kPending = 1,             ///< Accepted; the reply will come before the deadline given with it.
  kInvalidArgument = 2,     ///< Mend the argument, then ask again.
  kFailedPrecondition = 3,  ///< Change the device's state first (stop, calibrate, say HELLO).
  kUnavailable = 4,         ///< Ask again later; nothing is wrong with the request.
  kUnimplemented = 5,       ///< This device does not know the request.
  kNotFound = 6,            ///< The named object, key or calibration does not exist.
  kOutOfRange = 7,          ///< Offset or index past the end.
  kResourceExhausted = 8,   ///< A table or the flash is full.
  kDataLoss = 9,            ///< Bytes are damaged; a checksum disagrees.
  kDeadlineExceeded = 10,   ///< No answer in time.
  kAborted = 11,            ///< Cancelled by the caller.
  kBusy = 12,               ///< Another host holds the device.
  kVersionMismatch = 13,    ///< No common wire version or unknown incompatible flag.
  kPermissionDenied = 14,   ///< Read-only key, rejected signature, missing access right.
  kInternal = 15,           ///< A defect of ours: please report it with the recording.
  kDisconnected = 16,       ///< The carrier is gone (unplugged, closed).
};

struct StatusInfo {
  StatusCode code;
  std::string_view name;    ///< SPEC.md spelling.
  std::string_view remedy;  ///< What the tools print after "Remedy: ".
};

inline constexpr std::array kStatusTable{
    StatusInfo{StatusCode::kOk, "OK", ""},
    StatusInfo{StatusCode::kPending, "PENDING", "wait until the deadline given with the reply"},
    StatusInfo{StatusCode::kInvalidArgument, "INVALID_ARGUMENT", "correct the argument named in the message"},
    StatusInfo{StatusCode::kFailedPrecondition, "FAILED_PRECONDITION",
               "bring the device into the state named in the message, then try again"},
    StatusInfo{StatusCode::kUnavailable, "UNAVAILABLE", "try again in a moment"},
    StatusInfo{StatusCode::kUnimplemented, "UNIMPLEMENTED",
               "update the device's firmware or the host's software"},
    StatusInfo{StatusCode::kNotFound, "NOT_FOUND", "list what exists and choose from it"},
    StatusInfo{StatusCode::kOutOfRange, "OUT_OF_RANGE", "stay inside the range named in the message"},
    StatusInfo{StatusCode::kResourceExhausted, "RESOURCE_EXHAUSTED", "free some space, then try again"},
    StatusInfo{StatusCode::kDataLoss, "DATA_LOSS", "send or read the data again"},
    StatusInfo{StatusCode::kDeadlineExceeded, "DEADLINE_EXCEEDED",
               "check that the device has power and the cable is good, then try again"},
    StatusInfo{StatusCode::kAborted, "ABORTED", "start again when ready"},
    StatusInfo{StatusCode::kBusy, "BUSY", "close the other program that holds the device"},
    StatusInfo{StatusCode::kVersionMismatch, "VERSION_MISMATCH",
               "update the older side: host software or firmware"},
    StatusInfo{StatusCode::kPermissionDenied, "PERMISSION_DENIED",
               "use an account or a key that is allowed to do this"},
    StatusInfo{StatusCode::kInternal, "INTERNAL", "report this with the recording; it is a defect of ours"},
    StatusInfo{StatusCode::kDisconnected, "DISCONNECTED",
               "plug the device in again or restart the simulator"},
};

/// Name and remedy of a code; unknown numbers give the row of kInternal.
[[nodiscard]] constexpr const StatusInfo& info(StatusCode code) noexcept {
  for (const StatusInfo& row : kStatusTable) {
    if (row.code == code) {
      return row;
    }
  }
  return kStatusTable[15];
}

}  // namespace scatter::protocol
