#include "tools/scatter/times.h"

#include <fmt/chrono.h>

#include <ctime>

namespace scatter::cli {

std::string utc_text(std::uint64_t unix_ns) {
  if (unix_ns == 0) {
    return "unknown";
  }
  const auto seconds = static_cast<std::time_t>(unix_ns / 1'000'000'000ULL);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", parts);
}

}  // namespace scatter::cli
