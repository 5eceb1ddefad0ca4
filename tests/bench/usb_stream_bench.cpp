// The SDK's stream over real libusb against a bare libusb loop on the same virtual instrument, on the mocked
// bus.
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <vector>

#include "tests/bench/bench.h"

namespace scatter::bench {
namespace {

struct Turn {
  double bare_MB_s = 0;
  double bare_ms_per_MB = 0;
  double ours_MB_s = 0;
  double ours_ms_per_MB = 0;
};

/// One line of the program's; false: another one.
bool take(const char* line, Turn& turn) {
  return std::sscanf(line, "bare libusb %lf MB/s, %lf ms of processor per MB; SDK %lf MB/s, %lf ms per MB",
                     &turn.bare_MB_s, &turn.bare_ms_per_MB, &turn.ours_MB_s, &turn.ours_ms_per_MB) == 4;
}

double median_of(const std::vector<Turn>& turns, double Turn::* figure) {
  std::vector<double> values;
  for (const Turn& turn : turns) {
    values.push_back(turn.*figure);
  }
  return median(std::move(values));
}

/// Three runs of the program, each of three turns (bare, ours).
std::vector<Figure> usb_stream() {
  std::vector<Turn> turns;
  for (int run = 0; run < 3; ++run) {
    std::FILE* const pipe = ::popen(SCATTER_USB_STREAM_COMMAND, "r");
    if (pipe == nullptr) {
      break;
    }
    char line[256];
    while (std::fgets(line, sizeof line, pipe) != nullptr) {
      if (Turn turn; take(line, turn)) {
        turns.push_back(turn);
      }
    }
    if (::pclose(pipe) != 0) {
      fmt::print(stderr, "usb.stream: {} failed\n", SCATTER_USB_STREAM_COMMAND);
      return {};
    }
  }
  if (turns.empty()) {
    fmt::print(stderr, "usb.stream: {} printed no figures\n", SCATTER_USB_STREAM_COMMAND);
    return {};
  }
  return {make_figure("usb.stream.throughput", median_of(turns, &Turn::ours_MB_s), "MB/s", "bare libusb loop",
                      median_of(turns, &Turn::bare_MB_s), Better::kHigher),
          make_figure("usb.stream.processor", median_of(turns, &Turn::ours_ms_per_MB), "ms/MB",
                      "bare libusb loop", median_of(turns, &Turn::bare_ms_per_MB), Better::kLower)};
}

const Benchmark kUsbStream{"usb.stream", usb_stream};

}  // namespace
}  // namespace scatter::bench
