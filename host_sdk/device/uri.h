// Names of instruments: scheme, place, parameters (DESIGN.md section 3).
#pragma once

#include <string>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::device {

/// A parsed URI `scheme:rest` or `scheme:place?query`. The scheme is lower case. Which schemes
/// exist is the TransportRegistry's knowledge, so any well-formed one parses.
struct Uri {
  std::string scheme;  ///< "sim", "tcp", ...
  std::string place;   ///< Between the colon and the first '?'.
  std::string query;   ///< After the first '?', without it; "" when absent. Not decoded.

  /// The URI as text again.
  [[nodiscard]] std::string text() const;
};

/// Errors  kInvalidArgument: no scheme, or characters in it other than [a-z0-9+.-].
[[nodiscard]] Result<Uri> parse_uri(std::string_view text);

/// `host:port` of a tcp URI; an IPv6 host stands in brackets.
struct HostPort {
  std::string host;
  std::string port;
};

/// Errors  kInvalidArgument: host or port missing, port outside 1..65535.
[[nodiscard]] Result<HostPort> parse_host_port(std::string_view place);

}  // namespace scatter::device
