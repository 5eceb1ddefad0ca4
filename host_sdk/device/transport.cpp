#include "host_sdk/device/transport.h"

#include <algorithm>

#include "host_sdk/device/replay_transport.h"
#include "host_sdk/device/socket_transport.h"

namespace scatter::device {

TransportRegistry::TransportRegistry() {
  add({"tcp", "tcp:127.0.0.1:7000", "instrument or simulator served over the network", open_tcp});
  add({"unix", "unix:/run/scatter.sock", "instrument or simulator served on this machine", open_unix});
  add({"replay", "replay:run.scat", "recording played back through the same code", open_replay});
}

void TransportRegistry::add(Scheme scheme) {
  const auto same = std::ranges::find(schemes_, scheme.name, &Scheme::name);
  if (same != schemes_.end()) {
    *same = std::move(scheme);
  } else {
    schemes_.push_back(std::move(scheme));
  }
}

Result<std::unique_ptr<Transport>> TransportRegistry::open(std::string_view uri, const Wait& wait) const {
  const Result<Uri> parsed = parse_uri(uri);
  if (!parsed) {
    return std::unexpected(parsed.error());
  }
  const auto scheme = std::ranges::find(schemes_, parsed->scheme, &Scheme::name);
  if (scheme != schemes_.end()) {
    return scheme->open(*parsed, wait);
  }
  std::string known;
  for (const Scheme& one : schemes_) {
    known += (known.empty() ? "" : ", ") + one.name + ":";
  }
  if (parsed->scheme == "usb" || parsed->scheme == "serial") {
    return fail(ErrorCode::kUnimplemented,
                std::string(uri) + ": the carrier " + parsed->scheme + ": is not built in yet",
                "use one of " + known);
  }
  return fail(ErrorCode::kInvalidArgument, std::string(uri) + ": unknown scheme '" + parsed->scheme + "'",
              "use one of " + known);
}

}  // namespace scatter::device
