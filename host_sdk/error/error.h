// Failures as values: Result<T>, Status, Error. The foundation of the host side; includes nothing of ours.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <utility>

namespace scatter {

/// Chosen by what the caller does next; numbers equal protocol::StatusCode and are frozen
/// (host_sdk/device proves the equality at compile time).
enum class ErrorCode : std::uint16_t {
  kInvalidArgument = 2,
  kFailedPrecondition = 3,
  kUnavailable = 4,
  kUnimplemented = 5,
  kNotFound = 6,
  kOutOfRange = 7,
  kResourceExhausted = 8,
  kDataLoss = 9,
  kDeadlineExceeded = 10,
  kAborted = 11,
  kBusy = 12,
  kVersionMismatch = 13,
  kPermissionDenied = 14,
  kInternal = 15,
  kDisconnected = 16,
};

/// What happened and what to do about it.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string what;    ///< Object, expected, found: "scan.exr: part 2 has 75 rows, expected 76".
  std::string remedy;  ///< One imperative phrase: "export the file again"; never empty.
};

template <typename T>
using Result = std::expected<T, Error>;
using Status = std::expected<void, Error>;

[[nodiscard]] inline std::unexpected<Error> fail(ErrorCode code, std::string what, std::string remedy) {
  return std::unexpected<Error>(Error{code, std::move(what), std::move(remedy)});
}

/// Name as in SPEC.md, for example "DATA_LOSS".
[[nodiscard]] std::string_view name(ErrorCode code) noexcept;

}  // namespace scatter
