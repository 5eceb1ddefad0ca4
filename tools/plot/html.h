// The two encodings that a self-contained page needs.
#pragma once

#include <string>
#include <string_view>

namespace scatter::plot {

/// Text for use between tags and inside quoted attributes: & < > " ' are replaced.
[[nodiscard]] std::string html_escaped(std::string_view text);

/// Base64 with padding (RFC 4648 section 4).
[[nodiscard]] std::string base64(std::string_view bytes);

}  // namespace scatter::plot
