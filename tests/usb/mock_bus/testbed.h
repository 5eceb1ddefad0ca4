// The folder that programs under umockdev's preloaded library see as /sys and /dev, and the news of its
// devices.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace scatter::mock_bus {

class DeviceNode;

using Properties = std::vector<std::pair<std::string, std::string>>;

/// One directory of /sys/devices.
struct SysDevice {
  std::string path;       ///< "/devices/mock/usb1/1-1"
  std::string subsystem;  ///< "usb" is a bus, "hid" too; others are classes.
  Properties properties;  ///< Of its uevent file: DEVTYPE, DRIVER, ...
  Properties attributes;  ///< Other files; text ones end with a line break.
  std::string node;       ///< "bus/usb/001/002" below /dev; "" for none.
};

/// Laid out as umockdev's own testbed is. Gone with the object.
/// Throws std::runtime_error or std::filesystem::filesystem_error when the disk refuses.
class Testbed {
 public:
  Testbed();
  ~Testbed();
  Testbed(const Testbed&) = delete;
  Testbed& operator=(const Testbed&) = delete;

  [[nodiscard]] const std::filesystem::path& root() const noexcept { return root_; }
  /// Where the library looks for the socket of a device file.
  [[nodiscard]] std::filesystem::path socket_of(std::string_view node) const;

  /// `node` null: no device file.
  void add(const SysDevice& device, const DeviceNode* node = nullptr);
  void remove(const SysDevice& device);
  void set_attribute(const std::string& path, const std::string& name, std::string_view value);
  void set_link(const std::string& path, const std::string& name, const std::string& target);
  /// Tells every udev monitor of every program; does not throw for the disk. `action`: "add", "remove",
  /// "bind".
  void announce(const SysDevice& device, std::string_view action);
  /// N of the next /dev/hidrawN; each is used once.
  [[nodiscard]] int next_hidraw() noexcept { return hidraws_++; }
  /// News that a program did not take within 200 ms; it never learns of them.
  [[nodiscard]] std::uint32_t lost_news() const noexcept { return lost_news_; }

 private:
  [[nodiscard]] std::filesystem::path sys(const std::string& path) const;
  [[nodiscard]] static Properties with_node(const SysDevice& device, const DeviceNode* node);

  std::filesystem::path root_;
  std::uint64_t sequence_ = 0;
  int hidraws_ = 0;
  std::uint32_t lost_news_ = 0;
};

}  // namespace scatter::mock_bus
