// vm_watch [SECONDS]: prints each arrival and removal with the time since boot, and opens what arrives by its
// serial number: "arrived SERIAL", "opened SERIAL after MS", "left SERIAL".
#include <chrono>
#include <cstdlib>
#include <thread>

#include "tests/vm/host.h"

using namespace scatter;

int main(int count, char** words) {
  const auto host = vm::Host::make();
  if (!host) {
    return vm::report(host.error());
  }
  const auto watch = host->context().watch(
      [&](const device::usb::Change& change) {
        const auto begin = std::chrono::steady_clock::now();
        const bool arrived = change.kind == device::usb::Change::Kind::kArrived;
        const char* mode = change.dfu_mode ? " in DFU mode" : "";
        fmt::print("{} {}{}\n", arrived ? "arrived" : "left", change.serial, mode);
        std::fflush(stdout);
        if (arrived && !change.dfu_mode) {
          const auto device = host->open(change.uri);
          if (!device) {
            (void)vm::report(device.error());
            return;
          }
          const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
          fmt::print("opened {} after {:.0f} ms\n", change.serial, took.count());
          std::fflush(stdout);
        }
      },
      true);
  fmt::print("watching\n");
  std::fflush(stdout);
  std::this_thread::sleep_for(std::chrono::seconds(count > 1 ? std::atoi(words[1]) : 30));
  return 0;
}
