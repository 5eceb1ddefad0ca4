// Opening instruments by URI, and telling URIs from files.
#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

#include "host_sdk/device/device.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

/// True when the text starts with a known or reserved scheme and no file has that name.
[[nodiscard]] bool is_uri(std::string_view text, const device::TransportRegistry& registry);

/// Opens the instrument within 10 s. Errors: as Device::open; a file's name is answered with what to do.
[[nodiscard]] Result<device::Device> open_device(const std::string& uri, const Context& context);

/// Asks the person at the terminal to do something and waits for Enter; empty when there is nobody to
/// ask (standard input or error is no terminal). Returns false when the person gave up (q, end of input,
/// ctrl-C).
[[nodiscard]] std::function<bool(const std::string&)> person_at_terminal(const std::stop_token& stop);

}  // namespace scatter::cli
