// A folder that looks like the root of a Linux system with instruments on its bus: what sysfs, /dev, /proc
// and udev hold there, by the kernel's Documentation/ABI and udev's formats.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

struct MadeUpDevice {
  std::string port = "1-1.4";
  int bus = 1;
  int address = 7;
  std::string product_id = "000d";
  std::string product = "HS-1";
  std::string serial = "SC42";
  std::string release = "0123";
  std::string speed = "480";
  std::string stream_class = "ff";     ///< Of interface 0.
  std::string stream_subclass = "05";  ///< Of interface 0.
  std::string stream_driver;           ///< "" for none.
  bool hid = true;
  bool hidraw = true;
};

class MadeUpSystem {
 public:
  /// A healthy computer: USB, the rule installed, udev running, 16 MB for transfers, vhci-hcd loaded.
  MadeUpSystem();
  ~MadeUpSystem();
  MadeUpSystem(const MadeUpSystem&) = delete;
  MadeUpSystem& operator=(const MadeUpSystem&) = delete;

  void plug_in(const MadeUpDevice& device);
  /// A process that has the device's node open, and interface 0 claimed.
  void hold(const MadeUpDevice& device, int process_id, const std::string& program);
  void write(const std::filesystem::path& file, const std::string& content);
  void remove(const std::filesystem::path& path);
  void link(const std::filesystem::path& target, const std::filesystem::path& name);
  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }

 private:
  std::filesystem::path folder_;
};
