#include "tools/scatter/usb_listing.h"

#include <fmt/format.h>

#include "host_sdk/device/usb/availability.h"
#include "host_sdk/device/usb/udev_rule.h"

namespace scatter::cli {
namespace {

namespace usb = device::usb;

struct Advice {
  std::string detail;
  std::string remedy;
};

Advice advice(const usb::BusEntry& entry, usb::Availability state) {
  switch (state) {
    case usb::Availability::kInUse:
      return {fmt::format("by {}", usb::holder_words(entry)), "close that program"};
    case usb::Availability::kNoPermission:
      return {fmt::format("this user may not open {}", entry.node().string()),
              "scatter doctor says what to do; most often: " + std::string(usb::kInstallUdevRule)};
    case usb::Availability::kDfuMode:
      return {"waits for firmware", "unplug it and plug it in again; if it stays so: scatter flash " +
                                        usb::uri_of(entry) + " IMAGE.scfw, or dfu-util"};
    case usb::Availability::kNotOurs:
      return {"another maker's device with the same numbers", "none needed: it is left alone"};
    case usb::Availability::kFree:
      break;
  }
  if (usb::slow_bus(entry)) {
    return {fmt::format("slow bus: {} Mb/s, expected 480", entry.speed_mbps),
            "use another socket, a shorter cable and no old hub"};
  }
  return {};
}

}  // namespace

std::vector<std::string> row_of(const usb::BusEntry& entry, const usb::SystemRoot& root) {
  const auto state = usb::availability(entry, root);
  const Advice said = advice(entry, state);
  return {usb::uri_of(entry),
          usb::words(state),
          entry.product,
          entry.serial,
          entry.speed_mbps == 0 ? "" : fmt::format("{} Mb/s", entry.speed_mbps),
          fmt::format("firmware {}", usb::release_words(entry.release)),
          said.remedy.empty() ? said.detail : fmt::format("{}: {}", said.detail, said.remedy)};
}

nlohmann::ordered_json to_json(const usb::BusEntry& entry, const usb::SystemRoot& root) {
  const auto state = usb::availability(entry, root);
  const Advice said = advice(entry, state);
  auto holders = nlohmann::ordered_json::array();
  for (const auto& holder : entry.holders) {
    holders.push_back({{"process_id", holder.process_id}, {"program", holder.program}});
  }
  return {{"uri", usb::uri_of(entry)},
          {"state", usb::words(state)},
          {"product", entry.product},
          {"serial", entry.serial},
          {"detail", said.detail},
          {"remedy", said.remedy},
          {"port", entry.port},
          {"speed_mbps", entry.speed_mbps},
          {"slow", usb::slow_bus(entry)},
          {"firmware", usb::release_words(entry.release)},
          {"holders", holders}};
}

}  // namespace scatter::cli
