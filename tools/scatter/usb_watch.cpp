#include "tools/scatter/usb_watch.h"

#include <fmt/format.h>

#include <condition_variable>
#include <cstdio>
#include <mutex>

#include "host_sdk/device/usb/context.h"

namespace scatter::cli {

namespace usb = device::usb;

Result<Answer> watch_bus(const Context& context) {
  auto bus = usb::Context::make();
  if (!bus) {
    return std::unexpected(bus.error());
  }
  std::mutex mutex;
  std::condition_variable_any stopped;
  int arrived = 0;
  int left = 0;
  {
    const usb::Watch watch = bus->watch(
        [&](const usb::Change& change) {
          const bool came = change.kind == usb::Change::Kind::kArrived;
          const std::lock_guard lock(mutex);
          (came ? arrived : left) += 1;
          const std::string line =
              context.json ? nlohmann::ordered_json{{"change", came ? "arrived" : "left"},
                                                    {"uri", change.uri},
                                                    {"serial", change.serial},
                                                    {"dfu_mode", change.dfu_mode}}
                                 .dump()
                           : fmt::format("{} {}{}", came ? "arrived" : "left   ", change.uri,
                                         change.dfu_mode ? " (waits for firmware: DFU mode)" : "");
          std::fprintf(stdout, "%s\n", line.c_str());
          std::fflush(stdout);
        },
        true);
    std::unique_lock lock(mutex);
    stopped.wait(lock, context.stop, [] { return false; });
  }
  Answer answer;
  answer.json = {{"arrived", arrived}, {"left", left}};
  return answer;
}

}  // namespace scatter::cli
