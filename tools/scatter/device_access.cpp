#include "tools/scatter/device_access.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "host_sdk/device/transport.h"
#include "tools/scatter/version.h"

namespace scatter::cli {

bool is_uri(std::string_view text, const device::TransportRegistry& registry) {
  const auto colon = text.find(':');
  std::error_code error;
  if (colon == std::string_view::npos || std::filesystem::exists(text, error)) {
    return false;
  }
  const auto scheme = text.substr(0, colon);
  return scheme == "usb" || scheme == "serial" ||
         std::ranges::any_of(registry.schemes(), [&](const auto& known) { return known.name == scheme; });
}

Result<device::Device> open_device(const std::string& uri, const Context& context) {
  std::error_code error;
  if (std::filesystem::is_regular_file(uri, error)) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("'{}' is a file, not an instrument", uri),
                fmt::format("use replay:{} for a recording, or scatter process {} -o DIR", uri, uri));
  }
  device::OpenOptions options;
  options.registry = &context.registry;
  options.wait = {.timeout = std::chrono::seconds(10), .stop = context.stop};
  options.build_id = kVersion;
  return device::Device::open(uri, options);
}

std::function<bool(const std::string&)> person_at_terminal(const std::stop_token& stop) {
  if (isatty(STDIN_FILENO) != 1 || isatty(STDERR_FILENO) != 1) {
    return {};
  }
  return [stop](const std::string& instruction) {
    std::fprintf(stderr, "\r\033[K%s\nPress Enter when done, q and Enter to give up: ", instruction.c_str());
    std::fflush(stderr);
    char first = 0;
    while (!stop.stop_requested()) {
      pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
      if (poll(&input, 1, 50) <= 0) {
        continue;
      }
      char c = 0;
      if (read(STDIN_FILENO, &c, 1) != 1) {
        return false;
      }
      if (c == '\n') {
        return first != 'q';
      }
      first = first == 0 ? c : first;
    }
    return false;
  };
}

}  // namespace scatter::cli
