// tcp: and unix: carriers. Internal: programs use TransportRegistry.
#pragma once

#include <memory>

#include "host_sdk/device/transport.h"

namespace scatter::device {

/// `tcp:host:port`. Errors  kInvalidArgument, kNotFound (no such host), kUnavailable (nobody
/// listens there), kDeadlineExceeded, kAborted.
[[nodiscard]] Result<std::unique_ptr<Transport>> open_tcp(const Uri& uri, const Wait& wait);

/// `unix:path`. Errors  kInvalidArgument, kNotFound (no such socket), kUnavailable, kPermissionDenied.
[[nodiscard]] Result<std::unique_ptr<Transport>> open_unix(const Uri& uri, const Wait& wait);

/// Takes over a connected stream socket and closes it in the end (socket pairs, tests).
[[nodiscard]] std::unique_ptr<Transport> adopt_socket(int descriptor);

}  // namespace scatter::device
