// power_cuts: cuts the power at every flash operation and checks what the firmware makes of it.
#include <malloc.h>

#include <charconv>
#include <chrono>
#include <cstdlib>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "tests/power_cuts/enumeration.h"
#include "tests/power_cuts/scenario.h"

namespace {

using namespace scatter::power_cuts;

constexpr std::string_view kUsage =
    "usage: power_cuts [--quick] [--only TEXT] [--threads N]\n"
    "       power_cuts --list\n"
    "       power_cuts --replay GROUP:VARIANT:NAME:op,kind,detail[:op,kind,detail]\n"
    "kinds: before torn half after unstable trap\n";

struct Options {
  bool quick = false;
  bool list = false;
  std::string only;
  std::string replay;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
};

bool parse(const std::vector<std::string_view>& words, Options& options) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto value = [&]() -> std::string_view { return ++i < words.size() ? words[i] : ""; };
    if (words[i] == "--quick") {
      options.quick = true;
    } else if (words[i] == "--list") {
      options.list = true;
    } else if (words[i] == "--only") {
      options.only = value();
    } else if (words[i] == "--replay") {
      options.replay = value();
    } else if (words[i] == "--threads") {
      const std::string_view number = value();
      const auto [end, error] =
          std::from_chars(number.data(), number.data() + number.size(), options.threads);
      if (error != std::errc() || end != number.data() + number.size() || options.threads == 0) {
        return false;
      }
    } else {
      return false;
    }
  }
  return true;
}

int replay(const Scenarios& scenarios, std::string_view line) {
  for (const auto& scenario : scenarios) {
    const std::string name = scenario->name() + ":";
    Cuts cuts;
    if (line.starts_with(name) && parse_cuts(line.substr(name.size()), cuts)) {
      const std::string promise = try_point(*scenario, cuts);
      fmt::print("{}: {}\n", line, promise.empty() ? "every promise kept" : promise);
      return promise.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
    }
  }
  fmt::print(stderr, "error: no such point: {}\nremedy: copy a line that this program printed\n{}", line,
             kUsage);
  return 2;
}

int enumerate_all(const Scenarios& scenarios, const Options& options) {
  const auto began = std::chrono::steady_clock::now();
  Outcome total;
  fmt::print("{:<44} {:>9} {:>9} {:>9}\n", "scenario", "one cut", "two cuts", "failed");
  for (const auto& scenario : scenarios) {
    if (scenario->name().find(options.only) == std::string::npos) {
      continue;
    }
    const Outcome outcome = enumerate(*scenario, options.quick, options.threads);
    total.single_points += outcome.single_points;
    total.double_points += outcome.double_points;
    total.failed += outcome.failed;
    fmt::print("{:<44} {:>9} {:>9} {:>9}\n", scenario->name(), outcome.single_points, outcome.double_points,
               outcome.failed);
    for (const Failure& failure : outcome.failures) {
      fmt::print("  {}\n  power_cuts --replay {}\n", failure.promise, failure.replay);
    }
    std::fflush(stdout);
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  fmt::print("{} points ({} with one cut, {} with two), {} failed, {:.1f} s on {} threads\n",
             total.single_points + total.double_points, total.single_points, total.double_points,
             total.failed, seconds, options.threads);
  if (total.single_points == 0) {
    fmt::print(stderr, "error: no scenario's name contains: {}\nremedy: see power_cuts --list\n",
               options.only);
    return 2;
  }
  return total.failed == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace

int main(int argc, char** argv) {
  // Millions of short-lived pages: giving them back to the kernel each time costs more than the trials.
  (void)mallopt(M_MMAP_THRESHOLD, 64 << 20);
  (void)mallopt(M_TRIM_THRESHOLD, 512 << 20);
  Options options;
  if (!parse({argv + 1, argv + argc}, options)) {
    fmt::print(stderr, "{}", kUsage);
    return 2;
  }
  Scenarios scenarios;
  add_calibration_cuts(scenarios);
  add_update_cuts(scenarios);
  if (options.list) {
    for (const auto& scenario : scenarios) {
      fmt::print("{}\n", scenario->name());
    }
    return EXIT_SUCCESS;
  }
  return options.replay.empty() ? enumerate_all(scenarios, options) : replay(scenarios, options.replay);
}
