#include "simulator/usbip/vhci_bus.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>

#include <fmt/format.h>

namespace scatter::simulator {
namespace {

/// VDEV_ST_NULL in the driver: nothing is plugged in there.
constexpr unsigned kFree = 4;
constexpr int kSocketBytes = 4 << 20;

std::unexpected<Error> refused(const std::filesystem::path& file, int number) {
  if (number == EACCES || number == EPERM || number == EROFS) {
    return fail(ErrorCode::kPermissionDenied,
                fmt::format("{}: {}; only root may plug devices into this machine's bus", file.string(),
                            std::strerror(number)),
                "run it with sudo");
  }
  return fail(ErrorCode::kUnavailable, fmt::format("{}: {}", file.string(), std::strerror(number)),
              "look at the kernel's messages: sudo dmesg | tail");
}

}  // namespace

Status VhciBus::check() const {
  std::error_code ignored;
  if (!std::filesystem::exists(controller_ / "status", ignored)) {
    return fail(
        ErrorCode::kNotFound,
        fmt::format("{} is not there: the kernel's module vhci_hcd is not loaded", controller_.string()),
        "sudo modprobe vhci-hcd (Debian: in the package linux-image-amd64, not in linux-image-cloud-amd64)");
  }
  const std::filesystem::path file = controller_ / "attach";
  if (::access(file.c_str(), W_OK) != 0) {
    return refused(file, errno);
  }
  return {};
}

/// High-speed ports of the driver take full speed too. Lines: hub, port, state, speed, ...
std::vector<std::uint32_t> VhciBus::free_ports() const {
  std::vector<std::uint32_t> ports;
  for (int k = 0;; ++k) {
    std::ifstream status(controller_ / (k == 0 ? std::string("status") : fmt::format("status.{}", k)));
    if (!status) {
      return ports;
    }
    for (std::string line; std::getline(status, line);) {
      std::istringstream words(line);
      std::string hub;
      std::uint32_t port = 0;
      unsigned state = 0;
      if (words >> hub >> port >> state && hub == "hs" && state == kFree) {
        ports.push_back(port);
      }
    }
  }
}

Result<VhciBus::Attached> VhciBus::attach(std::uint32_t device_id, std::uint32_t speed) const {
  if (Status usable = check(); !usable) {
    return std::unexpected(usable.error());
  }
  std::array<int, 2> pair{};
  // The driver takes any stream socket; a pair is reachable by nobody else.
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
    return fail(ErrorCode::kUnavailable, fmt::format("socketpair: {}", std::strerror(errno)),
                "close other programs");
  }
  FileDescriptor ours(pair[0]);
  const FileDescriptor kernels(pair[1]);
  for (const int each : pair) {
    ::setsockopt(each, SOL_SOCKET, SO_SNDBUF, &kSocketBytes, sizeof kSocketBytes);
  }
  ::fcntl(ours.number(), F_SETFL, ::fcntl(ours.number(), F_GETFL) | O_NONBLOCK);
  const std::filesystem::path file = controller_ / "attach";
  const FileDescriptor attach_file(::open(file.c_str(), O_WRONLY | O_CLOEXEC));
  if (!attach_file.open()) {
    return refused(file, errno);
  }
  for (const std::uint32_t port : free_ports()) {
    const std::string line = fmt::format("{} {} {} {}", port, kernels.number(), device_id, speed);
    if (::write(attach_file.number(), line.data(), line.size()) == static_cast<ssize_t>(line.size())) {
      return Attached{std::move(ours), port};
    }
    if (errno != EBUSY) {  // Else somebody was quicker.
      return refused(file, errno);
    }
  }
  return fail(ErrorCode::kBusy,
              fmt::format("{}: no free port for a device", (controller_ / "status").string()),
              "list the ports with `usbip port` and free one with `sudo usbip detach -p PORT`");
}

}  // namespace scatter::simulator
