#include "simulator/emulator/qmp_client.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scatter::simulator {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr std::size_t kLongestLine = 64 * 1024;
constexpr milliseconds kTemperatureTimeout{5000};

std::unexpected<Error> gone() {
  return fail(ErrorCode::kDisconnected, "QEMU has closed its control line", "start the simulator again");
}

}  // namespace

Result<std::string> QmpClient::read_line(steady_clock::time_point deadline) {
  while (true) {
    if (const std::size_t end = held_.find('\n'); end != std::string::npos) {
      std::string line = held_.substr(0, end);
      held_.erase(0, end + 1);
      return line;
    }
    if (held_.size() > kLongestLine) {
      return fail(ErrorCode::kDataLoss, "QEMU's control line sends no end of line",
                  "check that qemu-system-arm is QEMU");
    }
    const auto left = std::chrono::ceil<milliseconds>(deadline - steady_clock::now());
    if (left.count() <= 0) {
      return fail(ErrorCode::kDeadlineExceeded, "QEMU did not answer on its control line in time",
                  "check whether the computer is overloaded, then start the simulator again");
    }
    pollfd file{socket_.number(), POLLIN, 0};
    if (::poll(&file, 1, static_cast<int>(left.count())) <= 0) {
      continue;
    }
    std::array<char, 4096> bytes;
    const ssize_t count = ::recv(socket_.number(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) {
      return gone();
    }
    if (count > 0) {
      held_.append(bytes.data(), static_cast<std::size_t>(count));
    }
  }
}

Status QmpClient::negotiate(milliseconds timeout) {
  const Result<std::string> greeting = read_line(steady_clock::now() + timeout);
  if (!greeting) {
    return std::unexpected(greeting.error());
  }
  const auto parsed = nlohmann::json::parse(*greeting, nullptr, false);
  if (!parsed.is_object() || !parsed.contains("QMP")) {
    return fail(ErrorCode::kDataLoss, "QEMU's control line does not begin with a QMP greeting",
                "check that qemu-system-arm is QEMU 7 or later");
  }
  return execute("qmp_capabilities", "", timeout);
}

Status QmpClient::execute(std::string_view command, std::string_view arguments, milliseconds timeout) {
  const auto deadline = steady_clock::now() + timeout;
  const std::string line = arguments.empty()
                               ? fmt::format("{{\"execute\":\"{}\"}}\n", command)
                               : fmt::format("{{\"execute\":\"{}\",\"arguments\":{}}}\n", command, arguments);
  if (::send(socket_.number(), line.data(), line.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(line.size())) {
    return gone();
  }
  while (true) {
    const Result<std::string> reply = read_line(deadline);
    if (!reply) {
      return std::unexpected(reply.error());
    }
    const auto parsed = nlohmann::json::parse(*reply, nullptr, false);
    if (parsed.is_object() && parsed.contains("return")) {
      return {};
    }
    if (parsed.is_object() && parsed.contains("error")) {
      return fail(ErrorCode::kInternal, fmt::format("QEMU refuses {}: {}", command, parsed["error"].dump()),
                  "use QEMU 7.2, which this board was tried with");
    }
    // An event, such as RESET: nobody asked.
  }
}

Status QmpClient::set_temperature(std::string_view device, std::int64_t millidegrees) {
  // The range of QEMU's TMP105.
  const std::int64_t shown = std::clamp<std::int64_t>(millidegrees, -128'000, 127'999);
  return execute("qom-set",
                 fmt::format(R"({{"path":"/machine/peripheral/{}","property":"temperature","value":{}}})",
                             device, shown),
                 kTemperatureTimeout);
}

}  // namespace scatter::simulator
