#include "host_sdk/device/usb/availability.h"

#include <unistd.h>

#include <array>
#include <cstdio>

namespace scatter::device::usb {

std::filesystem::path under(const SystemRoot& root, const std::filesystem::path& path) {
  return root.path / path.relative_path();
}

bool may_read_and_write(const std::filesystem::path& path) {
  return access(path.c_str(), R_OK | W_OK) == 0;
}

Availability availability(const BusEntry& entry, const SystemRoot& root, const MayUse& may_use) {
  if (!entry.ours) {
    return Availability::kNotOurs;
  }
  const auto node = under(root, entry.node());
  if (!(may_use ? may_use(node) : may_read_and_write(node))) {
    return Availability::kNoPermission;
  }
  if (entry.dfu_mode) {
    return Availability::kDfuMode;
  }
  return entry.in_use ? Availability::kInUse : Availability::kFree;
}

const char* words(Availability availability) noexcept {
  switch (availability) {
    case Availability::kFree:
      return "free";
    case Availability::kInUse:
      return "in use";
    case Availability::kNoPermission:
      return "no permission";
    case Availability::kDfuMode:
      return "DFU mode";
    case Availability::kNotOurs:
      break;
  }
  return "not ours";
}

std::string uri_of(const BusEntry& entry) {
  return entry.serial.empty() ? "usb:port=" + entry.port : "usb:serial=" + entry.serial;
}

std::string holder_words(const BusEntry& entry) {
  std::string text;
  for (const Holder& holder : entry.holders) {
    text += (text.empty() ? "" : ", ") + holder.program + " (" + std::to_string(holder.process_id) + ")";
  }
  return text.empty() ? "another program" : text;
}

std::string release_words(std::uint16_t release_bcd) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%x.%x.%x", static_cast<unsigned>(release_bcd >> 8U),
                static_cast<unsigned>(release_bcd >> 4U & 0xFU), static_cast<unsigned>(release_bcd & 0xFU));
  return text.data();
}

bool slow_bus(const BusEntry& entry) noexcept {
  return entry.speed_mbps > 0 && entry.speed_mbps < 480;
}

}  // namespace scatter::device::usb
