#include "host_sdk/device/uri.h"

#include <algorithm>
#include <charconv>

namespace scatter::device {

namespace {

constexpr bool is_scheme_character(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '+' || c == '.' ||
         c == '-';
}

/// In quotes; appended, as g++ 12 warns falsely about "'" + text.
std::string quoted(std::string_view text) {
  return std::string(1, '\'').append(text).append(1, '\'');
}

constexpr char lower(char c) noexcept {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

std::string Uri::text() const {
  std::string out = scheme + ":" + place;
  if (!query.empty()) {
    out += "?" + query;
  }
  return out;
}

Result<Uri> parse_uri(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos || colon == 0) {
    return fail(ErrorCode::kInvalidArgument, quoted(text) + " is not a device URI: no scheme",
                "write it like sim:, tcp:127.0.0.1:7000, unix:/run/scatter.sock or replay:run.scat");
  }
  const std::string_view scheme = text.substr(0, colon);
  if (!std::ranges::all_of(scheme, is_scheme_character)) {
    return fail(ErrorCode::kInvalidArgument,
                quoted(text) + " is not a device URI: bad character in the scheme",
                "write it like sim:, tcp:127.0.0.1:7000, unix:/run/scatter.sock or replay:run.scat");
  }
  Uri uri;
  uri.scheme.resize(scheme.size());
  std::ranges::transform(scheme, uri.scheme.begin(), lower);
  const std::string_view rest = text.substr(colon + 1);
  const std::size_t mark = rest.find('?');
  uri.place = std::string(rest.substr(0, mark));
  if (mark != std::string_view::npos) {
    uri.query = std::string(rest.substr(mark + 1));
  }
  return uri;
}

Result<HostPort> parse_host_port(std::string_view place) {
  const std::size_t colon = place.rfind(':');
  const auto bad = [place](std::string_view why) {
    return fail(ErrorCode::kInvalidArgument, quoted(place) + ": " + std::string(why),
                "write host and port, for example tcp:127.0.0.1:7000 or tcp:[::1]:7000");
  };
  if (colon == std::string_view::npos) {
    return bad("the port is missing");
  }
  std::string_view host = place.substr(0, colon);
  const std::string_view port = place.substr(colon + 1);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return bad("an IPv6 address stands in brackets");
  }
  if (host.empty()) {
    return bad("the host is missing");
  }
  unsigned number = 0;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (error != std::errc{} || end != port.data() + port.size() || number == 0 || number > 65535) {
    return bad("the port is not a number from 1 to 65535");
  }
  return HostPort{std::string(host), std::string(port)};
}

}  // namespace scatter::device
