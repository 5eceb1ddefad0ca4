#include "tests/usb/mock_bus/testbed.h"

#include <arpa/inet.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include <fmt/format.h>

#include "tests/usb/mock_bus/device_node.h"
#include "tests/usb/mock_bus/file_descriptor.h"

namespace scatter::mock_bus {

namespace fs = std::filesystem;

namespace {

void write_file(const fs::path& path, std::string_view content) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  if (!file.flush()) {
    throw std::runtime_error(fmt::format("{}: cannot be written", path.string()));
  }
}

bool is_bus(std::string_view subsystem) {
  return subsystem == "usb" || subsystem == "hid";
}

std::string base_name(const std::string& path) {
  return path.substr(path.rfind('/') + 1);
}

/// "../../.." from /sys/devices/... up to /sys.
std::string up_to_sys(const std::string& path) {
  std::string up;
  for (auto k = std::count(path.begin(), path.end(), '/'); k > 0; --k) {
    up += k > 1 ? "../" : "..";
  }
  return up;
}

std::string underscores(std::string node) {
  std::replace(node.begin(), node.end(), '/', '_');
  return node;
}

/// The message of libudev's monitors (version tag 0xfeedcafe).
struct NewsHeader {
  std::array<char, 8> prefix{'l', 'i', 'b', 'u', 'd', 'e', 'v', '\0'};
  std::uint32_t magic = htonl(0xfeedcafe);
  std::uint32_t header_size = sizeof(NewsHeader);
  std::uint32_t properties_offset = sizeof(NewsHeader);
  std::uint32_t properties_size = 0;
  /// The kernel drops messages by these before a monitor sees them.
  std::uint32_t subsystem_hash = 0;
  std::uint32_t devtype_hash = 0;
  std::uint32_t tag_bloom_high = 0;
  std::uint32_t tag_bloom_low = 0;
};

/// MurmurHash2 of Austin Appleby with seed 0, in network order, as udev's filters compare it.
std::uint32_t filter_hash(std::string_view text) {
  constexpr std::uint32_t kFactor = 0x5bd1e995;
  auto hash = static_cast<std::uint32_t>(text.size());
  for (; text.size() >= 4; text.remove_prefix(4)) {
    std::uint32_t word = 0;
    std::memcpy(&word, text.data(), 4);
    word *= kFactor;
    word ^= word >> 24U;
    hash = (hash * kFactor) ^ (word * kFactor);
  }
  if (!text.empty()) {
    for (std::size_t k = 0; k < text.size(); ++k) {
      hash ^= static_cast<std::uint32_t>(static_cast<unsigned char>(text[k])) << (8U * k);
    }
    hash *= kFactor;
  }
  hash ^= hash >> 13U;
  hash *= kFactor;
  return htonl(hash ^ hash >> 15U);
}

/// False: the listener is there and did not take it.
bool send_news(const fs::path& listener, const std::string& message) {
  const FileDescriptor socket(::socket(AF_UNIX, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = listener.string();
  std::memcpy(address.sun_path, path.c_str(), std::min(path.size() + 1, sizeof address.sun_path));
  if (::connect(socket.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    // The program has closed its monitor, or ended.
    std::error_code ignored;
    fs::remove(listener, ignored);
    return true;
  }
  while (::send(socket.number(), message.data(), message.size(), MSG_NOSIGNAL) < 0) {
    if (errno != EAGAIN) {
      return true;
    }
    pollfd room{socket.number(), POLLOUT, 0};
    if (::poll(&room, 1, 200) <= 0) {
      return false;
    }
  }
  return true;
}

}  // namespace

Testbed::Testbed() {
  std::string name = (fs::temp_directory_path() / "scatter-usb-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw std::runtime_error(fmt::format("{}: {}", name, std::strerror(errno)));
  }
  root_ = name;
  for (const char* folder : {"sys/bus", "sys/class", "sys/dev/char", "sys/devices", "dev/.node"}) {
    fs::create_directories(root_ / folder);
  }
  // This process holds the other ends of the device files, which is nobody's business.
  fs::create_directories(root_ / fmt::format("proc/{}/fd", ::getpid()));
}

Testbed::~Testbed() {
  std::error_code ignored;
  fs::remove_all(root_, ignored);
}

fs::path Testbed::socket_of(std::string_view node) const {
  return root_ / "ioctl" / node;
}

fs::path Testbed::sys(const std::string& path) const {
  return root_ / ("sys" + path);
}

Properties Testbed::with_node(const SysDevice& device, const DeviceNode* node) {
  Properties properties = device.properties;
  if (node != nullptr) {
    properties.emplace_back("MAJOR", std::to_string(node->major()));
    properties.emplace_back("MINOR", std::to_string(node->minor()));
    properties.emplace_back("DEVNAME", device.node);
  }
  return properties;
}

void Testbed::add(const SysDevice& device, const DeviceNode* node) {
  const fs::path folder = sys(device.path);
  fs::create_directories(folder);
  std::string uevent;
  for (const auto& [key, value] : with_node(device, node)) {
    uevent += key + "=" + value + "\n";
  }
  write_file(folder / "uevent", uevent);
  for (const auto& [name, value] : device.attributes) {
    write_file(folder / name, value);
  }
  const std::string group =
      is_bus(device.subsystem) ? "bus/" + device.subsystem : "class/" + device.subsystem;
  set_link(device.path, "subsystem", up_to_sys(device.path) + "/" + group);
  const fs::path links = root_ / "sys" / (is_bus(device.subsystem) ? group + "/devices" : group);
  fs::create_directories(links);
  const std::string from_links = is_bus(device.subsystem) ? "../../.." : "../..";
  fs::remove(links / base_name(device.path));
  fs::create_symlink(from_links + device.path, links / base_name(device.path));
  if (node != nullptr) {
    const fs::path file = root_ / "dev" / device.node;
    fs::create_directories(file.parent_path());
    fs::remove(file);
    fs::create_symlink(node->path(), file);
    const std::string number = fmt::format("{}:{}", node->major(), node->minor());
    write_file(folder / "dev", number + "\n");
    const fs::path known = root_ / "dev/.node" / underscores(device.node);
    fs::remove(known);
    fs::create_symlink(number, known);
    const fs::path by_number = root_ / "sys/dev/char" / number;
    fs::remove(by_number);
    fs::create_symlink("../.." + device.path, by_number);
  }
}

void Testbed::remove(const SysDevice& device) {
  std::error_code ignored;
  if (!device.node.empty()) {
    std::ifstream file(sys(device.path) / "dev");
    if (std::string number; std::getline(file, number)) {
      fs::remove(root_ / "sys/dev/char" / number, ignored);
    }
    fs::remove(root_ / "dev" / device.node, ignored);
    fs::remove(root_ / "dev/.node" / underscores(device.node), ignored);
  }
  const std::string name = base_name(device.path);
  fs::remove(root_ / "sys/bus" / device.subsystem / "devices" / name, ignored);
  fs::remove(root_ / "sys/class" / device.subsystem / name, ignored);
  fs::remove_all(sys(device.path), ignored);
}

void Testbed::set_attribute(const std::string& path, const std::string& name, std::string_view value) {
  fs::create_directories(sys(path));
  write_file(sys(path) / name, value);
}

void Testbed::set_link(const std::string& path, const std::string& name, const std::string& target) {
  std::error_code ignored;
  fs::remove(sys(path) / name, ignored);
  if (!target.empty()) {
    fs::create_symlink(target, sys(path) / name);
  }
}

void Testbed::announce(const SysDevice& device, std::string_view action) {
  std::string properties;
  const auto add_property = [&](std::string_view key, std::string_view value) {
    properties += fmt::format("{}={}", key, value);
    properties.push_back('\0');
  };
  add_property("ACTION", action);
  add_property("DEVPATH", device.path);
  add_property("SUBSYSTEM", device.subsystem);
  add_property("SEQNUM", std::to_string(++sequence_));
  for (const auto& [key, value] : device.properties) {
    add_property(key, value);
  }
  if (!device.node.empty()) {
    add_property("DEVNAME", "/dev/" + device.node);
  }
  NewsHeader header;
  header.properties_size = static_cast<std::uint32_t>(properties.size());
  header.subsystem_hash = filter_hash(device.subsystem);
  for (const auto& [key, value] : device.properties) {
    if (key == "DEVTYPE") {
      header.devtype_hash = filter_hash(value);
    }
  }
  std::string message(reinterpret_cast<const char*>(&header), sizeof header);
  message += properties;
  std::vector<fs::path> listeners;
  // Also called when the bus is taken apart, by when somebody may have tidied up the folder: then nobody
  // listens.
  std::error_code error;
  for (fs::directory_iterator entry(root_, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    if (entry->path().filename().string().starts_with("event")) {
      listeners.push_back(entry->path());
    }
  }
  for (const fs::path& listener : listeners) {
    if (!send_news(listener, message)) {
      ++lost_news_;
    }
  }
}

}  // namespace scatter::mock_bus
