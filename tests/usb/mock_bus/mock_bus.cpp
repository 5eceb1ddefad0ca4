#include "tests/usb/mock_bus/mock_bus.h"

#include <poll.h>

#include <algorithm>
#include <exception>
#include <sstream>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "tests/usb/mock_bus/other_wire.h"
#include "tests/usb/mock_bus/plugged_instrument.h"
#include "tests/usb/mock_bus/stranger.h"

namespace scatter::mock_bus {

MockBus::MockBus()
    : default_server_(testbed_.root() / "ioctl/_default", other_files_),
      control_((testbed_.root() / "control").string(),
               [this](const std::string& line) { return request(line); }) {
  set_memory_limit(16'000'000);
}

void MockBus::set_memory_limit(std::uint64_t bytes) {
  conditions_.memory_limit = bytes;
  testbed_.set_attribute("/module/usbcore/parameters", "usbfs_memory_mb",
                         fmt::format("{}\n", (bytes + 999'999) / 1'000'000));
}

void MockBus::add_root_hub(int number) {
  const int bus = number + 1;
  SysDevice hub;
  hub.path = fmt::format("/devices/mock/usb{}", bus);
  hub.subsystem = "usb";
  hub.node = fmt::format("bus/usb/{:03}/001", bus);
  hub.properties = {{"DEVTYPE", "usb_device"}, {"DRIVER", "usb"}, {"PRODUCT", "1d6b/2/601"}};
  // Linux's own root hub of a high-speed bus.
  const std::string descriptors(
      "\x12\x01\x00\x02\x09\x00\x01\x40\x6b\x1d\x02\x00\x01\x06\x03\x02\x01\x01"
      "\x09\x02\x19\x00\x01\x01\x00\xe0\x00\x09\x04\x00\x00\x01\x09\x00\x00\x00\x07\x05\x81\x03\x04\x00\x0c",
      43);
  hub.attributes = {{"busnum", fmt::format("{}\n", bus)},
                    {"devnum", "1\n"},
                    {"devpath", "0\n"},
                    {"idVendor", "1d6b\n"},
                    {"idProduct", "0002\n"},
                    {"bcdDevice", "0601\n"},
                    {"bConfigurationValue", "1\n"},
                    {"bDeviceClass", "09\n"},
                    {"speed", "480\n"},
                    {"descriptors", descriptors}};
  hub_nodes_.push_back(std::make_unique<DeviceNode>());
  hub_servers_.push_back(std::make_unique<CallServer>(testbed_.socket_of("dev/" + hub.node), other_files_));
  testbed_.add(hub, hub_nodes_.back().get());
}

int MockBus::add(std::unique_ptr<Peripheral> peripheral) {
  const int number = static_cast<int>(slots_.size());
  add_root_hub(number);
  slots_.push_back(std::make_unique<Slot>(testbed_, tally_, conditions_, std::move(peripheral), number));
  return number;
}

Result<int> MockBus::add_instrument(std::string_view query) {
  Result<std::unique_ptr<Peripheral>> instrument = plugged_instrument(query);
  if (!instrument) {
    return std::unexpected(std::move(instrument.error()));
  }
  return add(std::move(*instrument));
}

Result<int> MockBus::add_of_other_wire(std::string_view query, std::uint8_t major, bool refuses) {
  Result<std::unique_ptr<Peripheral>> instrument = plugged_instrument(query);
  if (!instrument) {
    return std::unexpected(std::move(instrument.error()));
  }
  const auto manner = refuses ? OtherWire::Manner::kRefuses : OtherWire::Manner::kAnswers;
  return add(std::make_unique<OtherWire>(std::move(*instrument), major, manner));
}

std::string MockBus::statistics() const {
  std::size_t under_way = 0;
  for (const auto& slot : slots_) {
    under_way += slot->device() != nullptr ? slot->device()->under_way() : 0;
  }
  return fmt::format(
      "ok submitted={} reaped={} discarded={} under_way={} most_under_way={} bytes_in={} bytes_out={} "
      "empty_reaps={} opened={} abandoned={} refused_memory={} violations={}",
      tally_.submitted, tally_.reaped, tally_.discarded, under_way, tally_.most_under_way, tally_.bytes_in,
      tally_.bytes_out, tally_.empty_reaps, tally_.opened, tally_.abandoned, tally_.refused_memory,
      tally_.violations.size());
}

std::string MockBus::request(const std::string& line) {
  std::istringstream words(line);
  std::string verb;
  words >> verb;
  const auto number = [&](long long fallback) {
    long long value = fallback;
    return words >> value ? value : fallback;
  };
  const auto slot = [&]() -> Slot& { return *slots_.at(static_cast<std::size_t>(number(0))); };
  const auto device = [&]() -> BusDevice& {
    BusDevice* const found = slot().device();
    return found != nullptr ? *found : throw std::runtime_error("nothing is plugged in there");
  };
  try {
    if (verb == "plug") {
      Slot& where = slot();
      where.plug(static_cast<unsigned>(number(480)));
    } else if (verb == "unplug") {
      slot().unplug();
    } else if (verb == "cut_power") {
      slot().cut_power();
    } else if (verb == "press") {
      slot().peripheral().press_button();
    } else if (verb == "add") {
      std::string query;
      words >> query;
      const Result<int> added = add_instrument(query);
      return added ? fmt::format("ok {}", *added) : "error " + added.error().what;
    } else if (verb == "add_of_other_wire") {
      const auto major = static_cast<std::uint8_t>(number(0));
      const bool refuses = number(1) != 0;
      std::string query;
      words >> query;
      const Result<int> added = add_of_other_wire(query, major, refuses);
      return added ? fmt::format("ok {}", *added) : "error " + added.error().what;
    } else if (verb == "add_stranger") {
      return fmt::format("ok {}", add(std::make_unique<Stranger>()));
    } else if (verb == "access") {
      conditions_.access = number(1) != 0;
      for (const auto& each : slots_) {
        if (each->device() != nullptr) {
          each->device()->set_access(conditions_.access);
        }
      }
    } else if (verb == "hold_received" || verb == "hold_sent") {
      (verb == "hold_sent" ? conditions_.hold_sent : conditions_.hold_received) = number(1) != 0;
      for (const auto& each : slots_) {
        each->release_held();
      }
    } else if (verb == "hold") {
      BusDevice& held = device();
      const auto interface = static_cast<std::uint8_t>(number(0));
      held.hold_by_other(interface, number(1) != 0);
    } else if (verb == "hang") {
      Slot& where = slot();
      where.set_hung(number(1) != 0);
    } else if (verb == "memory") {
      set_memory_limit(static_cast<std::uint64_t>(number(16'000'000)));
    } else if (verb == "garble") {
      conditions_.garble = static_cast<int>(number(-1));
    } else if (verb == "scramble") {
      conditions_.scramble = static_cast<std::uint32_t>(number(0));
    } else if (verb == "hid_driver") {
      conditions_.hid_driver = number(1) != 0;
    } else if (verb == "may_abandon") {
      may_abandon_ = number(1) != 0;
    } else if (verb == "statistics") {
      return statistics();
    } else {
      return "error unknown request: " + verb;
    }
  } catch (const std::exception& error) {
    return fmt::format("error {}: {}", verb, error.what());
  }
  return "ok";
}

bool MockBus::serve() {
  bool did = default_server_.serve();
  for (const auto& server : hub_servers_) {
    did = server->serve() || did;
  }
  for (const auto& slot : slots_) {
    slot->run();
    did = slot->serve() || did;
  }
  return control_.serve() || did;
}

void MockBus::serve_until(int ended) {
  std::vector<pollfd> files;
  for (;;) {
    while (serve()) {
    }
    files.assign(1, {ended, POLLIN, 0});
    default_server_.add_waits(files);
    control_.add_waits(files);
    for (const auto& server : hub_servers_) {
      server->add_waits(files);
    }
    std::uint64_t wait = 1'000'000;
    for (const auto& slot : slots_) {
      slot->add_waits(files);
      wait = std::min(wait, slot->wait_us());
    }
    const timespec timeout{static_cast<time_t>(wait / 1'000'000), static_cast<long>(wait % 1'000'000 * 1000)};
    (void)::ppoll(files.data(), files.size(), &timeout, nullptr);
    for (const auto& slot : slots_) {
      slot->passed();
    }
    if ((files.front().revents & POLLIN) != 0) {
      break;
    }
  }
  // The last closes of files are still on their way.
  while (serve()) {
  }
}

std::vector<std::string> MockBus::complaints() const {
  std::vector<std::string> lines = tally_.violations;
  if (tally_.abandoned > 0 && !may_abandon_) {
    lines.push_back(
        fmt::format("{} transfers were under way when their device file was closed", tally_.abandoned));
  }
  if (testbed_.lost_news() > 0) {
    lines.push_back(fmt::format("{} hotplug events were not taken within 200 ms", testbed_.lost_news()));
  }
  return lines;
}

}  // namespace scatter::mock_bus
